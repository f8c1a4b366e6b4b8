// SPEC.md, "Number grids": the structure, and numbers to and from their ordinals. What a grid
// prints is in text.js.

import { shortest32 } from "./decimals.js";
import { Refused } from "./errors.js";
import { halvesOf, highHalf, lowHalf, setHalves } from "./int64.js";
import { EXPONENT, OF_32, OF_64, OF_GENERAL, SIGNIFICANT, hasStyle, said } from "./printed.js";

export const FIXED = 1;
export const TRIMMED = 2;
export const GENERAL = 3;
export const TEXT64 = 4;
export const TEXT32 = 5;
export const INTEGER = 6;
export const SCALED = 7;
export const BINARY32 = 8;
export const BINARY64 = 9;
export const VAX_F = 10;
export const PRINTED = 11;

// prettier-ignore
const NAMES = [
  "FIXED", "TRIMMED", "GENERAL", "TEXT64", "TEXT32", "INTEGER", "SCALED", "BINARY32", "BINARY64",
  "VAX_F", "PRINTED",
];

export const POINT_ZERO = 1;
export const POINT = 2;
export const NO_ZERO = 4;
export const PLUS = 8;
export const EXPONENT3 = 16;
export const EXPONENT1 = 32;
export const UPPER = 64;
const ALL_FLAGS = 127;

const TWO_32 = 2 ** 32;
const MAX_DECIMAL = 2n ** 51n - 1n;

/** 10^k, exact, for 0 <= k <= 22. */
export const EXACT_POWERS = Float64Array.from({ length: 23 }, (_, k) => Number(`1e${k}`));

// One number in memory, to see its bits.
const float64 = new Float64Array(1);
const int64 = new BigInt64Array(float64.buffer);
const halves64 = halvesOf(int64);
const float32 = new Float32Array(1);
const word32 = new Uint32Array(float32.buffer);

/** A number grid. */
export class Grid {
  constructor(kind, digits, flags, scale, style = 0) {
    this.kind = kind;
    this.digits = digits;
    this.flags = flags;
    this.scale = scale;
    this.style = style;
    const { kind: base, digits: own } = baseOf(kind, digits);
    const greatest = greatestMagnitude(base, own, kind === PRINTED && style < SIGNIFICANT);
    /** Least and greatest ordinal. */
    this.least = kind === INTEGER || kind === SCALED ? -greatest : -1n - greatest;
    this.greatest = greatest;
    // The same as halves, for comparisons without BigInt.
    this.leastHigh = Number(this.least >> 32n);
    this.leastLow = Number(this.least & 0xffffffffn);
    this.greatestHigh = Number(greatest >> 32n);
    this.greatestLow = Number(greatest & 0xffffffffn);
  }

  toString() {
    return `${NAMES[this.kind - 1]} ${this.digits}, flags ${this.flags}`;
  }
}

/**
 * The kind and digits of the grid that has the ordinals of this one: another one for PRINTED.
 *
 * @returns {{kind: number, digits: number}}
 */
export function baseOf(kind, digits) {
  if (kind !== PRINTED) return { kind, digits };
  if (digits === OF_32) return { kind: TEXT32, digits: 0 };
  if (digits === OF_64) return { kind: TEXT64, digits: 0 };
  return digits > OF_GENERAL
    ? { kind: GENERAL, digits: digits - OF_GENERAL }
    : { kind: FIXED, digits };
}

/** Whether the numbers of a grid can be printed. */
export function hasText(grid) {
  return grid.kind <= TEXT32 || grid.kind === PRINTED;
}

/**
 * Reads the structure of a grid.
 *
 * @param {import("./bytes.js").ByteReader} reader
 * @returns {Grid}
 * @throws {Refused} where it is none of the table
 */
export function parseGrid(reader) {
  const kind = reader.u8();
  const digits = reader.u8();
  const flags = reader.u8();
  const style = kind === PRINTED ? reader.u8() : 0;
  if (!hasDigits(kind, digits, style)) {
    reader.refuse(`a grid of kind ${kind} with ${digits} digits, style ${style}`);
  }
  const both = (a, b) => (flags & a) !== 0 && (flags & b) !== 0;
  if (flags & ~knownFlags(kind, digits, style) || both(POINT_ZERO, POINT) || both(EXPONENT3, EXPONENT1)) {
    reader.refuse(`${NAMES[kind - 1]} ${digits} with flags ${flags}`);
  }
  let scale = 1;
  if (kind === SCALED) {
    scale = reader.f64();
    if (!(scale >= 2 ** -200 && scale <= 2 ** 200)) reader.refuse(`a grid of scale ${scale}`);
  }
  return new Grid(kind, digits, flags, scale, style);
}

function hasDigits(kind, digits, style) {
  switch (kind) {
    case FIXED:
      return digits <= 22;
    case TRIMMED:
      return digits >= 1 && digits <= 22;
    case GENERAL:
      return digits >= 1 && digits <= 15;
    case TEXT64:
      return [0, 1, 16, 17].includes(digits) || (digits >= 74 && digits <= 104);
    case PRINTED:
      return hasStyle(digits, style);
    default:
      return kind >= TEXT32 && kind <= VAX_F && digits === 0;
  }
}

function knownFlags(kind, digits, style) {
  switch (kind) {
    case FIXED:
      return digits > 0 ? NO_ZERO | PLUS : POINT | PLUS;
    case TRIMMED:
      return POINT_ZERO | POINT | NO_ZERO | PLUS;
    case GENERAL:
    case TEXT32:
      return ALL_FLAGS;
    case TEXT64:
      return digits >= 74 ? 0 : ALL_FLAGS;
    case PRINTED:
      if (style < SIGNIFICANT) return 0;
      return style < EXPONENT ? ALL_FLAGS : PLUS | EXPONENT3 | EXPONENT1 | UPPER;
    default:
      return 0;
  }
}

/** M of the table; `below21`: of numbers below 10^21 alone. */
function greatestMagnitude(kind, digits, below21) {
  switch (kind) {
    case GENERAL:
      return 5535n * 10n ** BigInt(digits - 1);
    case TEXT64:
      return digits >= 74 || below21 ? 0x444b1ae4d6e2ef4fn : 0x7fefffffffffffffn;
    case TEXT32:
      return below21 ? 0x6258d726n : 0x7f7fffffn;
    case INTEGER:
      return 2n ** 53n;
    case BINARY32:
    case VAX_F:
      return 0x7fffffffn;
    case BINARY64:
      return 0x7fffffffffffffffn;
    default:
      return MAX_DECIMAL;
  }
}

// Ordinal to value

/**
 * Checks that a column of ordinals is on its grid.
 *
 * @param {Grid} grid
 * @param {BigInt64Array} ordinals
 * @param {number} start index of the first
 * @param {number} stride from one to the next
 * @param {number} n how many
 * @throws {Refused} where one is not
 */
export function checkColumn(grid, ordinals, start, stride, n) {
  const halves = halvesOf(ordinals);
  const { leastHigh, leastLow, greatestHigh, greatestLow } = grid;
  for (let i = start, end = start + n * stride; i < end; i += stride) {
    const high = highHalf(halves, i);
    // Nearly always the high half alone decides.
    if (high > leastHigh && high < greatestHigh) continue;
    const low = lowHalf(halves, i);
    if (
      high < leastHigh ||
      high > greatestHigh ||
      (high === leastHigh && low < leastLow) ||
      (high === greatestHigh && low > greatestLow)
    ) {
      throw new Refused(`the ordinal ${ordinals[i]} is beyond its grid, ${grid}`);
    }
  }
}

/**
 * The values of a column of ordinals: value(grid, o) of each.
 *
 * @param {Grid} grid
 * @param {BigInt64Array} ordinals
 * @param {Float64Array} values takes the value of ordinal i at i
 * @param {number} start index of the first
 * @param {number} stride from one to the next
 * @param {number} n how many
 * @throws {Refused} where an ordinal is beyond the grid
 */
export function columnValues(grid, ordinals, values, start, stride, n) {
  checkColumn(grid, ordinals, start, stride, n);
  const halves = halvesOf(ordinals);
  const value = VALUE_OF[grid.kind];
  for (let i = start, end = start + n * stride; i < end; i += stride) {
    values[i] = value(grid, lowHalf(halves, i), highHalf(halves, i));
  }
}

/**
 * value(grid, o).
 *
 * @param {Grid} grid
 * @param {bigint} ordinal
 * @returns {number}
 * @throws {Refused} where the ordinal is beyond the grid
 */
export function valueOf(grid, ordinal) {
  const ordinals = BigInt64Array.of(ordinal);
  const values = new Float64Array(1);
  columnValues(grid, ordinals, values, 0, 1, 1);
  return values[0];
}

// value(grid, o) by kind, from the low half of o, a u32, and the high one, an i32. The halves of
// the magnitude of a negative number are their bitwise NOT.
const VALUE_OF = [];

VALUE_OF[INTEGER] = (grid, low, high) => high * TWO_32 + low;

VALUE_OF[SCALED] = (grid, low, high) => (high * TWO_32 + low) * grid.scale;

VALUE_OF[FIXED] = (grid, low, high) => {
  const power = EXACT_POWERS[grid.digits];
  return high < 0 ? -((~high * TWO_32 + (~low >>> 0)) / power) : (high * TWO_32 + low) / power;
};

VALUE_OF[TRIMMED] = VALUE_OF[FIXED];

VALUE_OF[GENERAL] = (grid, low, high) => {
  const minus = high < 0;
  const mHigh = minus ? ~high : high;
  const mLow = minus ? ~low >>> 0 : low;
  const { d, k } = general(mLow, mHigh, grid.digits);
  const x = nearest(d, k);
  return minus ? -x : x;
};

VALUE_OF[BINARY64] = (grid, low, high) => {
  const minus = high < 0;
  const x = float64Of(minus ? ~low : low, minus ? ~high : high);
  return minus ? -x : x;
};

VALUE_OF[TEXT64] = VALUE_OF[BINARY64];

VALUE_OF[BINARY32] = (grid, low, high) => {
  const minus = high < 0;
  const x = float32Of(minus ? ~low : low);
  return minus ? -x : x;
};

VALUE_OF[TEXT32] = (grid, low, high) => {
  const minus = high < 0;
  const m = minus ? ~low : low;
  const x = m === 0 ? 0 : Number(shortest32(float32Of(m)));
  return minus ? -x : x;
};

VALUE_OF[VAX_F] = (grid, low, high) => {
  const minus = high < 0;
  const m = minus ? ~low : low;
  const e = m >>> 23;
  if (e === 0) return minus ? NaN : 0;
  const x = (2 ** 23 + (m & 0x7fffff)) * 2 ** (e - 152);
  return minus ? -x : x;
};

VALUE_OF[PRINTED] = (grid, low, high) => {
  const minus = high < 0;
  const x = said(printedNumber(grid, minus ? ~low >>> 0 : low, minus ? ~high : high), grid.style);
  return minus ? -x : x;
};

/** base(grid, m): the binary64 that a PRINTED grid prints, from the halves of a magnitude. */
export function printedNumber({ digits }, low, high) {
  if (digits === OF_32) return float32Of(low);
  if (digits === OF_64) return float64Of(low, high);
  if (digits <= 22) return (high * TWO_32 + low) / EXACT_POWERS[digits];
  const { d, k } = general(low, high, digits - OF_GENERAL);
  return nearest(d, k);
}

/**
 * general(m, digits): the decimal d * 10^k of a magnitude, from the halves of m.
 *
 * @returns {{d: number, k: number}} d has exactly so many digits, or is 0
 */
export function general(low, high, digits) {
  const least = EXACT_POWERS[digits - 1];
  const block = 9 * least;
  const m = high * TWO_32 + low;
  if (m === 0) return { d: 0, k: 0 };
  if (high < 0x200000) {
    const X = Math.floor((m - 1) / block) - 307;
    return { d: m - 1 - (X + 307) * block + least, k: X - digits + 1 };
  }
  // 14 or 15 digits: m is beyond 2^53.
  const before = ((BigInt(high) << 32n) | BigInt(low)) - 1n;
  const X = Number(before / BigInt(block)) - 307;
  return { d: Number(before % BigInt(block)) + least, k: X - digits + 1 };
}

/** nearest(d, k): the binary64 nearest to d * 10^k, 0 <= d <= 2^53. */
export function nearest(d, k) {
  if (k >= 0 && k <= 22) return d * EXACT_POWERS[k];
  if (k < 0 && k >= -22) return d / EXACT_POWERS[-k];
  return Number(`${d}e${k}`);
}

/** The binary64 of these bits. */
export function float64Of(low, high) {
  setHalves(halves64, 0, low, high);
  return float64[0];
}

/** The binary32 of these bits. */
export function float32Of(word) {
  word32[0] = word;
  return float32[0];
}

/** The ordinal on BINARY32 of the binary32 nearest to x, which is not NaN. */
export function binary32Ordinal(x) {
  float32[0] = x;
  const word = word32[0];
  return word >>> 31 ? -1 - (word & 0x7fffffff) : word;
}

/** The bits of a binary64, as an unsigned integer. */
export function bitsOf(x) {
  float64[0] = x;
  return BigInt.asUintN(64, int64[0]);
}
