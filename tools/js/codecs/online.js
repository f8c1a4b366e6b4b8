// SPEC.md, "Codec 21: online": groups of frames that begin with a long-term reference (LTR).

import { ByteReader } from "../bytes.js";
import { RangeDecoder, bits } from "../entropy.js";
import { Refused } from "../errors.js";
import { GREATEST } from "../scales.js";
import { APART, FrameAdder, WEIGHTS, makeSpace, readSpace } from "../space.js";
import { startModels } from "../start-models.js";
import { checkLayout, checkReach, coefficientResiduals } from "./lsdt-clip.js";
import { RowMemory } from "./lsdt-frame.js";

export const id = 21;
export const name = "online";
export const version = 0;

/** Kinds of the first frame of a unit. */
const STR = 0;
const LTR = 1;
const INTRA = 2;

/** Values of `coder`. */
const MIXED = 0;
const GOLOMB = 1;

const GREATEST_CODE = 511;
const CODE_OF_STEP = 256; // of `step` itself

// The first context of FLAGS and of PREFIX in the models of each coder.
const FLAGS_OF_MIXED = 7704;
const FLAGS_OF_GOLOMB = 0;
const PREFIX_OF_GOLOMB = 15;

/** The model with which a unit of a kind that is not STR begins, to be changed. */
function startModel(coder, kind) {
  return startModels("online_start.json")[2 * coder + (kind === INTRA ? 0 : 1)].copy();
}

/**
 * @param {Uint8Array} header
 * @param {object} layout of the signal
 * @returns {OnlineDecoder}
 * @throws {import("../errors.js").MczError}
 */
export function open(header, layout) {
  checkLayout(name, layout);
  const nChannels = layout.channels.length;
  const reader = new ByteReader(header, `${name}: header`);
  const fields = readSpace(reader, nChannels, APART | WEIGHTS);
  const order = reader.u8();
  if (order > 1) reader.refuse(`order ${order}`);
  if (order === 1 && (fields.flags & APART || nChannels % 3 !== 0)) {
    reader.refuse("order 1 is of one matrix and of x, y and z");
  }
  const coder = reader.u8();
  if (coder !== MIXED && coder !== GOLOMB) reader.refuse(`coder ${coder}`);
  reader.end();
  const columns = order === 1 ? [reordered(nChannels)] : undefined;
  return new OnlineDecoder(makeSpace(fields, layout.findModel, columns), coder);
}

/** The channels of x of all points, then of y, then of z. */
function reordered(nChannels) {
  const m = nChannels / 3;
  return Int32Array.from({ length: nChannels }, (_, j) => 3 * (j % m) + Math.floor(j / m));
}

/** The units of a stream; heads are checked, distances and data are not. */
function readUnits(stream, what, nFrames) {
  const reader = new ByteReader(stream, what);
  const units = [];
  for (let left = nFrames; left > 0; ) {
    const head = reader.varint();
    const kind = head % 4;
    const n = Math.floor(head / 4);
    if (kind > INTRA) reader.refuse(`a unit of kind ${kind}`);
    if (n < 1 || n > left) reader.refuse(`a unit of ${n} frames, ${left} are left`);
    const distance = kind === LTR ? reader.varint() : 0;
    left -= n;
    units.push({ kind, n, distance, data: left > 0 ? reader.sized() : reader.rest() });
  }
  return units;
}

/** Decodes signals of online. */
class OnlineDecoder {
  constructor(space, coder) {
    this.decodes = "values";
    this.space = space;
    this.coder = coder;
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
    const frames = new OnlineFrames(this.space, this.coder, out, from);
    for (const { firstFrame, nFrames, fresh, streams } of segments) {
      const what = `${name}: stream of frame ${firstFrame}`;
      const units = readUnits(streams[0][0], what, nFrames);
      if ((units[0].kind === INTRA) !== fresh) {
        throw new Refused(`${what}: a unit of kind ${units[0].kind} begins it`);
      }
      let frame = firstFrame;
      for (const unit of units) {
        frames.unit(unit, frame);
        frame += unit.n;
        if (frame >= to) return out;
      }
    }
    return out;
  }
}

/** Decodes frames one after the other; this is where everything is remembered. */
class OnlineFrames {
  /** @param {number} from the frame that the first row of `out` is of */
  constructor(space, coder, out, from) {
    this.step = space.step;
    this.adder = new FrameAdder(space);
    this.out = out;
    this.from = from;
    this.v = new Float64Array(space.weights.length);
    this.reference = new Float64Array(space.weights.length); // the values of the last LTR
    this.referenceFrame = 0;
    this.code = 0;
    this.referenceCode = 0; // ltr_code
    this.present = 0;
    this.c = new Float64Array(space.nRows);
    this.coder = coder;
    this.coefficients = coder === MIXED ? new Mixed(space) : new Golomb(space);
    this.flags = coder === MIXED ? FLAGS_OF_MIXED : FLAGS_OF_GOLOMB;
    this.model = null;
  }

  /** All frames of a unit: its data end with them. */
  unit({ kind, n, distance, data }, frame) {
    const what = `${name}: unit of frame ${frame}`;
    if (kind === LTR && distance !== frame - this.referenceFrame) {
      throw new Refused(`${what}: a distance of ${distance} to frame ${this.referenceFrame}`);
    }
    if (kind !== STR) {
      this.referenceFrame = frame;
      this.model = startModel(this.coder, kind);
      this.coefficients.begin(this.model);
      this.present = 0;
    }
    const rc = new RangeDecoder(data);
    for (let f = 0; f < n; f++) {
      this.frame(rc, f === 0 ? kind : STR);
      const at = (frame + f - this.from) * this.v.length;
      if (at >= 0 && at < this.out.length) this.out.set(this.v, at);
    }
    rc.finish(what);
  }

  frame(rc, kind) {
    const { model, c, v } = this;
    c.fill(0);
    const here = model.adaptive(rc, this.flags + (kind === STR ? this.present : kind + 1));
    this.present = kind === STR ? here : 0;
    if (!here) {
      this.code = this.previous(kind);
    } else {
      this.code = this.codeOfStep(rc, kind);
      this.coefficients.decode(rc, kind, c);
    }
    if (kind === INTRA) v.fill(0);
    else if (kind === LTR) v.set(this.reference);
    const ratio = (8 + (this.code % 8)) * 2 ** (Math.floor(this.code / 8) - 35);
    if (here) this.adder.add(c, this.step * ratio, v);
    if (kind !== STR) {
      this.referenceCode = this.code;
      this.reference.set(v);
    }
  }

  previous(kind) {
    if (kind === INTRA) return CODE_OF_STEP;
    return kind === LTR ? this.referenceCode : this.code;
  }

  /** The code of the step of a frame that has coefficients. */
  codeOfStep(rc, kind) {
    if (kind === INTRA) return rc.number(9);
    const { model, flags } = this;
    const previous = this.previous(kind);
    if (model.adaptive(rc, flags + 4 + (kind === STR ? 0 : 1))) return previous;
    const negative = rc.number(1);
    let l = 1;
    while (model.adaptive(rc, flags + 5 + l)) {
      l++;
      if (l > 9) throw new Refused(`${name}: a step changes by more than 9 bits`);
    }
    const change = 2 ** (l - 1) + rc.number(l - 1);
    const code = negative ? previous - change : previous + change;
    if (code < 0 || code > GREATEST_CODE) throw new Refused(`${name}: the step ${code}`);
    return code;
  }
}

/** Coefficients with `coder` 0: the steps of lsdt-frame. */
class Mixed {
  constructor(space) {
    this.memory = new RowMemory(space);
    this.residuals = null;
  }

  begin(model) {
    this.memory.clear();
    this.residuals = coefficientResiduals(model);
  }

  decode(rc, kind, c) {
    this.memory.decode(rc, this.residuals, kind !== STR, c);
  }
}

/** Coefficients with `coder` 1: adaptive Golomb-Rice codes. */
class Golomb {
  constructor({ matrices, nRows }) {
    this.matrices = matrices;
    this.p = new Float64Array(nRows);
    this.model = null;
  }

  begin(model) {
    this.p.fill(0);
    this.model = model;
  }

  decode(rc, kind, c) {
    for (const matrix of this.matrices) this.sizes(rc, kind, matrix, c);
    const { p } = this;
    for (let r = 0; r < c.length; r++) {
      p[r] = kind === STR ? c[r] : 0;
      if (c[r] !== 0 && rc.number(1)) c[r] = -c[r];
    }
  }

  /** |c| of the rows of a matrix. */
  sizes(rc, kind, { firstRow, nRows }, c) {
    const { p } = this;
    const end = firstRow + nRows;
    let one = 0;
    let two = 0;
    for (let r = firstRow; r < end; r++) {
      const a = 2 * one + two + 2 * p[r] + (r + 1 < end ? p[r + 1] : 0);
      const g = Math.max(0, bits(a) - 3);
      const q = g === 0 ? a : 7 + Math.min(g, 8);
      const n = this.prefix(rc, 4 * ((kind === STR ? 0 : 16) + q));
      if (n > Math.floor(GREATEST / 2 ** g)) throw new Refused(`${name}: a prefix of ${n}`);
      const size = n * 2 ** g + rc.number(g);
      if (size > GREATEST) throw new Refused(`${name}: a coefficient of ${size}`);
      c[r] = size;
      two = one;
      one = size;
    }
  }

  prefix(rc, x) {
    let n = 0;
    while (this.model.adaptive(rc, PREFIX_OF_GOLOMB + x + Math.min(n, 3))) {
      n++;
      if (n === 16) {
        const l = rc.number(6);
        if (l === 0 || l > 42) throw new Refused(`${name}: a prefix of ${l} bits`);
        return 15 + 2 ** (l - 1) + rc.number(l - 1);
      }
    }
    return n;
  }
}
