// SPEC.md, "Codec 20: lsdt-clip".

import { BitReader } from "../bits.js";
import { ByteReader } from "../bytes.js";
import { cosines } from "../cosines.js";
import { RangeDecoder, bits } from "../entropy.js";
import { Refused } from "../errors.js";
import { CONTEXTS, MIXERS, Residuals, side } from "../residuals.js";
import { GREATEST } from "../scales.js";
import {
  APART,
  COURSES,
  MEAN,
  WEIGHTS,
  makeSpace,
  readCode,
  readSpace,
  sumOfRows,
} from "../space.js";
import { sparseList } from "../sparse.js";
import { startModels } from "../start-models.js";

export const id = 20;
export const name = "lsdt-clip";
export const version = 0;

const LONGEST_WINDOW = 2048;
const MOST_PRODUCTS = 2 ** 30;

/** The residuals of a model in the order of their contexts, as the lsdt-frame, lsdt-clip and online have them. */
export function coefficientResiduals(model) {
  return {
    lengths: new Residuals(model, 0, 0),
    first: new Residuals(model, CONTEXTS, MIXERS),
    others: new Residuals(model, 2 * CONTEXTS, 2 * MIXERS),
  };
}

/**
 * What the lsdt-frame, lsdt-clip and online ask of a signal.
 *
 * @throws {Refused} where it has more than one group or resolution, or several rows a frame
 */
export function checkLayout(codec, { groups, nResolutions, samplesPerFrame }) {
  if (groups.length > 1) throw new Refused(`${codec}: ${groups.length} groups`);
  if (nResolutions !== 1) throw new Refused(`${codec}: ${nResolutions} resolutions`);
  if (samplesPerFrame !== 1) throw new Refused(`${codec}: ${samplesPerFrame} rows a frame`);
}

/** Refuses a segment of the lsdt-frame, lsdt-clip and online that affects frames of others. */
export function checkReach(codec, { firstFrame, lead, tail }) {
  if (lead !== 0 || tail !== 0) {
    throw new Refused(`${codec}: the segment of frame ${firstFrame} has a lead or tail`);
  }
}

/**
 * @param {Uint8Array} header
 * @param {object} layout of the signal
 * @returns {WindowsDecoder}
 * @throws {import("../errors.js").MczError}
 */
export function open(header, layout) {
  checkLayout(name, layout);
  const nChannels = layout.channels.length;
  const reader = new ByteReader(header, `${name}: header`);
  const window = reader.varint();
  if (window < 1 || window > LONGEST_WINDOW) reader.refuse(`a window of ${window} frames`);
  const nFrequencies = reader.varint();
  if (nFrequencies < 1 || nFrequencies > window) {
    reader.refuse(`${nFrequencies} coefficients of ${window} frames`);
  }
  const fields = readSpace(reader, nChannels, APART | WEIGHTS | MEAN | COURSES);
  const code = readCode(reader);
  reader.end();
  const space = makeSpace(fields, layout.findModel);
  if (space.courses !== null) checkCourses(space.courses, window, nFrequencies);
  return new WindowsDecoder(nChannels, window, nFrequencies, space, code);
}

function checkCourses({ nVectors, nPoints }, window, nFrequencies) {
  if (nVectors !== nFrequencies || nPoints > window) {
    throw new Refused(
      `${name}: ${nVectors} courses of ${nPoints} entries for ${nFrequencies} coefficients ` +
        `and ${window} frames`,
    );
  }
  if (nFrequencies * nPoints * window > MOST_PRODUCTS) {
    throw new Refused(`${name}: courses of more than 2^30 products`);
  }
}

/** Courses as rows of `window` numbers each. */
function makeCourses({ nVectors, nPoints, entries }, window) {
  const table = new Float64Array(nVectors * window);
  const rows = cosines(window, nPoints);
  const starts = Int32Array.from({ length: nPoints }, (_, j) => j * window);
  for (let k = 0; k < nVectors; k++) {
    const factors = entries.subarray(k * nPoints, (k + 1) * nPoints);
    sumOfRows(table.subarray(k * window, (k + 1) * window), nPoints, factors, starts, rows);
  }
  return table;
}

/** Decodes signals of lsdt-clip. */
export class WindowsDecoder {
  constructor(nChannels, window, nFrequencies, space, code) {
    this.decodes = "values";
    this.nChannels = nChannels;
    this.window = window;
    this.nFrequencies = nFrequencies;
    this.space = space;
    this.code = code;
    this.courses = null;
  }

  /** Refuses segments that no such codec has. */
  check(segments) {
    for (const segment of segments) {
      checkReach(name, segment);
      if (!segment.fresh) {
        throw new Refused(
          `${name}: the segment of frame ${segment.firstFrame} does not start fresh`,
        );
      }
    }
  }

  /**
   * @param {object[]} segments
   * @param {{ from?: number, to?: number }} [wanted] stored frames; windows of others are skipped
   * @returns {Float64Array} all rows of the segments
   * @throws {Refused}
   */
  decode(segments, { from, to }) {
    const { nChannels, window } = this;
    const nRows = segments.reduce((sum, segment) => sum + segment.nRows, 0);
    const out = new Float64Array(nRows * nChannels);
    if (nChannels === 0) return out;
    const values = new WindowValues(this);
    let row = 0;
    for (const { firstFrame, nFrames, streams } of segments) {
      const reader = new ByteReader(streams[0][0], `${name}: stream of frame ${firstFrame}`);
      for (let first = 0; first < nFrames; first += window) {
        const frames = Math.min(window, nFrames - first);
        const data = reader.sized();
        const frame = firstFrame + first;
        if (frame < to && frame + frames > from) {
          values.decode(data, `${name}: window of frame ${frame}`, frames, out, row);
        }
        row += frames;
      }
      reader.end();
    }
    return out;
  }

  /** C of "Values", of a window of so many frames: rows of so many numbers. */
  coursesOf(frames, n) {
    if (this.space.courses === null || frames !== this.window) return cosines(frames, n);
    this.courses ??= makeCourses(this.space.courses, this.window);
    return this.courses;
  }
}

/** Decodes windows, one after the other, in the same memory. */
class WindowValues {
  constructor(decoder) {
    this.decoder = decoder;
    const { matrices } = decoder.space;
    this.mostRows = matrices.reduce((most, { nRows }) => Math.max(most, nRows), 0);
    // Coefficients of two matrices: the one that is decoded and the one before.
    this.planes = [new Float64Array(0), new Float64Array(0)];
    this.courses = new Float64Array(0); // of the rows of a matrix that have coefficients
    this.used = new Int32Array(this.mostRows); // which rows these are
    this.sum = new Float64Array(0);
    const most = Math.max(this.mostRows, decoder.nFrequencies);
    this.factors = new Float64Array(most);
    this.starts = new Int32Array(most);
  }

  /** One window: its values go to the rows of `out` from `row` on. */
  decode(data, what, frames, out, row) {
    const { space, nFrequencies, code } = this.decoder;
    const n = Math.min(nFrequencies, frames);
    this.grow(n, frames);
    const lists =
      code === null ? new AdaptiveLists(data, what, n) : new SparseLists(data, what, n, code);
    space.matrices.forEach((matrix, m) => {
      const c = this.planes[m % 2];
      lists.matrix(matrix.nRows, c, this.planes[1 - (m % 2)]);
      const nUsed = this.makeCourses(matrix.nRows, c, n, frames);
      this.addPoints(matrix, nUsed, frames, out, row);
    });
    lists.finish();
  }

  /** Memory for a window, where there is less. */
  grow(n, frames) {
    const plane = (this.mostRows + 1) * (n + 1);
    if (this.planes[0].length < plane) {
      this.planes = [new Float64Array(plane), new Float64Array(plane)];
    }
    if (this.sum.length < frames) {
      this.sum = new Float64Array(frames);
      this.courses = new Float64Array(this.mostRows * frames);
    }
  }

  /**
   * `course` of each row that has coefficients.
   *
   * @returns {number} how many such rows there are
   */
  makeCourses(nRows, c, n, frames) {
    const { used, courses, factors, starts } = this;
    const table = this.decoder.coursesOf(frames, n);
    let nUsed = 0;
    for (let r = 0; r < nRows; r++) {
      const at = (r + 1) * (n + 1);
      let terms = 0;
      for (let k = 0; k < n; k++) {
        if (c[at + k] === 0) continue;
        factors[terms] = c[at + k];
        starts[terms++] = k * frames;
      }
      if (terms === 0) continue;
      const course = courses.subarray(nUsed * frames, (nUsed + 1) * frames);
      sumOfRows(course, terms, factors, starts, table);
      used[nUsed++] = r;
    }
    return nUsed;
  }

  /** "Values" of the points of one matrix. */
  addPoints({ nPoints, vectors, channels }, nUsed, frames, out, row) {
    const { used, courses, factors, starts } = this;
    const { space, nChannels } = this.decoder;
    const { step, weights, mean } = space;
    const sum = this.sum.subarray(0, frames);
    for (let i = 0; i < nUsed; i++) starts[i] = i * frames;
    for (let j = 0; j < nPoints; j++) {
      for (let i = 0; i < nUsed; i++) factors[i] = vectors[used[i] * nPoints + j];
      sumOfRows(sum, nUsed, factors, starts, courses);
      const channel = channels[j];
      const weight = weights[channel];
      const middle = mean === null ? 0 : mean[channel];
      let at = row * nChannels + channel;
      for (let f = 0; f < frames; f++, at += nChannels) out[at] = middle + sum[f] * step * weight;
    }
  }
}

// Both coders put the coefficients of a matrix into a plane of nRows + 1 rows of n + 1 numbers. Row
// r is at (r + 1) * (n + 1); the row before the first and the last number of each row are 0, what
// "there is none" means.

/** The rows of a window with `coder` 1. */
class SparseLists {
  constructor(data, what, n, code) {
    this.bits = new BitReader(data, what);
    this.n = n;
    this.code = code;
  }

  matrix(nRows, c) {
    for (let r = 0; r < nRows; r++) {
      sparseList(this.bits, this.code, c, (r + 1) * (this.n + 1), this.n);
    }
  }

  finish() {
    this.bits.finish();
  }
}

/** The rows of a window with `coder` 0. */
class AdaptiveLists {
  constructor(data, what, n) {
    this.what = what;
    this.coder = new RangeDecoder(data);
    this.residuals = coefficientResiduals(startModels("window_start.json")[0].copy());
    this.n = n;
    this.slow = 16 * n;
    this.near = 0;
    this.lengths = null; // of the rows of the matrix before
  }

  /**
   * @param {number} nRows
   * @param {Float64Array} c plane that is filled
   * @param {Float64Array} before plane of the matrix before, where there is one
   */
  matrix(nRows, c, before) {
    const { n } = this;
    const stride = n + 1;
    const lengths = new Int32Array(nRows);
    c.fill(0, 0, (nRows + 1) * stride);
    if (this.lengths === null) before.fill(0, 0, stride); // not of this window: only zeros count
    for (let r = 0; r < nRows; r++) {
      const beside = this.lengths !== null && r < this.lengths.length;
      const expected = beside ? this.lengths[r] : r > 0 ? lengths[r - 1] : n;
      lengths[r] = this.length(expected);
      this.row(lengths[r], c, (r + 1) * stride, before, beside ? (r + 1) * stride : 0);
    }
    this.lengths = lengths;
  }

  length(expected) {
    const { n, slow, near, residuals, coder } = this;
    const length = residuals.lengths.decode(coder, false, 16 * expected, slow, near, 0, 0, 0);
    if (length < 0 || length > n) throw new Refused(`${this.what}: a row of length ${length}`);
    this.near = (near + bits(16 * length) - bits(slow)) >> 1;
    this.slow = slow + ((16 * length - slow) >> 2);
    return length;
  }

  /** The coefficients of a row at `at` of c; that beside it is at `left` of `before`. */
  row(length, c, at, before, left) {
    const { coder, residuals } = this;
    const { first, others } = residuals;
    const up = at - this.n - 1;
    let last = 0;
    let earlier = 0; // `before` of SPEC.md
    let s = 0;
    let t = 0;
    for (let k = 0; k < length; k++) {
      const a = Math.abs(c[up + k]);
      const b = Math.abs(before[left + k]);
      let v;
      if (k === 0) {
        v = first.decode(coder, false, 16 * a, 16 * b, -3, side(c[up]), side(before[left]), 0);
      } else {
        let around = Math.abs(c[up + k + 1]) + Math.abs(before[left + k + 1]);
        if (k > 1) around += Math.abs(c[up + k - 1]) + Math.abs(before[left + k - 1]);
        const f = 8 * last + 4 * earlier + 2 * (a + b);
        const g = 6 * (a + b) + 3 * around;
        const near = Math.min(bits(length - k), 7) - 3;
        v = others.decode(coder, false, f, g, near, s, t, side(c[up + k]));
        earlier = last;
        last = Math.abs(v);
        t = s;
        s = side(v);
      }
      if (Math.abs(v) > GREATEST) throw new Refused(`${this.what}: the coefficient ${v}`);
      c[at + k] = v;
    }
  }

  finish() {
    this.coder.finish(this.what);
  }
}
