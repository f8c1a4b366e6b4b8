// Frame time as printed -> frames a second: the rule of mcz/sources/tables/times.py.

import { numberOf } from "./lines.js";

const LEAST = 1e-9; // seconds
const MOST = 1e9;
const MOST_LETTERS = 64;
const UNITS = [1, 1000 / 1001];
const FINER = [10, 100, 1000]; // parts of a frame a second, where many digits are printed
const SURPLUS = 1e6; // times the digits that tell two such rates apart

/**
 * Frames a second. A rate whose reciprocal rounds to the printed digits is taken for the true one:
 * an integer, an integer divided by 1.001, or, where many digits are printed, one of few decimals.
 *
 * @param {string} word a frame time in seconds
 * @returns {number | null} null where it is zero, negative, absurd or not a number
 */
export function frameRate(word) {
  const time = word.length > MOST_LETTERS ? NaN : numberOf(word);
  if (!(time >= LEAST && time <= MOST)) return null;
  // The word may have been a binary64 before, and is one here: each is rounded by half a unit.
  const half = halfDigit(word) + time * Number.EPSILON;
  const spread = half / time / time;
  const finer = FINER.filter((n) => spread * SURPLUS < 1 / n).map((n) => 1 / n);
  for (const unit of [...UNITS, ...finer]) {
    const rate = near(1 / time, unit);
    if (rate > 0 && Math.abs(1 / rate - time) <= half) return rate;
  }
  return 1 / time;
}

/** The multiple of `unit` that is nearest; an integer is divided, which is exact where it can be. */
function near(rate, unit) {
  if (unit === UNITS[1]) return (rounded(rate * 1.001) * 1000) / 1001;
  const parts = Math.round(1 / unit);
  return rounded(rate * parts) / parts;
}

/** To the nearest integer, and from halfway to the even one, as the reader does. */
function rounded(x) {
  const below = Math.floor(x);
  return x - below === 0.5 ? below + (below % 2) : Math.round(x);
}

/** Half a unit of the last digit that is printed. */
function halfDigit(word) {
  const [digits, exponent = "0"] = word.toLowerCase().split("e");
  const decimals = digits.includes(".") ? digits.length - digits.indexOf(".") - 1 : 0;
  return 10 ** (Number(exponent) - decimals) / 2;
}
