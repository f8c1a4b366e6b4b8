// Signed 64-bit integers in a BigInt64Array, read and written as two halves: a BigInt for every
// number of a signal would take longer than decoding it.

const TWO_32 = 4294967296;

/**
 * The halves of all integers of an array, in the same memory.
 *
 * @param {BigInt64Array} array
 * @returns {Uint32Array}
 */
export function halvesOf(array) {
  return new Uint32Array(array.buffer, array.byteOffset, 2 * array.length);
}

/** Low u32 of integer i. */
export function lowHalf(halves, i) {
  return halves[2 * i];
}

/** High half of integer i, signed. */
export function highHalf(halves, i) {
  return halves[2 * i + 1] | 0;
}

/** Sets integer i; both halves are taken modulo 2^32. */
export function setHalves(halves, i, low, high) {
  halves[2 * i] = low;
  halves[2 * i + 1] = high;
}

/** Sets integer i to a number of at most 2^53 in size. */
export function setInteger(halves, i, value) {
  halves[2 * i] = value;
  halves[2 * i + 1] = Math.floor(value / TWO_32);
}
