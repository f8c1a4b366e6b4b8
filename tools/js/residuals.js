// SPEC.md, "Residuals": integers whose size is roughly known.

import { Refused } from "./errors.js";

// The first context and the first mixer of each kind of bit.
const BELOW = 0;
const LESS = 72;
const MORE = 152;
const SECOND = 2072;
const THIRD = 2232;
const SIDE = 2552;
const LESS_MIXER = 1;
const MORE_MIXER = 2;
const SECOND_MIXER = 14;
const THIRD_MIXER = 15;
const SIDE_MIXER = 16;

/** Contexts and mixers of one kind of residuals. */
export const CONTEXTS = 2568;
export const MIXERS = 17;

/**
 * Quarters of an octave of a scale; all from 2^28 on are 111.
 *
 * @param {number} v an integer, at least 1
 */
export function quarters(v) {
  if (v >= 0x10000000) return 111;
  const n = 31 - Math.clz32(v);
  return 4 * n + ((n < 2 ? v << (2 - n) : v >>> (n - 2)) & 3);
}

/** side(x): 0 for 0, 1 above, 2 below. */
export function side(x) {
  return x === 0 ? 0 : x > 0 ? 1 : 2;
}

/** One kind of residuals of a stream: some contexts and mixers of a model. */
export class Residuals {
  /**
   * @param {import("./entropy.js").Model} model
   * @param {number} context number of the first context of these residuals
   * @param {number} mixer number of the first mixer
   */
  constructor(model, context = 0, mixer = 0) {
    this.model = model;
    this.context = context;
    this.mixer = mixer;
  }

  /**
   * residual(minus, f, g), with `near`, `side1`, `side2` and `other` as they are at the moment.
   *
   * @param {import("./entropy.js").RangeDecoder} coder
   * @param {boolean} minus whether the side is turned around
   * @param {number} f a scale, in sixteenths, at least 0
   * @param {number} g the other scale
   * @param {number} near any integer
   * @param {number} side1 0 to 2
   * @param {number} side2 0 to 2
   * @param {number} other 0 to 3
   * @returns {number} an integer below 2^53 in size
   * @throws {Refused} where it would be larger
   */
  decode(coder, minus, f, g, near, side1, side2, other) {
    const { model, context, mixer } = this;
    const kf = quarters(f + 1);
    const ks = quarters(g + 1);
    const cf = kf < 28 ? kf : 28 + (kf & 3);
    const cs = ks < 28 ? ks : 28 + (ks & 3);
    const bf = kf < 28 ? 0 : (kf - 24) >> 2;
    const bs = ks < 28 ? 0 : (ks - 24) >> 2;
    const q = Math.max(0, Math.min(near + 3, 7));

    // n, the bits of the absolute value
    const base = Math.max(0, Math.min(bf, bs) - 2);
    let n = base;
    const below = context + BELOW;
    if (base > 0 && model.mixed(coder, mixer, below + cf, below + 32 + cs, below + 64 + q)) {
      const less = context + LESS;
      n = base - 1;
      while (n > 0) {
        const a = less + Math.min(base - n, 15);
        if (!model.mixed(coder, mixer + LESS_MIXER, a, less + 16 + cf, less + 48 + cs)) break;
        n--;
      }
    } else {
      const more = context + MORE;
      const a = more + 24 * cf;
      const b = more + 768 + 24 * cs;
      const c = more + 1536 + 48 * q + (bf > bs ? 1 : 0);
      for (;;) {
        const x = Math.max(0, Math.min(n - bf + 4, 23));
        const y = Math.max(0, Math.min(n - bs + 4, 23));
        const m = mixer + MORE_MIXER + Math.min(x, 11);
        if (!model.mixed(coder, m, a + x, b + y, c + 2 * x)) break;
        n++;
        if (n > 53) throw new Refused(`a residual of ${n} bits or more`);
      }
    }
    if (n === 0) return 0;

    let v = 1;
    if (n > 1) {
      const x = Math.max(0, Math.min(n - bf + 4, 15));
      const y = Math.max(0, Math.min(n - bs + 4, 15));
      const e = Math.min(n, 31);
      const second = context + SECOND;
      const a = second + 4 * x + (kf & 3);
      const b = second + 64 + 4 * y + (ks & 3);
      v = 2 + model.mixed(coder, mixer + SECOND_MIXER, a, b, second + 128 + e);
      if (n > 2) {
        const third = context + THIRD + (v & 1);
        const a = third + 8 * x + 2 * (kf & 3);
        const b = third + 128 + 8 * y + 2 * (ks & 3);
        v = 2 * v + model.mixed(coder, mixer + THIRD_MIXER, a, b, third + 256 + 2 * e);
      }
      if (n > 3) v = v * 2 ** (n - 3) + coder.number(n - 3);
    }
    const sign = context + SIDE;
    const b = sign + 3 + 3 * side1 + side2;
    const bit = model.mixed(coder, mixer + SIDE_MIXER, sign + side1, b, sign + 12 + other);
    return (bit === 1) !== minus ? -v : v;
  }
}
