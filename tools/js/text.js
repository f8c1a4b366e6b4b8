// SPEC.md, "Ordinal to text": what a grid prints, and what the token of an exception says.

import { decimals, decimalOf, rounded, shortest, shortest32, trimmed } from "./decimals.js";
import { Refused } from "./errors.js";
import {
  EXPONENT1,
  EXPONENT3,
  FIXED,
  GENERAL,
  NO_ZERO,
  PLUS,
  POINT,
  PRINTED,
  POINT_ZERO,
  TEXT32,
  TRIMMED,
  UPPER,
  float32Of,
  float64Of,
  general,
  printedNumber,
} from "./grids.js";
import { EXPONENT, SIGNIFICANT, exponential, fixedText } from "./printed.js";

const TWO_32 = 2 ** 32;

/**
 * text(grid, o).
 *
 * @param {import("./grids.js").Grid} grid one that has text
 * @param {number} oLow low half of the ordinal, a u32
 * @param {number} oHigh high half, an i32
 * @returns {string} ASCII
 */
export function textOfOrdinal(grid, oLow, oHigh) {
  const minus = oHigh < 0;
  const low = minus ? ~oLow >>> 0 : oLow;
  const high = minus ? ~oHigh : oHigh;
  const { kind, digits } = grid;
  if (kind === FIXED || kind === TRIMMED) {
    const d = high * TWO_32 + low;
    const decimal = { digits: d === 0 ? "" : String(d), k: -digits };
    const { digits: all, k } = kind === TRIMMED ? trimmed(decimal.digits, -digits) : decimal;
    return printed(grid, minus, all, k, -Infinity, Infinity);
  }
  if (kind === GENERAL) {
    const { d, k } = general(low, high, digits);
    const decimal = d === 0 ? { digits: "", k: 0 } : trimmed(String(d), k);
    return printed(grid, minus, decimal.digits, decimal.k, -4, digits);
  }
  if (kind === PRINTED) return textOfPrinted(grid, minus, printedNumber(grid, low, high));
  return textOfBinary(grid, minus, kind === TEXT32 ? float32Of(low) : float64Of(low, high));
}

/** PRINTED, of a finite x >= 0. */
function textOfPrinted({ flags, style }, minus, x) {
  if (style < SIGNIFICANT) return (minus ? "-" : "") + fixedText(x, style);
  if (style < EXPONENT) {
    return significant({ flags }, minus, x, style - SIGNIFICANT);
  }
  const { mantissa, X } = exponential(x, style);
  return (minus ? "-" : flags & PLUS ? "+" : "") + mantissa + exponentOf(flags, X);
}

/** TEXT64 and TEXT32, of a finite x >= 0. */
function textOfBinary(grid, minus, x) {
  const { kind, digits } = grid;
  if (digits >= 64) return (minus ? "-" : "") + decimals(x, digits - 64);
  if (digits >= 16) return significant(grid, minus, x, digits);
  let decimal;
  if (x === 0) decimal = { digits: "", k: 0 };
  else decimal = kind === TEXT32 ? decimalOf(shortest32(x)) : shortest(x);
  const [low, high] = digits === 0 ? [-4, 16] : [-6, 21];
  return printed(grid, minus, decimal.digits, decimal.k, low, high);
}

/** So many significant digits, as %g has them. */
function significant(grid, minus, x, n) {
  const decimal = x === 0 ? { digits: "", k: 0 } : rounded(x, n);
  const { digits, k } = trimmed(decimal.digits, decimal.k);
  return printed(grid, minus, digits, k, -4, n);
}

/** The text of the decimal d * 10^k, with an exponent where that of its first digit asks for it. */
function printed({ flags }, minus, d, k, low, high) {
  const n = d.length;
  const X = n - 1 + k;
  const sign = minus ? "-" : flags & PLUS ? "+" : "";
  if (n > 0 && (X < low || X >= high)) {
    const mantissa = n > 1 ? `${d[0]}.${d.slice(1)}` : d;
    return sign + mantissa + exponentOf(flags, X);
  }
  if (k >= 0) {
    const point = flags & POINT_ZERO ? ".0" : flags & POINT ? "." : "";
    return sign + (n > 0 ? d + "0".repeat(k) : "0") + point;
  }
  const all = d.padStart(-k, "0");
  const whole = all.slice(0, all.length + k) || (flags & NO_ZERO ? "" : "0");
  return `${sign}${whole}.${all.slice(k)}`;
}

/** The exponent X as the flags have it. */
function exponentOf(flags, X) {
  const width = flags & EXPONENT3 ? 3 : flags & EXPONENT1 ? 1 : 2;
  const exponent = String(Math.abs(X)).padStart(width, "0");
  return (flags & UPPER ? "E" : "e") + (X < 0 ? "-" : "+") + exponent;
}

// Tokens

const NUMBER = /^[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?$/i;
const INFINITY = /^[+-]?(?:inf|infinity|\d\.#inf\d*)$/i;
const NOT_A_NUMBER = /^[+-]?(?:nan(?:\([a-z0-9_]*\))?|\d\.#(?:qnan|nan|snan|ind)\d*)$/i;

/**
 * The value of an exception.
 *
 * @param {Uint8Array} bytes its token
 * @returns {number}
 * @throws {Refused} where it is no token
 */
export function tokenValue(bytes) {
  const token = latin1(bytes);
  if (NUMBER.test(token)) return Number(token);
  if (INFINITY.test(token)) return token[0] === "-" ? -Infinity : Infinity;
  if (NOT_A_NUMBER.test(token)) return NaN;
  throw new Refused(`an exception says ${JSON.stringify(token.slice(0, 40))}, which is no number`);
}

/** Bytes as a string of as many characters. */
export function latin1(bytes) {
  let text = "";
  for (let i = 0; i < bytes.length; i++) text += String.fromCharCode(bytes[i]);
  return text;
}
