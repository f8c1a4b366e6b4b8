// SPEC.md, "Bits": plain bits in bytes, the highest of each byte first.

import { Refused } from "./errors.js";

/** Takes bits from bytes; behind the end of the data all bits are 0. */
export class BitReader {
  /**
   * @param {Uint8Array} bytes
   * @param {string} what the data, named in messages
   */
  constructor(bytes, what) {
    this.bytes = bytes;
    this.what = what;
    this.taken = 0;
  }

  /** The next bit. */
  bit() {
    const at = this.taken++;
    return (this.bytes[Math.floor(at / 8)] >> (7 - (at % 8))) & 1;
  }

  /**
   * The next n bits as a number, the first the highest.
   *
   * @param {number} n at most 53
   */
  plain(n) {
    let value = 0;
    for (let i = 0; i < n; i++) value = 2 * value + this.bit();
    return value;
  }

  /**
   * The end of data that were decoded to their end.
   *
   * @throws {Refused} where a byte is missing or left, or a bit behind the last is not 0
   */
  finish() {
    const used = Math.ceil(this.taken / 8);
    if (this.bytes.length !== used) {
      throw new Refused(`${this.what}: ${this.bytes.length} bytes, but ${this.taken} bits`);
    }
    const behind = (1 << (8 * used - this.taken)) - 1;
    if (behind !== 0 && (this.bytes[used - 1] & behind) !== 0) {
      throw new Refused(`${this.what}: the bits behind the last are not 0`);
    }
  }
}
