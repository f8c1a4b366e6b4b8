// SPEC.md, "Codec 16: wavelet".

import { ByteReader } from "../bytes.js";
import { RangeDecoder, bits } from "../entropy.js";
import { Refused } from "../errors.js";
import { EXACT_POWERS } from "../grids.js";
import { Residuals, side } from "../residuals.js";
import { GREATEST, SCALED, firstScale, isStep, stepOf } from "../scales.js";
import { checkCuts } from "../segments.js";
import { restart, startModels } from "../start-models.js";
import { WAVELETS, bandLengths, neededRanges, synthesis } from "../wavelets.js";

export const id = 16;
export const name = "wavelet";
export const version = 0;

const MAX_LEVELS = 16;
const GREATEST_LEAST = 2 ** 39;
const EQUAL = 63;

/**
 * Opens a signal of wavelet.
 *
 * @param {Uint8Array} header WAVELET_HEADER
 * @param {object} layout the signal, as CLIP has it
 * @returns {WaveletDecoder}
 * @throws {Refused} for a header, or a signal, that the codec does not have
 */
export function open(header, layout) {
  return new WaveletDecoder(readHeader(header), layout);
}

function readHeader(bytes) {
  const reader = new ByteReader(bytes, "WAVELET_HEADER");
  const filters = readFilters(reader);
  const levels = reader.u8();
  if (levels > MAX_LEVELS) reader.refuse(`${levels} levels`);
  const codedFrames = reader.varint();
  const decimals = reader.u8();
  if (decimals > 15 && decimals !== SCALED) reader.refuse(`${decimals} decimals`);
  let unit = 1;
  if (decimals === SCALED) {
    unit = reader.f64();
    if (!isStep(unit)) reader.refuse(`a unit of ${unit}`);
  }
  const least = reader.varint();
  if (least < 1 || least > GREATEST_LEAST) reader.refuse(`a least detail of ${least}`);
  reader.end();
  return { filters, levels, codedFrames, decimals, unit, least };
}

function readFilters(reader) {
  const wavelet = reader.u8();
  if (wavelet >= WAVELETS.length) reader.refuse(`the wavelet ${wavelet}`);
  if (wavelet !== 0) return WAVELETS[wavelet];
  const lo = readTaps(reader);
  const hi = readTaps(reader);
  if (hi.length !== lo.length) reader.refuse(`${lo.length} taps beside ${hi.length}`);
  return { lo, hi };
}

function readTaps(reader) {
  const n = reader.varint();
  if (n < 2 || n > 64 || n % 2 !== 0) reader.refuse(`a filter of ${n} taps`);
  const taps = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    taps[i] = reader.f64();
    if (!(Math.abs(taps[i]) <= 16)) reader.refuse(`a tap of ${taps[i]}`);
  }
  return taps;
}

/** The decoder of one signal. */
class WaveletDecoder {
  constructor(header, layout) {
    Object.assign(this, header);
    this.decodes = "values";
    this.nChannels = layout.channels.length;
    this.nResolutions = layout.nResolutions;
    this.taps = this.filters.lo.length;
    this.lengths = bandLengths(this.codedFrames, this.taps, this.levels);
    if (layout.samplesPerFrame !== 1) throw new Refused("a wavelet codec has 1 row a frame");
    if (this.nResolutions < 1 || this.nResolutions > this.levels + 1) {
      throw new Refused(`${this.nResolutions} resolutions of ${this.levels} levels`);
    }
    if (layout.groups.some((group) => group.length !== 1)) {
      throw new Refused("a wavelet codec has one group a channel");
    }
  }

  /**
   * "Segments": what must hold of all stored segments, also of those that are not decoded.
   *
   * @param {object[]} segments a run of segments
   * @throws {Refused}
   */
  check(segments) {
    const unit = 2 ** this.levels;
    const reach = (this.taps - 2) * (unit - 1);
    checkCuts(segments, { unit, codedFrames: this.codedFrames, reach });
  }

  /**
   * Decodes segments, a run in frame order.
   *
   * @param {object[]} segments with their streams
   * @param {object} options
   * @param {number} [options.dropped] how many of the finest stored details are left out
   * @param {number} [options.from] first stored frame that is wanted
   * @param {number} [options.to] the one behind the last
   * @returns {Float64Array} the rows that are wanted
   * @throws {Refused}
   */
  decode(segments, { dropped, from, to }) {
    const last = segments[segments.length - 1];
    const end = last.firstFrame + last.nFrames;
    const out = new Float64Array((to - from) * this.nChannels);

    const needed = neededRanges(from, to, this.taps, this.levels);
    if (this.nChannels > 0 && needed.ends[this.levels] > this.bandEnd(end, this.levels)) {
      throw new Refused(`frames ${from} to ${to - 1} need approximations that are not stored`);
    }
    const streams = new BandStreams(this, segments);
    const nDetails = Math.max(0, this.nResolutions - 1 - dropped);
    for (let channel = 0; channel < this.nChannels; channel++) {
      const bands = this.bands(streams, segments, channel, nDetails, needed);
      const rows = this.synthesized(bands, needed);
      if (rows === null) continue;
      let at = channel;
      for (let i = 0; i < rows.length; i++, at += this.nChannels) out[at] = rows[i];
    }
    return out;
  }

  /** The coefficient of level l behind the last of a segment that ends at frame `end`. */
  bandEnd(end, l) {
    return end === this.codedFrames ? this.lengths[l] : Math.floor(end / 2 ** l);
  }

  /**
   * The bands of a channel, of `needed` coefficients: that of the approximation, then the details
   * from d_N on. A band of nothing but empty streams is null: adding its zeros changes no sum.
   */
  bands(streams, segments, channel, nDetails, needed) {
    const bands = new Array(nDetails + 1).fill(null);
    for (const segment of segments) {
      streams.begin(segment, channel);
      for (let band = 0; band <= nDetails; band++) {
        const level = band === 0 ? this.levels : this.levels - band + 1;
        const first = segment.firstFrame / 2 ** level;
        const count = this.bandEnd(segment.firstFrame + segment.nFrames, level) - first;
        if (!streams.decode(segment.streams[band][channel], band, count)) continue;
        const needFrom = needed.starts[level];
        const needTo = needed.ends[level];
        if (bands[band] === null) bands[band] = new Float64Array(needTo - needFrom);
        const a = Math.max(first, needFrom);
        const b = Math.min(first + count, needTo);
        if (a < b) streams.put(band, a - first, b - first, bands[band], a - needFrom);
      }
    }
    return bands;
  }

  /** The rows of a channel from its bands, N levels down; null where all bands are. */
  synthesized(bands, { starts, ends }) {
    let rows = bands[0];
    for (let level = this.levels; level > 0; level--) {
      const detail = bands[this.levels - level + 1] ?? null;
      if (rows === null && detail === null) continue;
      rows ??= new Float64Array(ends[level] - starts[level]);
      rows = synthesis(this.filters, rows, detail, starts[level - 1], ends[level - 1]);
    }
    return rows;
  }
}

/** Decodes the streams of a channel in a segment one after the other, the coarsest first. */
class BandStreams {
  constructor(decoder, segments) {
    this.decimals = decoder.decimals;
    this.divisor = EXACT_POWERS[decoder.decimals];
    this.unit = decoder.unit;
    this.least = decoder.least;
    /** Place of detail i in the coarser band: (i + shift) div 2. */
    this.shift = (decoder.taps - 2) / 2;
    this.starts = startModels("wavelet_start.json");
    this.model = this.starts[0].copy();
    this.residuals = new Residuals(this.model);

    const frames = segments.reduce((most, { nFrames }) => Math.max(most, nFrames), 0);
    const room = frames + 2 * decoder.taps;
    /** The integers of the band decoded last, and those of the next coarser one. */
    this.v = new Float64Array(room);
    this.coarser = new Float64Array(room);
    /** A[k] and S[k] of the next coarser band; A stands one index further, behind a 0. */
    this.activity = new Float64Array(room + 2);
    this.sides = new Uint8Array(room);
  }

  begin(segment, channel) {
    this.where = `segment at frame ${segment.firstFrame}, channel ${channel}`;
    this.step = null;
    this.count = 0;
  }

  /**
   * Decodes the next band. Returns whether its stream has bytes; without, the band is zeros.
   *
   * @param {Uint8Array} stream
   * @param {number} band 0: the approximation; 1: d_N, and so on
   * @param {number} count coefficients
   */
  decode(stream, band, count) {
    [this.v, this.coarser] = [this.coarser, this.v];
    this.coarserCount = this.count;
    this.count = count;
    if (stream.length === 0) {
      this.v.fill(0, 0, count);
      return false;
    }
    const what = band === 0 ? "approximation" : `detail ${band}`;
    this.what = `${this.where}, ${what}`;
    restart(this.model, this.starts[Math.min(band, 4)]);
    if (band === 0) this.approximation(stream, count);
    else this.detail(stream, band, count);
    return true;
  }

  /** "The stream of an approximation". */
  approximation(stream, count) {
    const { v, residuals } = this;
    const reader = new ByteReader(stream, this.what);
    const form = reader.u8();
    if (this.decimals === SCALED) this.step = this.unit * stepOf(reader.u8());
    v[0] = reader.zigzag();
    this.checkSize(v[0]);
    if (form % 64 === EQUAL) {
      if (form !== EQUAL) reader.refuse(`form ${form}`);
      reader.end();
      v.fill(v[0], 0, count);
      return;
    }
    const predictor = form >> 6;
    const coder = new RangeDecoder(reader.rest());
    let fast = 16 * firstScale(form % 64);
    let slow = fast;
    let near = 0;
    let side1 = 0;
    let side2 = 0;
    for (let i = 1; i < count; i++) {
      const d = i === 1 ? 0 : v[i - 1] - v[i - 2];
      const e = i < 3 ? 0 : v[i - 2] - v[i - 3];
      const predicted = v[i - 1] + predictedChange(predictor, d, e);
      const other = i === 1 ? 3 : side(d);
      const r = residuals.decode(coder, false, fast, slow, near, side1, side2, other);
      v[i] = predicted + r;
      this.checkSize(v[i]);
      const size = 16 * Math.abs(r);
      near = (near + bits(size) - bits(slow)) >> 1;
      fast += Math.floor((size - fast) / 2);
      slow += Math.floor((size - slow) / 32);
      side2 = side1;
      side1 = side(r);
    }
    coder.finish(this.what);
  }

  /** "The stream of a detail". */
  detail(stream, band, count) {
    if (this.decimals === SCALED && this.step === null) {
      throw new Refused(`${this.what}: no step, since the approximation is empty`);
    }
    this.look(band);
    const { v, residuals, least, activity, sides, shift } = this;
    const most = GREATEST - least;
    const coder = new RangeDecoder(stream);
    let run = 0;
    let last = 0;
    let before = 0;
    let side1 = 0;
    let side2 = 0;
    for (let i = 0; i < count; i++) {
      const k = (i + shift) >> 1;
      const within = k < this.coarserCount;
      const f = 11 * last + 5 * before;
      const g = within ? 8 * activity[k + 1] + 4 * (activity[k] + activity[k + 2]) : 0;
      const near = Math.min(bits(run), 7) - 3;
      const other = within ? sides[k] : 3;
      const r = residuals.decode(coder, false, f, g, near, side1, side2, other);
      before = last;
      last = Math.abs(r);
      side2 = side1;
      side1 = side(r);
      if (r === 0) {
        v[i] = 0;
        run++;
      } else {
        if (last > most) throw new Refused(`${this.what}: a detail beyond 2^40 - 1`);
        v[i] = r > 0 ? r + least - 1 : r - least + 1;
        run = 0;
      }
    }
    coder.finish(this.what);
  }

  /** Fills A and S from the next coarser band, of which `coarser` has the integers. */
  look(band) {
    const { activity, sides, coarser: w, coarserCount: n, least } = this;
    activity[0] = 0;
    activity[n + 1] = 0;
    if (band === 1) {
      sides.fill(3, 0, n);
      activity[1] = 0;
      activity[n] = 0;
      for (let k = 1; k < n - 1; k++) activity[k + 1] = Math.abs(w[k + 1] - 2 * w[k] + w[k - 1]);
    } else {
      for (let k = 0; k < n; k++) {
        activity[k + 1] = Math.max(0, Math.abs(w[k]) - least + 1);
        sides[k] = side(w[k]);
      }
    }
  }

  checkSize(value) {
    if (Math.abs(value) > GREATEST) throw new Refused(`${this.what}: ${value} is beyond 2^40`);
  }

  /** "Coefficients": those of the integers a to b - 1 of the band decoded last, put at `at`. */
  put(band, a, b, out, at) {
    const { v, step } = this;
    const shift = at - a;
    if (this.decimals !== SCALED) {
      const divisor = this.divisor;
      for (let i = a; i < b; i++) out[i + shift] = v[i] / divisor;
    } else if (band === 0) {
      for (let i = a; i < b; i++) out[i + shift] = v[i] * step;
    } else {
      // Of a detail a sixteenth of a step is taken off.
      for (let i = a; i < b; i++) {
        const x = v[i];
        out[i + shift] = x > 0 ? (x - 1 / 16) * step : x < 0 ? (x + 1 / 16) * step : 0;
      }
    }
  }
}

/**
 * How far a prediction lies from the value before, by one of the four predictors.
 *
 * @param {number} predictor bits 6-7 of `form`
 * @param {number} d the last change
 * @param {number} e the one before
 */
export function predictedChange(predictor, d, e) {
  switch (predictor) {
    case 0:
      return 0;
    case 1:
      return Math.floor(d / 2);
    case 2:
      return d;
    default:
      return Math.floor((3 * d - 2 * e) / 4);
  }
}
