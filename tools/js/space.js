// SPEC.md, "Space": how the channels of a frame become coefficients, and back.

import { parseBases } from "./bases.js";
import { cosines } from "./cosines.js";
import { Refused } from "./errors.js";
import { PrefixCode } from "./prefix.js";
import { isStep, stepOf } from "./scales.js";

/** Bits of `flags`. */
export const APART = 1;
export const WEIGHTS = 2;
export const MEAN = 4;
export const COURSES = 8;

/** Values of `basis`, and the kind of their models. */
const COSINES = 0;
const BASES_OF_MODEL = 1;
const BASES_KIND = 1;

const MOST_POINTS = 2048;

/**
 * One of the matrices of a space. Its *rows* are its vectors.
 *
 * @typedef {object} Matrix
 * @property {number} nPoints
 * @property {number} nRows
 * @property {number} firstRow rows of the matrices before
 * @property {Float64Array} vectors row after row
 * @property {Int32Array} channels channel of each point
 */

/**
 * @typedef {object} Space
 * @property {number} step
 * @property {Float64Array} weights of each channel
 * @property {Matrix[]} matrices
 * @property {number} nRows of all matrices
 * @property {import("./bases.js").Basis | null} courses
 * @property {Float64Array | null} mean of each channel
 */

/**
 * The fields of SPACE. Models are looked up by {@link makeSpace}, when all of a codec's header is
 * known to be well-formed.
 *
 * @param {import("./bytes.js").ByteReader} reader
 * @param {number} nChannels
 * @param {number} known the flags that the codec has
 * @throws {Refused}
 */
export function readSpace(reader, nChannels, known) {
  const flags = reader.flags(known);
  if (flags & APART && nChannels % 3 !== 0) {
    reader.refuse(`x, y and z apart of ${nChannels} channels`);
  }
  const basis = reader.u8();
  if (basis !== COSINES && basis !== BASES_OF_MODEL) reader.refuse(`a basis of kind ${basis}`);
  const named = basis === BASES_OF_MODEL || (flags & (MEAN | COURSES)) !== 0;
  const model = named ? reader.take(16) : null;
  const step = reader.f64();
  if (!isStep(step)) reader.refuse(`a step of ${step}`);
  const weights = new Float64Array(nChannels).fill(1);
  if (flags & WEIGHTS) {
    const codes = reader.sized();
    if (codes.length !== nChannels) {
      reader.refuse(`${codes.length} weights of ${nChannels} channels`);
    }
    weights.set(Array.from(codes, stepOf));
  }
  const nPoints = flags & APART ? nChannels / 3 : nChannels;
  if (nPoints > MOST_POINTS) reader.refuse(`a matrix of ${nPoints} points`);
  return { flags, basis, model, step, weights };
}

/**
 * The structure CODE.
 *
 * @param {import("./bytes.js").ByteReader} reader
 * @returns {{ gaps: PrefixCode, values: PrefixCode } | null} null: the adaptive coder
 * @throws {Refused}
 */
export function readCode(reader) {
  const coder = reader.u8();
  if (coder === 0) return null;
  if (coder !== 1) reader.refuse(`coder ${coder}`);
  const gaps = new PrefixCode(reader.sized(), "gap_lengths");
  const values = new PrefixCode(reader.sized(), "value_lengths");
  return { gaps, values };
}

/**
 * Matrices, mean and courses of a space.
 *
 * @param {ReturnType<typeof readSpace>} fields
 * @param {(id: Uint8Array) => { kind: number, data: Uint8Array }} findModel throws Unsupported
 * @param {Int32Array[]} [columns] channel of each point of each matrix, where the codec has an
 *   order of its own
 * @returns {Space}
 * @throws {Refused} where the model is not one for this space
 */
export function makeSpace(fields, findModel, columns = matrixChannels(fields)) {
  const { flags, basis, step, weights } = fields;
  const bases = fields.model === null ? [] : basesOf(findModel(fields.model));
  const due = basis === BASES_OF_MODEL ? columns.length : 0;
  const courses = flags & COURSES ? bases[due] : null;
  const mean = flags & MEAN ? bases[courses === null ? due : due + 1] : null;
  const all = due + (flags & COURSES ? 1 : 0) + (flags & MEAN ? 1 : 0);
  if (bases.length !== all) throw new Refused(`a model of ${bases.length} bases, not ${all}`);
  if (mean !== null && (mean.nVectors !== 1 || mean.nPoints !== weights.length)) {
    throw new Refused(`${mean.nVectors} means of ${mean.nPoints} of ${weights.length} channels`);
  }
  let nRows = 0;
  const matrices = columns.map((channels, m) => {
    const matrix = makeMatrix(channels, nRows, due === 0 ? null : bases[m]);
    nRows += matrix.nRows;
    return matrix;
  });
  return { step, weights, matrices, nRows, courses, mean: mean?.entries ?? null };
}

/** The channels of each matrix: 0, 3, 6, ..., 1, 4, 7, ... and 2, 5, 8, ..., or all of them. */
function matrixChannels({ flags, weights }) {
  const n = weights.length;
  if (!(flags & APART)) return [Int32Array.from({ length: n }, (_, j) => j)];
  return [0, 1, 2].map((m) => Int32Array.from({ length: n / 3 }, (_, j) => 3 * j + m));
}

function basesOf({ kind, data }) {
  if (kind !== BASES_KIND) throw new Refused(`a model of kind ${kind} in place of bases`);
  return parseBases(data);
}

/** @returns {Matrix} of the vectors of a basis, or of cosines */
function makeMatrix(channels, firstRow, basis) {
  const nPoints = channels.length;
  if (basis === null) {
    const vectors = nPoints === 0 ? new Float64Array(0) : cosines(nPoints);
    return { nPoints, nRows: nPoints, firstRow, vectors, channels };
  }
  if (basis.nPoints !== nPoints) {
    throw new Refused(`vectors of ${basis.nPoints} entries for ${nPoints} points`);
  }
  return { nPoints, nRows: basis.nVectors, firstRow, vectors: basis.entries, channels };
}

/**
 * For each f: out[f] = 0, then out[f] = out[f] + factors[i] * table[starts[i] + f] for each i below
 * n, in order. Four at a time: out is read and written less often, the sums are the same.
 *
 * Whoever calls it may leave out rows whose factor is 0: no sum is ever -0, so that adding a zero
 * changes none.
 *
 * @param {Float64Array} out
 * @param {number} n
 * @param {Float64Array} factors
 * @param {Int32Array} starts
 * @param {Float64Array} table
 */
export function sumOfRows(out, n, factors, starts, table) {
  out.fill(0);
  let i = 0;
  for (; i + 4 <= n; i += 4) {
    const [p, q, r, s] = [starts[i], starts[i + 1], starts[i + 2], starts[i + 3]];
    const [a, b, c, d] = [factors[i], factors[i + 1], factors[i + 2], factors[i + 3]];
    for (let f = 0; f < out.length; f++) {
      out[f] =
        out[f] + a * table[p + f] + b * table[q + f] + c * table[r + f] + d * table[s + f];
    }
  }
  for (; i < n; i++) {
    const start = starts[i];
    const factor = factors[i];
    for (let f = 0; f < out.length; f++) out[f] += factor * table[start + f];
  }
}

/** Adds the coefficients of frames to predictions, as the lsdt-frame and online do. */
export class FrameAdder {
  /** @param {Space} space */
  constructor({ matrices, weights, nRows }) {
    this.weights = weights;
    this.matrices = matrices;
    this.sums = matrices.map(({ nPoints }) => new Float64Array(nPoints));
    this.factors = new Float64Array(nRows);
    this.starts = new Int32Array(nRows);
  }

  /**
   * For each channel v = v + (sum * scale) * weight.
   *
   * @param {Float64Array} c coefficients of all rows
   * @param {number} scale the quantizer step of the frame
   * @param {Float64Array} v values of all channels, which change
   */
  add(c, scale, v) {
    const { weights, factors, starts } = this;
    for (let m = 0; m < this.matrices.length; m++) {
      const { nPoints, nRows, firstRow, vectors, channels } = this.matrices[m];
      const sum = this.sums[m];
      let n = 0;
      for (let r = 0; r < nRows; r++) {
        if (c[firstRow + r] === 0) continue;
        factors[n] = c[firstRow + r];
        starts[n++] = r * nPoints;
      }
      sumOfRows(sum, n, factors, starts, vectors);
      for (let j = 0; j < nPoints; j++) {
        const channel = channels[j];
        v[channel] += sum[j] * scale * weights[channel];
      }
    }
  }
}
