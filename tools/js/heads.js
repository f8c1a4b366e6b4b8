// SPEC.md, "Codec 128: lossless": the heads of channels, with the forms of fast.

import {
  CODED,
  CONSTANT,
  COPY,
  COUNTS,
  NO_UNIT,
  PLAIN,
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

export * from "./forms.js";

const MAX_TAPS = 8;
const MAX_TAP = 511;
const MAX_SCALE = 172;
const MAX_DROP = 19; // of plain forms

/**
 * The head of a channel.
 *
 * @param {ByteReader} reader at the head
 * @param {object} grid of the channel in CLIP
 * @param {number} column the channel
 * @param {{hasProducts: boolean, hasCounts: boolean}} rules of the codec
 * @throws {Refused}
 */
export function readHead(reader, grid, column, rules) {
  const kind = reader.u8();
  switch (kind & 3) {
    case CODED:
      return { kind: CODED, column, ...readCoded(reader, kind, grid, rules) };
    case CONSTANT:
      return { kind: CONSTANT, column, ordinal: readConstant(reader, kind) };
    case COPY:
      if (kind !== COPY) reader.refuse(`kind ${kind} of a copy has reserved bits set`);
      return { kind: COPY, column, group: reader.varint(), channel: reader.varint() };
    default:
      return reader.refuse(`kind ${kind} of a channel is reserved`);
  }
}

function readConstant(reader, kind) {
  const size = kind >> 2;
  if (size > 8) reader.refuse(`kind ${kind} of a constant: more than 8 bytes, or reserved bits`);
  let zigzag = 0n;
  reader.take(size).forEach((byte, i) => {
    if (i === size - 1 && byte === 0) reader.refuse("a constant has more bytes than it needs");
    zigzag |= BigInt(byte) << BigInt(8 * i);
  });
  return zigzag & 1n ? -(zigzag >> 1n) - 1n : zigzag >> 1n;
}

function readCoded(reader, kind, grid, { hasProducts, hasCounts }) {
  const nTaps = (kind >> 3) & 15;
  if (nTaps > MAX_TAPS) reader.refuse(`${nTaps} taps`);
  const spelled = (kind & 128) !== 0;
  const form = spelled ? reader.u8() : formOf(grid);
  const drop = spelled ? reader.u8() : 0;
  if (drop > greatestDrop(form, MAX_DROP)) reader.refuse(`form ${form} with a drop of ${drop}`);
  if (form === PRODUCTS && !(hasProducts && grid.kind === GENERAL)) {
    reader.refuse(`form ${form} in this version, or on a grid of kind ${grid.kind}`);
  }
  if (form === COUNTS && !hasCounts) reader.refuse(`form ${form} in this version`);
  const units = hasUnit(form) ? readUnit(reader, form) : NO_UNIT;
  const top = isClasses(form) ? reader.varint() : 0;
  if (top > greatestTop(form)) reader.refuse(`top class ${top} of form ${form}`);
  const q = reader.u8();
  if (q > MAX_SCALE) reader.refuse(`scale ${q}`);
  const scale = scaleOf(q);
  const taps = new Float64Array(nTaps);
  for (let i = 0; i < nTaps; i++) {
    taps[i] = reader.zigzag();
    if (Math.abs(taps[i]) > MAX_TAP) reader.refuse(`a tap of ${taps[i]}`);
  }
  const fromLast = (kind & 4) !== 0;
  return { form, drop, ...units, grid, top, scale, taps, fromLast };
}

/** The heads of coded channels, and of the rests that follow them: plain ones, predicted to be 0. */
export function withRests(heads) {
  const counts = heads.filter(({ law }) => law?.hasRests);
  const taps = new Float64Array(0);
  const plain = { form: PLAIN, drop: 0, ...NO_UNIT, top: 0 };
  const rests = counts.map(({ column, grid, law }) => {
    return { kind: CODED, column, grid, ...plain, scale: 1, taps, fromLast: false, restsOf: law };
  });
  return [...heads, ...rests];
}

