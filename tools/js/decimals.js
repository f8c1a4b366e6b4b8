// SPEC.md, "Decimal and binary64": shortest, rounded and decimals. A decimal is a pair of its
// digits, a text without zeros before it ("" for 0), and an exponent k: digits * 10^k.

const buffer = new DataView(new ArrayBuffer(8));

/**
 * The decimal that a number printed by JavaScript says, such as "12.5", "1e+21" or "5e-324".
 *
 * @param {string} text without a sign
 * @returns {{digits: string, k: number}} without zeros behind the digits
 */
export function decimalOf(text) {
  const e = text.indexOf("e");
  const mantissa = e < 0 ? text : text.slice(0, e);
  const exponent = e < 0 ? 0 : Number(text.slice(e + 1));
  const point = mantissa.indexOf(".");
  if (point < 0) return trimmed(mantissa, exponent);
  const digits = mantissa.slice(0, point) + mantissa.slice(point + 1);
  return trimmed(digits, exponent - mantissa.length + point + 1);
}

/** The same decimal without zeros before and behind its digits; k of 0 is 0. */
export function trimmed(digits, k) {
  let start = 0;
  let end = digits.length;
  while (start < end && digits[start] === "0") start++;
  if (start === end) return { digits: "", k: 0 };
  while (digits[end - 1] === "0") end--;
  return { digits: digits.slice(start, end), k: k + digits.length - end };
}

/** shortest(x) of a finite binary64 x >= 0; JavaScript prints nothing else. */
export function shortest(x) {
  return decimalOf(String(x));
}

/** shortest(y) of a finite binary32 y >= 0, as a text that JavaScript reads. */
export function shortest32(y) {
  if (y === 0) return "0";
  // Of decimals of 6 digits each normal binary32 is nearest to at most one, which is the one
  // nearest to it. Subnormals have fewer.
  const few = y >= 2 ** -126 ? 6 : 1;
  // 9 digits are always enough.
  for (let n = few; ; n++) {
    const near = y.toExponential(n - 1);
    if (reads32(near, y)) return evenOf(near, y, n);
    // Below a power of two the numbers lie closer than above it: the nearest decimal may be too
    // far below, and the next one above near enough.
    if (isPowerOfTwo(y) && Number(near) < y) {
      const { digits, k } = rounded(y, n);
      const above = `${BigInt(digits) + 1n}e${k}`;
      if (reads32(above, y)) return above;
    }
  }
}

/** Of two decimals of n digits that are equally near to y the even one; `near` is the upper. */
function evenOf(near, y, n) {
  if (isEven(near[near.indexOf("e") - 1])) return near;
  const { digits, k } = rounded(y, n);
  const even = `${digits}e${k}`;
  return reads32(even, y) ? even : near;
}

/** Of a binary32: whether its fraction is 0. */
function isPowerOfTwo(y) {
  buffer.setFloat32(0, y);
  return buffer.getUint32(0) << 9 === 0;
}

/** Whether a decimal is nearest to the binary32 y, ties to even. */
function reads32(text, y) {
  const x = Number(text);
  const near = Math.fround(x);
  // Only where x is just between two binary32 can the way over binary64 go wrong.
  const other = near + 2 * (x - near);
  if (near === x || Math.fround(other) !== other) return near === y;
  const order = compare(text, x);
  if (order === 0) return near === y;
  return (order < 0 ? Math.min(near, other) : Math.max(near, other)) === y;
}

/** Sign of a decimal less a binary64 above 0. */
function compare(text, x) {
  const a = decimalOf(text);
  const b = exact(x);
  const k = Math.min(a.k, b.k);
  const difference =
    BigInt(a.digits) * 10n ** BigInt(a.k - k) - BigInt(b.digits) * 10n ** BigInt(b.k - k);
  return difference < 0n ? -1 : difference > 0n ? 1 : 0;
}

/** The exact value of a finite binary64 x >= 0. */
export function exact(x) {
  if (x === 0) return { digits: "", k: 0 };
  buffer.setFloat64(0, x);
  const all = buffer.getBigUint64(0);
  const field = Number(all >> 52n);
  const mantissa = (all & 0xfffffffffffffn) | (field > 0 ? 0x10000000000000n : 0n);
  const e = Math.max(field, 1) - 1075;
  if (e >= 0) return trimmed(String(mantissa << BigInt(e)), 0);
  return trimmed(String(mantissa * 5n ** BigInt(-e)), e);
}

/**
 * rounded(x, n): n significant digits, ties to even, of a finite x > 0.
 *
 * @returns {{digits: string, k: number}} n digits
 */
export function rounded(x, n) {
  const [mantissa, exponent] = x.toExponential(n - 1).split("e");
  const digits = mantissa.replace(".", "");
  const k = Number(exponent) - n + 1;
  // JavaScript rounds ties up. In a tie one more digit says all of x, and is 5.
  if (n <= 100 && x.toExponential(n).includes("5e")) {
    const whole = exact(x);
    if (whole.digits.length === n + 1 && whole.digits[n] === "5" && isEven(whole.digits[n - 1])) {
      return { digits: whole.digits.slice(0, n), k: whole.k + 1 };
    }
  }
  return { digits, k };
}

/**
 * decimals(x, n): n digits after the point, ties to even, of 0 <= x < 10^21.
 *
 * @param {number} n 0 to 99
 * @returns {string}
 */
export function decimals(x, n) {
  const text = x.toFixed(n);
  const more = x.toFixed(n + 1);
  if (!more.endsWith("5")) return text;
  const whole = exact(x);
  if (whole.k !== -n - 1 || !isEven(more.at(more.at(-2) === "." ? -3 : -2))) return text;
  return more.slice(0, n === 0 ? -2 : -1);
}

function isEven(digit) {
  return Number(digit) % 2 === 0;
}
