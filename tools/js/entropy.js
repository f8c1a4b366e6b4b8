// SPEC.md, "Entropy coding": the range coder, and bits whose probability is learned.

import { Refused } from "./errors.js";

const HALF = 32768;
export const GREATEST_WEIGHT = 2 ** 24;
const EVEN_WEIGHT = 26214;
export const GREATEST_COUNT = 250;

/** squash(x) of every 128th x from -2048 on. */
// prettier-ignore
export const NODES = [
  22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743, 32768,
  40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438, 65476,
  65500, 65514,
];

/** squash(x) is SQUASH[x + 2048]. */
export const SQUASH = new Int32Array(4096);
for (let x = -2047; x <= 2047; x++) {
  const i = (x + 2048) >> 7;
  const v = (x + 2048) & 127;
  SQUASH[x + 2048] = (NODES[i] * (128 - v) + NODES[i + 1] * v + 64) >> 7;
}

/** stretch(p) is STRETCH[p >> 4]. squash grows with x, so the least x grows with p. */
export const STRETCH = new Int32Array(4096);
for (let i = 0, x = -2047; i < 4096; i++) {
  while (x < 2047 && SQUASH[x + 2048] < 16 * i + 8) x++;
  STRETCH[i] = x;
}

/** What a context of count n moves of its way to a bit, in 65536ths: RATE[n]. */
export const RATE = new Int32Array(GREATEST_COUNT + 1);
for (let n = 0; n <= GREATEST_COUNT; n++) RATE[n] = Math.floor(65536 / (n + 2));

/**
 * Number of binary digits.
 *
 * @param {number} v an integer, 0 to 2^53
 */
export function bits(v) {
  if (v < 4294967296) return 32 - Math.clz32(v);
  return 64 - Math.clz32(Math.floor(v / 4294967296));
}

/** v moved into a to b. */
export function clamp(v, a, b) {
  return v < a ? a : v > b ? b : v;
}

/** The range coder. Behind the end of its data all bytes are 0. */
export class RangeDecoder {
  /** @param {Uint8Array} data */
  constructor(data) {
    this.data = data;
    this.at = 0;
    // All three are u32, held as int32: engines keep these without boxes.
    this.low = 0;
    this.high = -1;
    this.code = 0;
    for (let i = 0; i < 4; i++) this.code = (this.code << 8) | this.next();
  }

  next() {
    const at = this.at++;
    if (at < this.data.length) return this.data[at];
    // More bytes shifted in than there are: whatever follows, finish() would refuse the data.
    if (at >= this.data.length + 4) throw new Refused("a stream ends before its bits do");
    return 0;
  }

  /**
   * A bit that is 1 with probability one / 65536.
   *
   * @param {number} one 1 to 65535
   * @returns {0 | 1}
   */
  decode(one) {
    let low = this.low;
    let high = this.high;
    const w = high - low;
    // Both products fit u32, and their sum is at most w.
    const part = (Math.imul(w >>> 16, one) + (Math.imul(w & 65535, one) >>> 16)) | 0;
    let bit;
    if ((this.code - low) >>> 0 <= part >>> 0) {
      bit = 1;
      high = (low + part) | 0;
    } else {
      bit = 0;
      low = (low + part + 1) | 0;
    }
    while ((low ^ high) >>> 24 === 0) {
      low <<= 8;
      high = (high << 8) | 255;
      this.code = (this.code << 8) | this.next();
    }
    this.low = low;
    this.high = high;
    return bit;
  }

  /**
   * An integer of n bits, the highest first, all equally likely.
   *
   * @param {number} n 0 to 53
   */
  number(n) {
    let value = 0;
    for (let i = 0; i < n; i++) value = 2 * value + this.decode(HALF);
    return value;
  }

  /**
   * Call it after the last bit.
   *
   * @param {string} what names the stream in the message
   * @throws {Refused} where the data have not exactly the bytes that their bits take
   */
  finish(what) {
    const low = this.low >>> 0;
    const high = this.high >>> 0;
    let t = 0;
    for (; t < 4; t++) {
      const unit = 2 ** (32 - 8 * t);
      if (Math.ceil(low / unit) * unit <= high) break;
    }
    const size = this.at - 4 + t;
    if (this.data.length !== size) {
      throw new Refused(`${what}: ${this.data.length} bytes, but its bits take ${size}`);
    }
  }
}

/** Contexts, each a probability p and a count n, and mixers of three weights. */
export class Model {
  /**
   * @param {Uint16Array} probabilities p of each context
   * @param {Uint8Array} counts n of each context
   * @param {Float64Array} weights three of each mixer; integers up to 2^24 in size, as doubles
   *   because their products with stretched probabilities do not fit 32 bits
   */
  constructor(probabilities, counts, weights) {
    this.probabilities = probabilities;
    this.counts = counts;
    this.weights = weights;
  }

  /**
   * The model that a table of the annex describes.
   *
   * @param {{probabilities: string[], counts: string[], weights: number[]}} table
   */
  static from(table) {
    const bytes = (lines) => Uint8Array.from(lines.join("").match(/../g), (x) => parseInt(x, 16));
    const probabilities = Uint16Array.from(bytes(table.probabilities), (byte) => 256 * byte + 128);
    return new Model(probabilities, bytes(table.counts), Float64Array.from(table.weights));
  }

  /**
   * A model that knows nothing: contexts of even chances, mixers of equal weights.
   *
   * @param {number} nContexts
   * @param {number} nMixers
   */
  static even(nContexts, nMixers) {
    const probabilities = new Uint16Array(nContexts).fill(HALF);
    return new Model(
      probabilities,
      new Uint8Array(nContexts),
      new Float64Array(3 * nMixers).fill(EVEN_WEIGHT),
    );
  }

  /** A model of its own that begins where this one is. */
  copy() {
    return new Model(this.probabilities.slice(), this.counts.slice(), this.weights.slice());
  }

  /**
   * A mixed bit.
   *
   * @param {RangeDecoder} coder
   * @param {number} mixer number of the mixer
   * @param {number} a number of the first context, b and c of the others
   * @returns {0 | 1}
   */
  mixed(coder, mixer, a, b, c) {
    const { probabilities, weights } = this;
    const x = STRETCH[probabilities[a] >> 4];
    const y = STRETCH[probabilities[b] >> 4];
    const z = STRETCH[probabilities[c] >> 4];
    const i = 3 * mixer;
    const dot = (weights[i] * x + weights[i + 1] * y + weights[i + 2] * z) / 65536;
    const one = SQUASH[Math.floor(Math.max(-2047, Math.min(dot, 2047))) + 2048];
    const bit = coder.decode(one);
    const error = (bit << 16) - one;
    weights[i] = moved(weights[i], x * error);
    weights[i + 1] = moved(weights[i + 1], y * error);
    weights[i + 2] = moved(weights[i + 2], z * error);
    this.learn(a, bit);
    this.learn(b, bit);
    this.learn(c, bit);
    return bit;
  }

  /**
   * A bit with a context of its own.
   *
   * @param {RangeDecoder} coder
   * @param {number} a number of the context
   * @returns {0 | 1}
   */
  adaptive(coder, a) {
    const bit = coder.decode(clamp(this.probabilities[a], 32, 65504));
    this.learn(a, bit);
    return bit;
  }

  /** Moves a context towards a bit. */
  learn(context, bit) {
    const { probabilities, counts } = this;
    const p = probabilities[context];
    const n = counts[context];
    probabilities[context] = p + ((((bit ? 65535 : 0) - p) * RATE[n]) >> 16);
    if (n < GREATEST_COUNT) counts[context] = n + 1;
  }
}

/** A weight after a bit; `step` is its stretched probability times the error, below 2^27. */
function moved(weight, step) {
  const sum = weight + ((step + 8192) >> 14);
  return Math.max(-GREATEST_WEIGHT, Math.min(sum, GREATEST_WEIGHT));
}
