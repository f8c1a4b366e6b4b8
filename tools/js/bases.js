// SPEC.md, "Bases": models of kind 1, each some bases of vectors of the same length.

import { annexBytes } from "./annex.js";
import { ByteReader } from "./bytes.js";
import { basisScale, table } from "./codecs/pca.js";
import { RangeDecoder } from "./entropy.js";
import { CONTEXTS, MIXERS, Residuals } from "./residuals.js";
import { startModels } from "./start-models.js";

const WHAT = "a model of bases"; // in messages
const MOST_BASES = 16;
const MOST_POINTS = 2048;
const MOST_DIGITS = 40;
const MOST_ENTRIES = 2 ** 22;

/** Models that a clip may name although the file does not have them: id -> annex file. */
const WELL_KNOWN = new Map([
  ["8ba043dba87bdaa23d508e7f71a66aca", "bases_cmu31.bin"],
  ["70a11d1d1a46e604175c47c3ad8f5188", "bases_cmu31_virtual.bin"],
  ["5fd0fcb2fc33f89b40c3d6561d482249", "bases_cmu38.bin"],
]);

/** Bases that were decoded last, by data; together at most so many entries. */
const CACHED_ENTRIES = 2 ** 23;
const parsed = new WeakMap();
const recent = []; // of data and entries, the oldest first
let cached = 0;

/**
 * @typedef {object} Basis
 * @property {number} nPoints entries of a vector
 * @property {number} nVectors
 * @property {Float64Array} entries what the entries stand for, vector after vector
 */

/**
 * A model that every reader has.
 *
 * @param {string} id in lower case hexadecimal
 * @returns {{ kind: number, data: Uint8Array } | null}
 */
export function wellKnownModel(id) {
  const annex = WELL_KNOWN.get(id);
  return annex === undefined ? null : { kind: 1, data: annexBytes(annex) };
}

/**
 * The bases of a model of kind 1. The same data are parsed once.
 *
 * @param {Uint8Array} data field `data` of MODL
 * @returns {Basis[]}
 * @throws {Refused} where they are no bases
 */
export function parseBases(data) {
  let bases = parsed.get(data);
  if (bases === undefined) {
    bases = decodeBases(data);
    keep(data, bases);
  }
  return bases;
}

/** Remembers bases as long as their data, and not more than the cache may hold. */
function keep(data, bases) {
  const size = bases.reduce((sum, { entries }) => sum + entries.length, 0);
  parsed.set(data, bases);
  recent.push({ data: new WeakRef(data), size });
  cached += size;
  while (cached > CACHED_ENTRIES) {
    const oldest = recent.shift();
    cached -= oldest.size;
    parsed.delete(oldest.data.deref());
  }
}

function decodeBases(data) {
  const reader = new ByteReader(data, WHAT);
  const shapes = readShapes(reader);
  const coder = new RangeDecoder(reader.rest());
  const model = startModels("pca_start.json")[0].copy();
  const residuals = new Residuals(model, CONTEXTS, MIXERS);
  const bases = shapes.map((shape) => decodeBasis(coder, residuals, shape));
  coder.finish(WHAT);
  return bases;
}

/** Sizes and shifts of all bases. */
function readShapes(reader) {
  const nBases = reader.varint();
  if (nBases < 1 || nBases > MOST_BASES) reader.refuse(`${nBases} bases`);
  const shapes = [];
  let entries = 0;
  for (let b = 0; b < nBases; b++) {
    const nPoints = reader.varint();
    if (nPoints < 1 || nPoints > MOST_POINTS) reader.refuse(`vectors of ${nPoints} entries`);
    const nVectors = reader.varint();
    if (nVectors < 1 || nVectors > nPoints) reader.refuse(`${nVectors} vectors of ${nPoints}`);
    entries += nPoints * nVectors;
    if (entries > MOST_ENTRIES) reader.refuse("more than 2^22 entries");
    const shifts = reader.take(nVectors);
    for (const shift of shifts) {
      if (shift > MOST_DIGITS) reader.refuse(`entries of ${shift} binary digits`);
    }
    shapes.push({ nPoints, nVectors, shifts });
  }
  return shapes;
}

/** The entries of one basis, each e * 2^-shift, which is exact. */
function decodeBasis(coder, residuals, { nPoints, nVectors, shifts }) {
  const entries = new Float64Array(nPoints * nVectors);
  for (let v = 0; v < nVectors; v++) {
    const from = v * nPoints;
    table(coder, residuals, entries, from, nPoints, basisScale(shifts[v], nPoints), WHAT);
    const unit = 2 ** -shifts[v];
    for (let j = from; j < from + nPoints; j++) entries[j] *= unit;
  }
  return { nPoints, nVectors, entries };
}
