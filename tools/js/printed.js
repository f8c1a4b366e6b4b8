// SPEC.md, "PRINTED": what the styles of these grids print.

import { decimals, rounded } from "./decimals.js";

const SHORT_FIXED = 64;
export const SIGNIFICANT = 128;
export const EXPONENT = 192;

/** Digits of a PRINTED grid of binary32, of binary64; greater: so many significant digits. */
export const OF_32 = 32;
export const OF_64 = 64;
export const OF_GENERAL = 128;

/** Whether a grid may have these digits with this style. */
export function hasStyle(digits, style) {
  const isGeneral = digits > OF_GENERAL && digits <= OF_GENERAL + 15;
  if (isGeneral) return style === EXPONENT + digits - OF_GENERAL - 1;
  if (digits > 22 && digits !== OF_32 && digits !== OF_64) return false;
  if (style < SIGNIFICANT) return style % SHORT_FIXED <= 40;
  if (style < EXPONENT) return style > SIGNIFICANT && style <= SIGNIFICANT + 17;
  return style <= EXPONENT + 40;
}

/** The number that the text of x says, x >= 0. */
export function said(x, style) {
  if (x === 0) return 0;
  if (style < SIGNIFICANT) return Number(fixedText(x, style));
  const { digits, k } = rounded(x, style < EXPONENT ? style - SIGNIFICANT : style - EXPONENT + 1);
  return Number(`${digits}e${k}`);
}

/** The text of x >= 0 in a style below 128. */
export function fixedText(x, style) {
  if (style < SHORT_FIXED) return decimals(x, style);
  const n = style - SHORT_FIXED;
  if (x === 0) return decimals(x, n);
  const { digits, k } = rounded(x, 17);
  if (k < -n) return decimals(x, n);
  const all = k >= 0 ? digits + "0".repeat(k) : digits.padStart(1 - k, "0");
  const end = all.length + Math.min(k, 0);
  return n > 0 ? `${all.slice(0, end)}.${all.slice(end).padEnd(n, "0")}` : all.slice(0, end);
}

/**
 * The digits of x >= 0 in a style from 192 on, and the exponent of the first.
 *
 * @returns {{mantissa: string, X: number}}
 */
export function exponential(x, style) {
  const n = style - EXPONENT;
  const { digits, k } = x === 0 ? { digits: "0".repeat(n + 1), k: -n } : rounded(x, n + 1);
  return { mantissa: n > 0 ? `${digits[0]}.${digits.slice(1)}` : digits, X: n + k };
}
