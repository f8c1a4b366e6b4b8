// SPEC.md, "Codec 1: fast": the forms of coded channels, and their units.

import {
  BINARY32,
  BINARY64,
  GENERAL,
  TEXT32,
  TEXT64,
  VAX_F,
  baseOf,
} from "./grids.js";

export const CODED = 0;
export const CONSTANT = 1;
export const COPY = 2;

// Forms; 1 to 15 are classes of so many decimal digits.
export const PLAIN = 0;
export const MULTIPLES = 32;
export const PRODUCTS = 33;
export const COUNTS = 34;
const CLASSES_24 = 88;
const CLASSES_53 = 117;

/** What forms without a unit have in its place. */
export const NO_UNIT = { unit: 1, shifts: 0, law: null };

/** B^j for 0 <= j <= 63; the last ones stand for "too large", and all are exact. */
const POWERS_OF_2 = Float64Array.from({ length: 64 }, (_, j) => 2 ** Math.min(j, 62));
const POWERS_OF_10 = Float64Array.from({ length: 64 }, (_, j) =>
  Number(`1e${Math.min(j, 18)}`),
);

/** The scale that a byte stands for. */
export function scaleOf(q) {
  return Math.floor(((4 + (q % 4)) * 2 ** (q >> 2)) / 4);
}

/**
 * The unit of forms 32 to 34, and what these have beside it.
 *
 * @returns {{unit: number, shifts: number, law: object | null}}
 */
export function readUnit(reader, form) {
  const unit = reader.f64();
  if (!(unit >= 2 ** -200 && unit <= 2 ** 80)) reader.refuse(`unit ${unit}`); // FAST-47
  const shifts = form === PRODUCTS ? readShifts(reader) : 0;
  return { unit, shifts, law: form === COUNTS ? readLaw(reader) : null };
}

function readShifts(reader) {
  const shifts = reader.u8();
  if (!(shifts >= 1 && shifts <= 63)) reader.refuse(`${shifts} shifts`); // FAST-50
  return shifts;
}

/** What follows the unit of counts; null for a sum that is not made. */
function readLaw(reader) {
  const parts = reader.u8();
  if (parts > 7) reader.refuse(`parts ${parts}`); // FAST-52
  const offset = parts & 1 ? readTerm(reader) : null;
  const shift = parts & 2 ? readTerm(reader) : null;
  return { offset, shift, hasRests: (parts & 4) !== 0 };
}

function readTerm(reader) {
  const term = reader.f64();
  if (!(Math.abs(term) <= 2 ** 80)) reader.refuse(`an offset or shift of ${term}`); // FAST-53
  return term;
}

/** Whether the numbers of a form are made of integers by a unit. */
export function hasUnit(form) {
  return form === MULTIPLES || form === PRODUCTS || form === COUNTS;
}

/** Whether the numbers of a form lie in classes. */
export function isClasses(form) {
  return form !== PLAIN && !hasUnit(form);
}

/** The form of a channel whose head does not tell. */
export function formOf(grid) {
  const { kind, digits } = baseOf(grid.kind, grid.digits);
  switch (kind) {
    case GENERAL:
      return digits;
    case TEXT64:
    case BINARY64:
      return CLASSES_53;
    case TEXT32:
    case BINARY32:
    case VAX_F:
      return CLASSES_24;
    default:
      return PLAIN;
  }
}

/** Greatest `drop` of a form; -1 where there is no such form. */
export function greatestDrop(form) {
  if (form === PLAIN) return 32;
  if (form <= 15 || hasUnit(form)) return 0;
  if (form === CLASSES_24) return 22;
  if (form === CLASSES_53) return 51;
  return -1;
}

/** Greatest `top` of a form in classes. */
export function greatestTop(form) {
  return form === CLASSES_24 ? 255 : form === CLASSES_53 ? 2047 : 614;
}

/** What follows from a head for numbers in classes; it means nothing for plain forms. */
export function classesOf({ form, drop }) {
  const decimal = form <= 15;
  const nDigits = decimal ? form : form - 64 - drop; // P
  const least = decimal ? 10 ** (form - 1) : 2 ** (nDigits - 1); // L
  return {
    decimal,
    nDigits,
    least,
    powers: decimal ? POWERS_OF_10 : POWERS_OF_2,
    perClass: (decimal ? 9 : 1) * least, // K
  };
}

/** The product that a code of form 33 says. */
export function productOf({ unit, shifts }, code) {
  if (code === 0) return 0;
  const before = Math.abs(code) - 1;
  const size = (2 * Math.floor(before / shifts) + 1) * 2 ** (before % shifts) * unit;
  return code < 0 ? -size : size;
}

/** The number that a count says, a binary32. */
export function numberOfCount({ unit, law }, count) {
  let x = count * unit;
  if (law.offset !== null) x += law.offset;
  x = Math.fround(x);
  return law.shift === null ? x : Math.fround(x + law.shift);
}
