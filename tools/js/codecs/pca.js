// SPEC.md, "Codec 18: pca".

import { ByteReader } from "../bytes.js";
import { RangeDecoder, bits } from "../entropy.js";
import { Refused } from "../errors.js";
import { EXACT_POWERS } from "../grids.js";
import { CONTEXTS, MIXERS, Residuals, side } from "../residuals.js";
import { GREATEST, SCALED, firstScale, stepOf } from "../scales.js";
import { restart, startModels } from "../start-models.js";
import { predictedChange } from "./wavelet.js";
import { first } from "./qbc.js";

export const id = 18;
export const name = "pca";
export const version = 0;

const MAX_SHIFT = 40;
const MAX_SCALE = 62;

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header PCA_HEADER
 * @param {object} layout the signal, as CLIP has it
 * @returns {ComponentDecoder}
 * @throws {Refused} for a header, or a signal, that the codec does not have
 */
export function open(header, layout) {
  const reader = new ByteReader(header, "PCA_HEADER");
  const decimals = reader.u8();
  if (decimals > 15 && decimals !== SCALED) reader.refuse(`${decimals} decimals`);
  reader.end();
  return new ComponentDecoder(decimals, layout);
}

/** The decoder of one signal. */
class ComponentDecoder {
  constructor(decimals, layout) {
    this.decodes = "values";
    this.decimals = decimals;
    this.nChannels = layout.channels.length;
    if (layout.samplesPerFrame !== 1) throw new Refused("pca has 1 row a frame");
    if (layout.nResolutions !== 1) throw new Refused(`${layout.nResolutions} resolutions of pca`);
    if (layout.groups.length > 1) throw new Refused(`${layout.groups.length} groups of pca`);
  }

  /**
   * What must hold of all stored segments, also of those that are not decoded.
   *
   * @param {object[]} segments
   * @throws {Refused}
   */
  check(segments) {
    for (const { firstFrame, lead, tail, fresh } of segments) {
      const where = `segment at frame ${firstFrame}`;
      if (lead !== 0) throw new Refused(`${where}: a lead of ${lead}`);
      if (tail !== 0) throw new Refused(`${where}: a tail of ${tail}`);
      if (!fresh) throw new Refused(`${where}: does not start fresh`);
    }
  }

  /**
   * Decodes segments, each by itself.
   *
   * @param {object[]} segments with their streams
   * @returns {Float64Array} the rows of all these segments
   * @throws {Refused}
   */
  decode(segments) {
    const rows = segments.reduce((sum, { nFrames }) => sum + nFrames, 0);
    const out = new Float64Array(rows * this.nChannels);
    if (this.nChannels === 0) return out;
    const streams = new ComponentStreams();
    let at = 0;
    for (const { firstFrame, nFrames, streams: given } of segments) {
      const size = nFrames * this.nChannels;
      const stream = given[0][0];
      if (stream.length > 0) {
        const what = `segment at frame ${firstFrame}`;
        streams.decode(stream, what, this.decimals, nFrames, out.subarray(at, at + size));
      }
      at += size;
    }
    return out;
  }
}

/**
 * table(c values, scale): integers that are alike in size.
 *
 * @param {RangeDecoder} coder
 * @param {Residuals} residuals of the kind that is named
 * @param {Float64Array} out takes the values, from `at` on
 * @param {number} at
 * @param {number} count
 * @param {number} scale
 * @param {string} [what] named in messages
 * @throws {Refused} where one is beyond 2^40
 */
export function table(coder, residuals, out, at, count, scale, what = "table") {
  let fast = 16 * scale;
  let slow = fast;
  let near = 0;
  let side1 = 0;
  let side2 = 0;
  for (let i = at; i < at + count; i++) {
    const v = residuals.decode(coder, false, fast, slow, near, side1, side2, 3);
    const magnitude = Math.abs(v);
    if (magnitude > GREATEST) throw new Refused(`${what}: ${v} is beyond 2^40`);
    out[i] = v;
    const size = 16 * magnitude;
    near = (near + bits(size) - bits(slow)) >> 1;
    fast += Math.floor((size - fast) / 4);
    slow += Math.floor((size - slow) / 16);
    side2 = side1;
    side1 = side(v);
  }
}

/**
 * The first scale of a row of a basis: 2^shift >> (bits(n) >> 1).
 *
 * @param {number} shift binary digits of the row, 0 to 40
 * @param {number} n entries of the row
 */
export function basisScale(shift, n) {
  return Math.floor(2 ** (shift - (bits(n) >> 1)));
}

/** "The stream of a segment". */
class ComponentStreams {
  constructor() {
    [this.start] = startModels("pca_start.json");
    this.model = this.start.copy();
    this.means = new Residuals(this.model);
    this.basis = new Residuals(this.model, CONTEXTS, MIXERS);
    this.coefficients = new Residuals(this.model, 2 * CONTEXTS, 2 * MIXERS);
  }

  /** Decodes a stream that is not empty into `out`, n frames. */
  decode(stream, what, decimals, n, out) {
    const nChannels = out.length / n;
    const reader = new ByteReader(stream, what);
    const head = readHead(reader, decimals, nChannels, n);
    const coder = new RangeDecoder(reader.rest());
    restart(this.model, this.start);

    const mean = new Float64Array(nChannels);
    table(coder, this.means, mean, 0, nChannels, head.meanScale, `${what}, means`);
    for (let c = 0; c < nChannels; c++) mean[c] = head.mean(mean[c]);

    const q = head.count;
    const basis = new Float64Array(q * nChannels);
    for (let i = 0; i < q; i++) {
      const scale = basisScale(head.shifts[i], nChannels);
      table(coder, this.basis, basis, i * nChannels, nChannels, scale, `${what}, basis`);
      const unit = 2 ** head.shifts[i];
      for (let c = i * nChannels; c < (i + 1) * nChannels; c++) basis[c] /= unit;
    }

    const courses = new Courses(this.coefficients, head, what);
    for (let f = 0; f < n; f++) {
      if (f === 0) courses.begin(coder);
      else courses.next(coder, f);
      const at = f * nChannels;
      out.set(mean, at);
      for (let i = 0; i < q; i++) {
        // The product with a coefficient of 0 changes no sum, none of which is -0.
        if (courses.y1[i] === 0) continue;
        const coefficient = head.coefficient(courses.y1[i]);
        const row = i * nChannels;
        for (let c = 0; c < nChannels; c++) out[at + c] += coefficient * basis[row + c];
      }
    }
    coder.finish(what);
  }
}

function readHead(reader, decimals, nChannels, n) {
  let mean;
  let coefficient;
  if (decimals === SCALED) {
    const step = stepOf(reader.u8());
    mean = (m) => m * (step / 4);
    coefficient = (y) => y * step;
  } else {
    const divisor = EXACT_POWERS[decimals];
    mean = (m) => m / divisor;
    coefficient = mean;
  }
  const meanScale = readScale(reader, reader.u8());
  const count = reader.varint();
  if (count > nChannels || count > n + 1) {
    reader.refuse(`${count} components of ${nChannels} channels and ${n} frames`);
  }
  const shifts = reader.take(count);
  for (const shift of shifts) {
    if (shift > MAX_SHIFT) reader.refuse(`a basis of ${shift} binary digits`);
  }
  const forms = reader.take(count);
  const scales = Float64Array.from(forms, (form) => readScale(reader, form % 64));
  const predictors = forms.map((form) => form >> 6);
  return { mean, coefficient, meanScale, count, shifts, scales, predictors };
}

function readScale(reader, h) {
  if (h > MAX_SCALE) reader.refuse(`a first scale of ${h} half octaves`);
  return firstScale(h);
}

/** The coefficients, frame after frame, and what each component remembers. */
class Courses {
  constructor(residuals, { count, scales, predictors }, what) {
    this.residuals = residuals;
    this.predictors = predictors;
    this.what = what;
    this.count = count;
    this.fast = scales.map((scale) => 16 * scale);
    this.slow = this.fast.slice();
    this.side1 = new Uint8Array(count);
    this.side2 = new Uint8Array(count);
    this.moved = new Uint8Array(count);
    /** The coefficients of the last frame, of the one before, and of the one before that. */
    this.y1 = new Float64Array(count);
    this.y2 = new Float64Array(count);
    this.y3 = new Float64Array(count);
  }

  /** The first frame. */
  begin(coder) {
    for (let i = 0; i < this.count; i++) this.y1[i] = first(coder, this.what);
  }

  /** Frame f, 1 or more. */
  next(coder, f) {
    const { residuals, predictors, fast, slow, side1, side2, moved, y1, y2, y3 } = this;
    let near = 0;
    for (let i = 0; i < this.count; i++) {
      const d = f === 1 ? 0 : y1[i] - y2[i];
      const e = f < 3 ? 0 : y2[i] - y3[i];
      const predicted = y1[i] + predictedChange(predictors[i], d, e);
      const other = moved[i];
      const r = residuals.decode(coder, false, fast[i], slow[i], near, side1[i], side2[i], other);
      const y = predicted + r;
      if (Math.abs(y) > GREATEST) throw new Refused(`${this.what}: ${y} is beyond 2^40`);
      const size = 16 * Math.abs(r);
      near = (near + bits(size) - bits(slow[i])) >> 1;
      fast[i] += Math.floor((size - fast[i]) / 2);
      slow[i] += Math.floor((size - slow[i]) / 32);
      side2[i] = side1[i];
      side1[i] = side(r);
      if (y !== y1[i]) moved[i] = side(y - y1[i]);
      y3[i] = y2[i];
      y2[i] = y1[i];
      y1[i] = y;
    }
  }
}
