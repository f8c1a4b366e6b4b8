// SPEC.md, "Codec 1: fast": plain bits in bytes, the lowest of each byte first, and Rice codes.

import { Refused } from "./errors.js";

const TWO_32 = 2 ** 32;
const PADDING = 8; // so that a word can be read at the last bit
const UNARY_ONLY = 7; // zeros up to which a code has k further bits
const MOST_BITS = 31; // of a code behind its first 1
const MOST_ZEROS = UNARY_ONLY + MOST_BITS;
const MAX_SIZE = 2 ** 26; // of a number, to its scale
const WORD_BITS = 25; // of a word that begins within a byte

/** Takes bits and codes from one part of a stream. Every method may throw {@link Refused}. */
export class RiceReader {
  /**
   * @param {Uint8Array} bytes of the part; few enough are taken that 32 bits count them
   * @param {string} what the part, named in messages
   */
  constructor(bytes, what) {
    this.what = what;
    this.nBytes = bytes.length;
    this.end = 8 * bytes.length;
    this.bit = 0;
    this.bytes = new Uint8Array(bytes.length + PADDING);
    this.bytes.set(bytes);
    this.view = new DataView(this.bytes.buffer);
  }

  refuse(message) {
    throw new Refused(`${this.what}: ${message}`);
  }

  /** The number that the next n bits make, 0 to 32 of them. */
  take(n) {
    const { bit } = this;
    if (bit + n > this.end) this.refuse("it ends before its bits do");
    this.bit = bit + n;
    const at = bit >>> 3;
    const inByte = bit & 7;
    let word = this.view.getUint32(at, true) >>> inByte;
    if (inByte + n > 32) word |= this.bytes[at + 4] << (32 - inByte);
    return n === 32 ? word >>> 0 : word & ((1 << n) - 1);
  }

  /** The same, 0 to 53 bits. */
  takeLong(n) {
    if (n <= 32) return this.take(n);
    const low = this.take(32);
    return low + TWO_32 * this.take(n - 32);
  }

  /**
   * One code, a signed integer of 32 bits.
   *
   * @param {number} scale F, to be changed by {@link nextScale}
   */
  code(scale) {
    const k = 32 - Math.clz32(scale >> 4);
    const word = this.view.getUint32(this.bit >>> 3, true) >>> (this.bit & 7);
    const zeros = word === 0 ? this.countZeros() : 31 - Math.clz32(word & -word);
    let u;
    if (zeros > UNARY_ONLY) {
      u = this.longCode(k, zeros);
    } else if (zeros + 1 + k <= WORD_BITS) {
      this.bit += zeros + 1 + k;
      if (this.bit > this.end) this.refuse("it ends before its codes do");
      u = (zeros << k) | ((word >>> (zeros + 1)) & ((1 << k) - 1));
    } else {
      this.bit += zeros + 1;
      u = (zeros << k) | this.take(k);
    }
    return (u >>> 1) ^ -(u & 1);
  }

  /** A code of so many zeros that it has more than k bits behind them. */
  longCode(k, zeros) {
    const j = zeros - UNARY_ONLY;
    if (k + j > MOST_BITS) this.refuse(`a code of ${k} + ${j} bits`); // FAST-40
    this.bit += zeros + 1;
    const u = (6 + 2 ** j) * 2 ** k + this.take(k + j);
    if (u >= TWO_32) this.refuse(`a code of ${u}`); // FAST-41
    return u;
  }

  /** The zeros before the next 1, which need not be in the next word. */
  countZeros() {
    for (let zeros = 0; zeros <= MOST_ZEROS; zeros++) {
      const at = this.bit + zeros;
      if ((this.bytes[at >>> 3] >> (at & 7)) & 1) return zeros;
    }
    return this.refuse(`a code of more than ${MOST_ZEROS} zeros`); // FAST-40, or it ends here
  }

  /** Call it after the last bit. */
  finish() {
    if ((this.bit + 7) >>> 3 !== this.nBytes) {
      this.refuse(`${this.nBytes} bytes for ${this.bit} bits`); // FAST-20
    }
    if (this.take(this.end - this.bit) !== 0) {
      this.refuse("a bit after the last is not 0"); // FAST-20
    }
  }
}

/** The scale F after a code. */
export function nextScale(scale, e) {
  return scale + ((16 * Math.min(Math.abs(e), MAX_SIZE) - scale) >> 2);
}
