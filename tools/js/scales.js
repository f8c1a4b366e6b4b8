// First scales, quantizer steps and decimals, as wavelet, qbc and pca (and Space, steps) say them.

/** Largest magnitude of an integer of the published methods. */
export const GREATEST = 2 ** 40;

/** Where `decimals` is this, integers are multiples of a step. */
export const SCALED = 255;

/**
 * The first scale of h half octaves: ((2 + h mod 2) * 2^(h div 2)) div 2.
 *
 * @param {number} h 0 to 63
 */
export function firstScale(h) {
  return Math.floor(((2 + (h % 2)) * 2 ** (h >> 1)) / 2);
}

/**
 * The step, or weight, of a code s: (4 + s mod 4) * 2^(s div 4 - 34), exact.
 *
 * @param {number} code 0 to 255
 */
export function stepOf(code) {
  return ((4 + (code % 4)) * 2 ** (code >> 2)) / 2 ** 34;
}

/** Whether x is a step or unit that a header may state: 2^-100 to 2^100, so no NaN. */
export function isStep(x) {
  return x >= 2 ** -100 && x <= 2 ** 100;
}
