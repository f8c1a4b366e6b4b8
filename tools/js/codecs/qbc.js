// SPEC.md, "Codec 17: qbc".

import { ByteReader } from "../bytes.js";
import { RangeDecoder, bits, clamp } from "../entropy.js";
import { Refused } from "../errors.js";
import { EXACT_POWERS } from "../grids.js";
import { CONTEXTS, MIXERS, Residuals, side } from "../residuals.js";
import { GREATEST, SCALED, firstScale, isStep } from "../scales.js";
import { checkCuts } from "../segments.js";
import { restart, startModels } from "../start-models.js";

export const id = 17;
export const name = "qbc";
export const version = 0;

const MAX_DELTA = 2 ** 20;
/** The bit LAST of curves lies behind their three kinds of residuals. */
const LAST = 3 * CONTEXTS;
const LAST_MIXER = 3 * MIXERS;
/** Channel kinds tx, ty, tz and length: what `position_step` is of. */
const POSITIONS = new Set([1, 2, 3, 10]);

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header QBC_HEADER
 * @param {object} layout the signal, as CLIP has it
 * @returns {CurveDecoder}
 * @throws {Refused} for a header, or a signal, that the codec does not have
 */
export function open(header, layout) {
  return new CurveDecoder(readHeader(header), layout);
}

function readHeader(bytes) {
  const reader = new ByteReader(bytes, "QBC_HEADER");
  const delta = reader.varint();
  if (delta < 1 || delta > MAX_DELTA) reader.refuse(`marks every ${delta} frames`);
  const codedFrames = reader.varint();
  const decimals = reader.u8();
  if (decimals > 15 && decimals !== SCALED) reader.refuse(`${decimals} decimals`);
  let step = 1;
  let positionStep = 1;
  if (decimals === SCALED) {
    step = readStep(reader);
    positionStep = readStep(reader);
  }
  reader.end();
  return { delta, codedFrames, decimals, step, positionStep };
}

function readStep(reader) {
  const step = reader.f64();
  if (!isStep(step)) reader.refuse(`a step of ${step}`);
  return step;
}

/** The decoder of one signal. */
class CurveDecoder {
  constructor(header, layout) {
    Object.assign(this, header);
    this.decodes = "values";
    this.groups = layout.groups;
    this.nChannels = layout.channels.length;
    this.nResolutions = layout.nResolutions;
    if (layout.samplesPerFrame !== 1) throw new Refused("qbc has 1 row a frame");
    if (this.nResolutions < 1 || this.nResolutions > 2) {
      throw new Refused(`${this.nResolutions} resolutions of qbc`);
    }
    this.divisor = EXACT_POWERS[this.decimals];
    /** The step of each channel, where decimals is 255. */
    this.steps = Float64Array.from(layout.channels, ({ kind }) =>
      POSITIONS.has(kind) ? this.positionStep : this.step,
    );
  }

  /**
   * What must hold of all stored segments, also of those that are not decoded.
   *
   * @param {object[]} segments a run of segments
   * @throws {Refused}
   */
  check(segments) {
    const { delta, codedFrames } = this;
    checkCuts(segments, { unit: delta, codedFrames, reach: delta - 1 });
  }

  /**
   * Decodes segments, a run in frame order.
   *
   * @param {object[]} segments with their streams
   * @param {object} options
   * @param {number} [options.dropped] 1: the curves are left out
   * @param {number} [options.from] first stored frame that is wanted
   * @param {number} [options.to] the one behind the last
   * @returns {Float64Array} the rows that are wanted
   * @throws {Refused}
   */
  decode(segments, { dropped, from, to }) {
    const last = segments[segments.length - 1];
    const end = last.firstFrame + last.nFrames;
    const out = new Float64Array((to - from) * this.nChannels);

    const hasLast = end === this.codedFrames;
    const lastMark = hasLast ? end - 1 : Math.floor((end - 1) / this.delta) * this.delta;
    if (to - 1 > lastMark) {
      throw new Refused(`frames ${lastMark + 1} to ${to - 1} need a mark that is not stored`);
    }
    const withCurves = this.nResolutions - dropped > 1;
    const markFrames = segments.map((segment) => this.markFrames(segment));
    const marks = new MarkStreams();
    const curves = new CurveStreams();
    this.groups.forEach((columns, group) => {
      const path = new Path(this, columns, out, from, to);
      const where = (i) => `segment at frame ${segments[i].firstFrame}, group ${group}`;
      const marksOf = (i) => {
        const stream = segments[i].streams[0][group];
        return marks.decode(stream, `${where(i)}, marks`, columns.length, markFrames[i].length);
      };
      let here = marksOf(0);
      for (let i = 0; i < segments.length; i++) {
        const isLast = i === segments.length - 1;
        const next = isLast ? null : marksOf(i + 1);
        const frames = isLast ? markFrames[i] : [...markFrames[i], segments[i + 1].firstFrame];
        const stream = withCurves ? segments[i].streams[1][group] : null;
        if (stream === null || stream.length === 0) {
          path.straight(here, next, frames);
        } else {
          const what = `${where(i)}, curves`;
          const coder = curves.decode(stream, what, here, next, frames, path);
          // Without the mark behind, a reader stops before the last curve.
          if (!isLast || hasLast) coder.finish(what);
        }
        // A mark from which no curve begins: the last of the clip, or of what is stored.
        if (isLast) path.point(here, here.length - columns.length, frames.at(-1));
        here = next;
      }
    });
    return out;
  }

  /** The frames of the marks of a segment. */
  markFrames({ firstFrame, nFrames }) {
    const end = firstFrame + nFrames;
    const frames = [];
    for (let frame = firstFrame; frame < end; frame += this.delta) frames.push(frame);
    if (end === this.codedFrames && frames.at(-1) !== end - 1) frames.push(end - 1);
    return frames;
  }
}

/** Writes the frames of curves into the values. */
class Path {
  /** Of frames begin <= f < end alone, which `out` has rows of. */
  constructor(decoder, columns, out, begin, end) {
    this.out = out;
    this.begin = begin;
    this.end = end;
    this.width = decoder.nChannels;
    this.columns = Int32Array.from(columns);
    this.steps = Float64Array.from(columns, (column) => decoder.steps[column]);
    this.divisor = decoder.divisor;
    this.scaled = decoder.decimals === SCALED;
  }

  coordinate(v, c) {
    return this.scaled ? v * this.steps[c] : v / this.divisor;
  }

  /** A frame that is a control point, whose integers begin at `at` of `points`. */
  point(points, at, frame) {
    const { out, columns, width } = this;
    if (frame < this.begin || frame >= this.end) return;
    const row = (frame - this.begin) * width;
    for (let c = 0; c < columns.length; c++) {
      out[row + columns[c]] = this.coordinate(points[at + c], c);
    }
  }

  /** "Values": the m frames from `frame` on of the curve p0, p1, p2. */
  curve(p0, p1, p2, m, frame) {
    const { out, columns, width } = this;
    const first = Math.max(0, this.begin - frame);
    const last = Math.min(m, this.end - frame);
    const start = (frame + first - this.begin) * width;
    for (let c = 0; c < columns.length; c++) {
      const a = this.coordinate(p0[c], c);
      const b = this.coordinate(p1[c], c);
      const d = this.coordinate(p2[c], c);
      let at = start + columns[c];
      for (let i = first; i < last; i++, at += width) {
        const t = i / m;
        const u = 1 - t;
        out[at] = u * u * a + 2 * t * u * b + t * t * d;
      }
    }
  }

  /** One straight curve from mark to mark, where there is no stream of curves. */
  straight(here, next, frames) {
    const n = this.columns.length;
    const p1 = new Float64Array(n);
    for (let k = 0; k + 1 < frames.length; k++) {
      const p0 = here.subarray(k * n, (k + 1) * n);
      const p2 = markBehind(here, next, k, n);
      for (let c = 0; c < n; c++) p1[c] = Math.floor((p0[c] + p2[c]) / 2);
      this.curve(p0, p1, p2, frames[k + 1] - frames[k], frames[k]);
    }
  }
}

/** The mark behind mark k of a segment; behind its last, the first of the next segment. */
function markBehind(here, next, k, n) {
  const at = (k + 1) * n;
  return at < here.length ? here.subarray(at, at + n) : next.subarray(0, n);
}

/** Points of one kind of residuals, and what each of its channels remembers. */
class Points {
  constructor(residuals) {
    this.residuals = residuals;
  }

  /** A new stream, of n channels. */
  begin(n, scale, what) {
    this.what = what;
    this.fast = new Float64Array(n).fill(16 * scale);
    this.slow = this.fast.slice();
    this.side1 = new Uint8Array(n);
    this.side2 = new Uint8Array(n);
  }

  /** point(predicted): adds what is decoded to the n integers of `v`, the prediction. */
  decode(coder, v) {
    const { residuals, fast, slow, side1, side2 } = this;
    let near = 0;
    let other = 3;
    for (let c = 0; c < v.length; c++) {
      const r = residuals.decode(coder, false, fast[c], slow[c], near, side1[c], side2[c], other);
      v[c] += r;
      if (Math.abs(v[c]) > GREATEST) throw new Refused(`${this.what}: ${v[c]} is beyond 2^40`);
      const size = 16 * Math.abs(r);
      near = (near + bits(size) - bits(slow[c])) >> 1;
      fast[c] += Math.floor((size - fast[c]) / 2);
      slow[c] += Math.floor((size - slow[c]) / 16);
      side2[c] = side1[c];
      other = side(r);
      side1[c] = other;
    }
  }
}

/**
 * An integer about which nothing is known: `first`.
 *
 * @param {RangeDecoder} coder
 * @param {string} what named in the message
 * @returns {number} at most 2^40 in size
 * @throws {Refused} where it is greater
 */
export function first(coder, what) {
  const b = coder.number(6);
  if (b === 0) return 0;
  if (b > 41) throw new Refused(`${what}: a first one of ${b} bits`);
  const size = 2 ** (b - 1) + coder.number(b - 1);
  const v = coder.number(1) ? -size : size;
  if (size > GREATEST) throw new Refused(`${what}: ${v} is beyond 2^40`);
  return v;
}

function readScale(reader) {
  const h = reader.u8();
  if (h > 63) reader.refuse(`a first scale of ${h} half octaves`);
  return firstScale(h);
}

/** "The stream of marks". */
class MarkStreams {
  constructor() {
    this.start = startModels("qbc_start.json")[0];
    this.model = this.start.copy();
    this.points = new Points(new Residuals(this.model));
  }

  /** The integers of `count` marks of n channels, mark after mark. */
  decode(stream, what, n, count) {
    if (stream.length === 0) return new Float64Array(count * n);
    const reader = new ByteReader(stream, what);
    const scale = readScale(reader);
    const coder = new RangeDecoder(reader.rest());
    restart(this.model, this.start);
    this.points.begin(n, scale, what);
    const marks = new Float64Array(count * n);
    for (let c = 0; c < n; c++) marks[c] = first(coder, what);
    for (let k = 1; k < count; k++) {
      marks.copyWithin(k * n, (k - 1) * n, k * n);
      this.points.decode(coder, marks.subarray(k * n, (k + 1) * n));
    }
    coder.finish(what);
    return marks;
  }
}

/** "The stream of curves". */
class CurveStreams {
  constructor() {
    this.start = startModels("qbc_start.json")[1];
    this.model = this.start.copy();
    this.lengths = new Residuals(this.model);
    this.breaks = new Points(new Residuals(this.model, CONTEXTS, MIXERS));
    this.middles = new Points(new Residuals(this.model, 2 * CONTEXTS, 2 * MIXERS));
  }

  /**
   * @param {Uint8Array} stream
   * @param {string} what named in messages
   * @param {Float64Array} here marks of this segment
   * @param {Float64Array | null} next those of the next one; null: the last curve, if there is one
   *   that leads there, is not wanted
   * @param {number[]} frames frames of the marks, with the first of the next segment
   * @param {Path} path takes the curves
   * @returns {RangeDecoder} where it is behind the last of these curves
   */
  decode(stream, what, here, next, frames, path) {
    const reader = new ByteReader(stream, what);
    const n = path.columns.length;
    this.breaks.begin(n, readScale(reader), what);
    this.middles.begin(n, readScale(reader), what);
    restart(this.model, this.start);
    const coder = new RangeDecoder(reader.rest());
    const p0 = new Float64Array(n);
    const p1 = new Float64Array(n);
    const p2 = new Float64Array(n);
    let usual = 0;
    for (let k = 0; k + 1 < frames.length; k++) {
      const end = markBehind(here, next, k, n);
      p0.set(here.subarray(k * n, (k + 1) * n));
      let frame = frames[k];
      let left = frames[k + 1] - frame;
      let pieces = 0;
      while (left > 0) {
        const m = this.length(coder, left, pieces, usual, what);
        if (m === left) {
          p2.set(end);
        } else {
          for (let c = 0; c < n; c++) p2[c] = p0[c] + share(end[c] - p0[c], m, left);
          this.breaks.decode(coder, p2);
        }
        for (let c = 0; c < n; c++) p1[c] = Math.floor((p0[c] + p2[c]) / 2);
        if (m > 1) this.middles.decode(coder, p1);
        path.curve(p0, p1, p2, m, frame);
        p0.set(p2);
        frame += m;
        left -= m;
        pieces++;
      }
      usual = pieces;
    }
    return coder;
  }

  /** length(left): frames of the next curve. */
  length(coder, left, pieces, usual, what) {
    if (left === 1) return 1;
    const a = LAST + Math.min(bits(left), 15);
    const b = LAST + 16 + Math.min(pieces, 7);
    const c = LAST + 24 + clamp(usual - pieces, 0, 7);
    if (this.model.mixed(coder, LAST_MIXER, a, b, c)) return left;
    const near = Math.min(pieces, 7) - 3;
    const r = this.lengths.decode(coder, false, 4 * left, left, near, 0, 0, 3);
    const m = (left >> 1) + r;
    if (m < 1 || m >= left) throw new Refused(`${what}: a curve over ${m} of ${left} frames`);
    return m;
  }
}

/**
 * (2 d m + left) div (2 left), where 2 d m may have 63 bits: the whole part of d / left is taken
 * out first, so that all numbers stay exact.
 */
function share(d, m, left) {
  const whole = Math.floor(d / left);
  const rest = d - whole * left;
  return whole * m + Math.floor((2 * rest * m + left) / (2 * left));
}
