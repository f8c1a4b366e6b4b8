// SPEC.md, "Value to ordinal": numbers of a grid for values that need not be on it, as those of a
// codec of values.

import { exact, rounded } from "./decimals.js";
import {
  BINARY32,
  BINARY64,
  EXACT_POWERS,
  FIXED,
  GENERAL,
  INTEGER,
  SCALED,
  TEXT32,
  TEXT64,
  TRIMMED,
  VAX_F,
  binary32Ordinal,
  baseOf,
  bitsOf,
} from "./grids.js";

const TWO_52 = 2 ** 52;

/** The magnitudes of NaN. */
export const NAN_32 = 0x7fc00000;
const NAN_64 = 0x7ff8000000000000n;

/** rint: the nearest integer of a number that is not negative, ties to even. */
function rint(x) {
  // Between 2^52 and 2^53 binary64 has the integers and no more: the sum rounds as it must.
  return x < TWO_52 ? x + TWO_52 - TWO_52 : x;
}

/**
 * ordinal(grid, x).
 *
 * @param {import("./grids.js").Grid} grid
 * @param {number} x
 * @returns {bigint}
 */
export function ordinalOf(grid, x) {
  const { kind, greatest } = grid;
  if (Number.isNaN(x)) return kind === BINARY32 ? BigInt(NAN_32) : kind === BINARY64 ? NAN_64 : 0n;
  const found = magnitudeOf(grid, Math.abs(x));
  const m = found < greatest ? found : greatest;
  const minus = x < 0 || Object.is(x, -0);
  if (!minus || (kind === VAX_F && m === 0n)) return m;
  return kind === INTEGER || kind === SCALED ? -m : -1n - m;
}

/** The magnitude of a number that is not negative; it may be beyond the greatest of the grid. */
function magnitudeOf(grid, size) {
  const { scale } = grid;
  const { kind, digits } = baseOf(grid.kind, grid.digits);
  if (kind === BINARY32) return BigInt(binary32Ordinal(size));
  if (kind === BINARY64) return bitsOf(size);
  const v = Math.min(size, Number.MAX_VALUE);
  switch (kind) {
    case INTEGER:
      return integer(v);
    case SCALED:
      return integer(v / scale);
    case FIXED:
    case TRIMMED:
      return integer(v * EXACT_POWERS[digits]);
    case GENERAL:
      return general(v, digits);
    case TEXT64:
      return bitsOf(v);
    case TEXT32:
      return BigInt(binary32Ordinal(v));
    default:
      return vax(v);
  }
}

/** rint of what may be infinite, which is beyond every grid. */
function integer(v) {
  return BigInt(rint(Math.min(v, Number.MAX_VALUE)));
}

function general(v, digits) {
  if (v === 0) return 0n;
  const least = EXACT_POWERS[digits - 1];
  let X = Math.floor(Math.log10(v));
  let d = digitsOf(v, digits, X);
  if (!(d > least && d < 10 * least - 1)) {
    // Beside a power of ten that may have been the exponent of a neighbour.
    X = floorLog10(v);
    d = digitsOf(v, digits, X);
  }
  if (!(d >= least && d < 10 * least)) {
    const decimal = rounded(v, digits);
    d = Number(decimal.digits);
    X = decimal.k + digits - 1;
  }
  if (X < -307) return 0n;
  return BigInt(X + 307) * 9n * BigInt(least) + BigInt(d - least + 1);
}

/** The digits of v by one exact operation, X being the exponent of the first; 0 without one. */
function digitsOf(v, digits, X) {
  const s = digits - 1 - X;
  if (Math.abs(s) > 22) return 0;
  return rint(s < 0 ? v / EXACT_POWERS[-s] : v * EXACT_POWERS[s]);
}

/** floor(log10(v)), exactly. */
function floorLog10(v) {
  const [mantissa, exponent] = v.toExponential().split("e");
  if (mantissa !== "1") return Number(exponent);
  // The shortest decimal of a number is a power of ten also where the number lies just beside it.
  const { digits, k } = exact(v);
  return digits.length + k - 1;
}

function vax(v) {
  if (v < 2 ** -128) return v > 2 ** -129 ? 2n ** 23n : 0n;
  const e = Number(bitsOf(v) >> 52n) - 1023 + 129;
  return BigInt((e - 1) * 2 ** 23 + rint(v * 2 ** (152 - e)));
}
