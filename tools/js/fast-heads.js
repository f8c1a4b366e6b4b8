// SPEC.md, "Codec 1: fast": the heads of channels.

import {
  CODED,
  CONSTANT,
  COPY,
  NO_UNIT,
  PRODUCTS,
  formOf,
  greatestDrop,
  greatestTop,
  hasUnit,
  isClasses,
  readUnit,
  scaleOf,
} from "./forms.js";
import { GENERAL } from "./grids.js";

export const STEPS = 3;

// Bits of the kind of a coded channel.
const TAPS = 12;
const TINY = 16;
const PARENT = 32;
const EXCEPTIONS = 64;
const FORM = 128;

const MAX_ORDINAL_BYTES = 8;
const MAX_SCALE = 120;
const TWO_15 = 2 ** 15;
const TWO_31 = 2 ** 31;

/** Taps by bits 2-3 of a kind; those of 3 are in the head. */
const KNOWN_TAPS = [
  [0, 0, 0, 0],
  [32, 0, 0, 0],
  [64, -32, 0, 0],
];

/**
 * An ordinal as the halves of its 64 bits, both signed.
 *
 * @typedef {{low: number, high: number}} Halves
 */

/**
 * The head of a channel.
 *
 * @param {import("./bytes.js").ByteReader} reader at the head
 * @param {object} grid of the channel in CLIP
 * @param {number} column the channel
 * @param {number} nRows of the segment
 * @returns {object} its kind, column, and what that kind has
 * @throws {Refused}
 */
export function readFastHead(reader, grid, column, nRows) {
  const kind = reader.u8();
  switch (kind & 3) {
    case CODED:
      return readCoded(reader, kind, grid, column, nRows);
    case CONSTANT:
      if (kind >= 64) reader.refuse(`kind ${kind} of a constant`); // FAST-22
      return { kind: CONSTANT, column, ordinal: readOrdinal(reader, kind >> 2) };
    case COPY:
      if (kind !== COPY) reader.refuse(`kind ${kind} of a copy`); // FAST-22
      return { kind: COPY, column, group: reader.varint(), channel: reader.varint() };
    default:
      if (kind !== STEPS) reader.refuse(`kind ${kind} of steps`); // FAST-22
      return { kind: STEPS, column, runs: readRuns(reader, nRows) };
  }
}

/** A short ordinal. @returns {Halves} */
function readOrdinal(reader, size) {
  if (size > MAX_ORDINAL_BYTES) reader.refuse(`an ordinal of ${size} bytes`); // FAST-21
  let low = 0;
  let high = 0;
  for (let i = 0; i < size; i++) {
    const byte = reader.u8();
    if (i < 4) low |= byte << (8 * i);
    else high |= byte << (8 * i - 32);
    if (i === size - 1 && byte === 0) {
      reader.refuse("an ordinal has more bytes than it needs"); // FAST-21
    }
  }
  const sign = -(low & 1);
  return { low: ((low >>> 1) | (high << 31)) ^ sign, high: (high >>> 1) ^ sign };
}

/** A list of rows with an ordinal each, in an Int32Array of three numbers an entry. */
function readRows(reader, nextRow) {
  const n = reader.varint();
  if (2 * n > reader.left) reader.refuse(`a list of ${n} in ${reader.left} bytes`);
  const list = new Int32Array(3 * n);
  for (let i = 0; i < list.length; i += 3) {
    list[i] = nextRow(reader.varint());
    const { low, high } = readOrdinal(reader, reader.u8());
    list[i + 1] = low;
    list[i + 2] = high;
  }
  return list;
}

/** The runs of steps: rows, low and high half of each. */
function readRuns(reader, nRows) {
  let left = nRows;
  const runs = readRows(reader, (rows) => {
    if (rows < 1 || rows > left) {
      reader.refuse(`a run of ${rows} rows, ${left} are left`); // FAST-25
    }
    left -= rows;
    return rows;
  });
  if (left > 0) reader.refuse(`runs of ${nRows - left} rows of ${nRows}`); // FAST-25
  return runs;
}

/** The exceptions of a coded channel: row, low and high half of each. */
function readExceptions(reader, nRows) {
  let row = -1;
  return readRows(reader, (gap) => {
    row += gap + 1;
    if (row >= nRows) reader.refuse(`an exception in row ${row} of ${nRows}`); // FAST-37
    return row;
  });
}

function readCoded(reader, kind, grid, column, nRows) {
  const isSpelled = (kind & FORM) !== 0;
  const form = isSpelled ? reader.u8() : formOf(grid); // FAST-28
  const drop = isSpelled ? reader.u8() : 0;
  checkForm(reader, form, drop, grid);
  const isTiny = (kind & TINY) !== 0;
  if (isTiny && !isClasses(form)) reader.refuse(`kind ${kind} of form ${form}`); // FAST-22
  const { unit, shifts, law } = hasUnit(form) ? readUnit(reader, form) : NO_UNIT;
  const restScale = law?.hasRests ? readScale(reader) : 0;
  const top = isClasses(form) ? reader.varint() : 0;
  if (top > greatestTop(form)) reader.refuse(`top class ${top} of form ${form}`); // FAST-31
  const first = reader.zigzag();
  if (!(first >= -TWO_31 && first < TWO_31)) reader.refuse(`a first lead of ${first}`); // FAST-32
  const scale = readScale(reader);
  const taps = KNOWN_TAPS[(kind & TAPS) >> 2] ?? readTaps(reader);
  const parent = kind & PARENT ? readParent(reader) : null;
  const exceptions = kind & EXCEPTIONS ? readExceptions(reader, nRows) : null;
  return {
    kind: CODED,
    column,
    grid,
    form,
    drop,
    unit,
    shifts,
    law,
    restScale,
    top,
    isTiny,
    first,
    scale,
    taps,
    parent,
    exceptions,
    index: 0,
  };
}

function checkForm(reader, form, drop, grid) {
  const greatest = greatestDrop(form);
  if (greatest < 0) reader.refuse(`form ${form}`); // FAST-29
  if (drop > greatest) reader.refuse(`form ${form} with a drop of ${drop}`); // FAST-30
  if (form === PRODUCTS && grid.kind !== GENERAL) {
    reader.refuse(`products on a grid of kind ${grid.kind}`); // FAST-49
  }
}

function readScale(reader) {
  const q = reader.u8();
  if (q > MAX_SCALE) reader.refuse(`scale ${q}`); // FAST-33
  return scaleOf(q);
}

function readTaps(reader) {
  return [reader.i8(), reader.i8(), reader.i8(), reader.i8()];
}

function readParent(reader) {
  const group = reader.varint();
  const channel = reader.varint();
  const weight = reader.zigzag();
  if (!(weight >= -TWO_15 && weight < TWO_15)) reader.refuse(`a weight of ${weight}`); // FAST-35
  return { group, channel, weight, index: 0 };
}
