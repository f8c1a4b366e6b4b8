// SPEC.md, "Codec 19: lsdt-frame": each frame as what it adds to the one before.

import { BitReader } from "../bits.js";
import { ByteReader } from "../bytes.js";
import { RangeDecoder, bits } from "../entropy.js";
import { Refused } from "../errors.js";
import { side } from "../residuals.js";
import { GREATEST } from "../scales.js";
import { APART, FrameAdder, WEIGHTS, makeSpace, readCode, readSpace } from "../space.js";
import { sparseList } from "../sparse.js";
import { startModels } from "../start-models.js";
import { checkLayout, checkReach, coefficientResiduals } from "./lsdt-clip.js";

export const id = 19;
export const name = "lsdt-frame";
export const version = 0;

const NO_ROWS = { firstRow: 0, nRows: 0 };

/**
 * @param {Uint8Array} header
 * @param {object} layout of the signal
 * @returns {FrameDecoder}
 * @throws {import("../errors.js").MczError}
 */
export function open(header, layout) {
  checkLayout(name, layout);
  const reader = new ByteReader(header, `${name}: header`);
  const fields = readSpace(reader, layout.channels.length, APART | WEIGHTS);
  const code = readCode(reader);
  reader.end();
  return new FrameDecoder(makeSpace(fields, layout.findModel), code);
}

/** What is remembered of rows and matrices, and how a frame is decoded with it. */
export class RowMemory {
  /** @param {import("../space.js").Space} space */
  constructor({ matrices, nRows }) {
    this.matrices = matrices;
    this.lengths = new Int32Array(matrices.length);
    this.last = new Float64Array(nRows);
    this.before = new Float64Array(nRows);
    this.fast = new Float64Array(nRows);
    this.slow = new Float64Array(nRows);
  }

  /** Forgets everything, as where a segment starts fresh. */
  clear() {
    for (const memory of [this.lengths, this.last, this.before, this.fast, this.slow]) {
      memory.fill(0);
    }
  }

  /**
   * The coefficients of one frame with `coder` 0.
   *
   * @param {RangeDecoder} coder
   * @param {ReturnType<typeof coefficientResiduals>} residuals
   * @param {boolean} fresh
   * @param {Float64Array} c coefficients of all rows, 0 before
   * @throws {Refused}
   */
  decode(coder, residuals, fresh, c) {
    for (let m = 0; m < this.matrices.length; m++) {
      const length = this.length(coder, residuals.lengths, m);
      if (fresh) this.freshRows(coder, residuals.first, m, length, c);
      else this.rows(coder, residuals.others, m, length, c);
    }
    if (!fresh) this.remember(c);
  }

  length(coder, residuals, m) {
    const { lengths } = this;
    const g = 16 * lengths[Math.max(m - 1, 0)];
    const length = residuals.decode(coder, false, 16 * lengths[m], g, -3, 0, 0, 0);
    if (length < 0 || length > this.matrices[m].nRows) {
      throw new Refused(`a matrix of ${this.matrices[m].nRows} rows has the length ${length}`);
    }
    lengths[m] = length;
    return length;
  }

  /** The rows of matrix m of a frame that is fresh. */
  freshRows(coder, residuals, m, length, c) {
    const { firstRow } = this.matrices[m];
    const beside = this.besides(m);
    let above = 0;
    for (let r = 0; r < length; r++) {
      const b = r < beside.nRows ? c[beside.firstRow + r] : 0;
      const f = 16 * Math.abs(above);
      const g = 16 * Math.abs(b);
      above = checked(residuals.decode(coder, false, f, g, -3, side(above), side(b), 0));
      c[firstRow + r] = above;
    }
  }

  /** The rows of matrix m of any other frame. */
  rows(coder, residuals, m, length, c) {
    const { last, before, fast, slow } = this;
    const { firstRow } = this.matrices[m];
    const beside = this.besides(m);
    let above = 0;
    let higher = 0;
    for (let r = 0; r < length; r++) {
      const b = r < beside.nRows ? c[beside.firstRow + r] : 0;
      const at = firstRow + r;
      const f = Math.floor((3 * fast[at] + 16 * Math.abs(b)) / 4);
      const g = Math.floor((slow[at] + 8 * Math.abs(above) + 4 * Math.abs(higher)) / 2);
      const near = Math.min(bits(length - r), 7) - 3;
      const side1 = side(last[at]);
      const other = side(before[at]);
      higher = above;
      above = checked(residuals.decode(coder, false, f, g, near, side1, side(b), other));
      c[at] = above;
    }
  }

  /** The rows of the matrix before, none where there is none. */
  besides(m) {
    return m > 0 ? this.matrices[m - 1] : NO_ROWS;
  }

  remember(c) {
    const { last, before, fast, slow } = this;
    for (let r = 0; r < c.length; r++) {
      before[r] = last[r];
      last[r] = c[r];
      const size = 16 * Math.abs(c[r]);
      fast[r] += Math.floor((size - fast[r]) / 2);
      slow[r] += Math.floor((size - slow[r]) / 16);
    }
  }
}

function checked(coefficient) {
  if (Math.abs(coefficient) > GREATEST) throw new Refused(`the coefficient ${coefficient}`);
  return coefficient;
}

/** Decodes signals of lsdt-frame. */
class FrameDecoder {
  constructor(space, code) {
    this.decodes = "values";
    this.space = space;
    this.code = code;
  }

  /** Refuses segments that the codec does not have. */
  check(segments) {
    for (const segment of segments) checkReach(name, segment);
  }

  /**
   * @param {object[]} segments the first of them starts fresh
   * @param {{ from?: number, to?: number }} [wanted] stored frames from <= f < to
   * @returns {Float64Array} the rows that are wanted
   * @throws {Refused}
   */
  decode(segments, { from, to }) {
    const nChannels = this.space.weights.length;
    const out = new Float64Array((to - from) * nChannels);
    if (nChannels === 0) return out;
    const values =
      this.code === null ? new AdaptiveFrames(this.space) : new SparseFrames(this.space, this.code);
    const adder = new FrameAdder(this.space);
    const v = new Float64Array(nChannels);
    let at = 0;
    for (const { firstFrame, nFrames, fresh, streams } of segments) {
      if (fresh) v.fill(0);
      const what = `${name}: stream of frame ${firstFrame}`;
      values.begin(streams[0][0], what, fresh);
      for (let f = 0; f < nFrames; f++) {
        if (firstFrame + f >= to) return out;
        adder.add(values.frame(fresh && f === 0), this.space.step, v);
        if (firstFrame + f < from) continue;
        out.set(v, at);
        at += nChannels;
      }
      values.finish();
    }
    return out;
  }
}

/** Coefficients frame after frame with `coder` 1. */
class SparseFrames {
  constructor({ matrices, nRows }, code) {
    this.matrices = matrices;
    this.c = new Float64Array(nRows);
    this.code = code;
    this.bits = null;
  }

  begin(data, what) {
    this.bits = new BitReader(data, what);
  }

  frame() {
    for (const { firstRow, nRows } of this.matrices) {
      sparseList(this.bits, this.code, this.c, firstRow, nRows);
    }
    return this.c;
  }

  finish() {
    this.bits.finish();
  }
}

/** Coefficients frame after frame with `coder` 0. */
class AdaptiveFrames {
  constructor(space) {
    this.memory = new RowMemory(space);
    this.c = new Float64Array(space.nRows);
    this.residuals = null;
    this.coder = null;
    this.what = "";
  }

  begin(data, what, fresh) {
    this.what = what;
    this.coder = new RangeDecoder(data);
    if (fresh) {
      this.residuals = coefficientResiduals(startModels("frame_start.json")[0].copy());
      this.memory.clear();
    }
  }

  frame(fresh) {
    this.c.fill(0);
    this.memory.decode(this.coder, this.residuals, fresh, this.c);
    return this.c;
  }

  finish() {
    this.coder.finish(this.what);
  }
}
