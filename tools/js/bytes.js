// SPEC.md, "Conventions": integers, varints, texts and the structures made of them.

import { Refused } from "./errors.js";

const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });
const TWO_32 = 2 ** 32;

/** The bit of the flags of a structure that has an extension. */
export const EXTENDED = 128;

/** Largest count, size and offset of a file. */
const MAX_COUNT = Number.MAX_SAFE_INTEGER;

/**
 * A count that was computed from others, such as the end of a range.
 *
 * @param {number} value the sum, as a double
 * @param {string} what named in the message
 * @returns {number} the same value
 * @throws {Refused} where it is beyond 2^53 - 1
 */
export function count(value, what) {
  if (value > MAX_COUNT) throw new Refused(`${what}: ${value} is beyond 2^53 - 1`);
  return value;
}

/**
 * Well-formed UTF-8 as a string; a leading U+FEFF stays.
 *
 * @param {Uint8Array} bytes
 * @param {string} what named in the message
 * @throws {Refused} where the bytes are not UTF-8
 */
export function textOf(bytes, what) {
  try {
    return utf8.decode(bytes);
  } catch {
    throw new Refused(`${what}: a text is not UTF-8`);
  }
}

/** Whether two byte arrays hold the same bytes. */
export function sameBytes(a, b) {
  if (a.length !== b.length) return false;
  for (let i = 0; i < a.length; i++) if (a[i] !== b[i]) return false;
  return true;
}

/** One byte array behind the other. */
export function joined(a, b) {
  const out = new Uint8Array(a.length + b.length);
  out.set(a);
  out.set(b, a.length);
  return out;
}

/** Bytes in lower case hexadecimal; ids are compared in this form. */
export function hex(bytes) {
  let out = "";
  for (const byte of bytes) out += byte.toString(16).padStart(2, "0");
  return out;
}

/** Reads the fields of one structure, front to back. Every method may throw {@link Refused}. */
export class ByteReader {
  /**
   * @param {Uint8Array} bytes
   * @param {string} what the structure, named in messages
   * @param {number} [start] first byte that is read
   * @param {number} [end] end of what may be read
   */
  constructor(bytes, what, start = 0, end = bytes.length) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.what = what;
    this.at = start;
    this.stop = end;
  }

  /** Bytes that are left. */
  get left() {
    return this.stop - this.at;
  }

  /** Throws {@link Refused} with the name of the structure and the byte. */
  refuse(message) {
    throw new Refused(`${this.what}, byte ${this.at}: ${message}`);
  }

  /** Steps over n bytes and returns where they begin. */
  skip(n) {
    if (n > this.stop - this.at) {
      this.refuse(`${n} bytes are needed, ${this.stop - this.at} are left`);
    }
    const start = this.at;
    this.at += n;
    return start;
  }

  u8() {
    if (this.at >= this.stop) this.skip(1);
    return this.bytes[this.at++];
  }

  i8() {
    return this.view.getInt8(this.skip(1));
  }

  u16() {
    return this.view.getUint16(this.skip(2), true);
  }

  u32() {
    return this.view.getUint32(this.skip(4), true);
  }

  /** A u64 that is a count, size or offset: at most 2^53 - 1. */
  u64() {
    const start = this.skip(8);
    const low = this.view.getUint32(start, true);
    const high = this.view.getUint32(start + 4, true);
    const value = high * TWO_32 + low;
    if (value > MAX_COUNT) this.refuse("a u64 is beyond 2^53 - 1");
    return value;
  }

  f32() {
    return this.view.getFloat32(this.skip(4), true);
  }

  f64() {
    return this.view.getFloat64(this.skip(8), true);
  }

  varint() {
    let value = 0;
    let factor = 1;
    for (;;) {
      const byte = this.u8();
      // Past 2^53 a sum may be rounded, but never down to 2^53 - 1 or below.
      value += (byte & 127) * factor;
      if (value > MAX_COUNT) this.refuse("a varint is beyond 2^53 - 1");
      if (byte < 128) {
        if (byte === 0 && factor > 1) this.refuse("a varint is not in its shortest form");
        return value;
      }
      factor *= 128;
      // Eight bytes hold 56 bits: what goes on behind them is too large or too long.
      if (factor > 2 ** 56) this.refuse("a varint is beyond 2^53 - 1");
    }
  }

  zigzag() {
    const value = this.varint();
    return value % 2 === 0 ? value / 2 : -(value + 1) / 2;
  }

  /** The next n bytes, a view of the same memory. */
  take(n) {
    const start = this.skip(n);
    return this.bytes.subarray(start, start + n);
  }

  sized() {
    return this.take(this.varint());
  }

  text() {
    return textOf(this.sized(), this.what);
  }

  /** All bytes that are left. */
  rest() {
    return this.take(this.left);
  }

  /**
   * A counted list. Every structure of a list has at least a byte, so a count beyond the bytes
   * that are left is refused before anything is allocated.
   *
   * @template T
   * @param {(reader: ByteReader, index: number) => T} read
   * @returns {T[]}
   */
  counted(read) {
    const n = this.varint();
    if (n > this.left) this.refuse(`a list of ${n} does not fit ${this.left} bytes`);
    const list = [];
    for (let i = 0; i < n; i++) list.push(read(this, i));
    return list;
  }

  /**
   * An optional structure: the value, or null.
   *
   * @template T
   * @param {(reader: ByteReader) => T} read
   * @returns {T | null}
   */
  optional(read) {
    const n = this.varint();
    if (n > 1) this.refuse(`an optional field occurs ${n} times`);
    return n === 1 ? read(this) : null;
  }

  /** A flags byte of which only the bits of `known` may be set. */
  flags(known) {
    const value = this.u8();
    if (value & ~known) this.refuse(`reserved bits are set in flags ${value}`);
    return value;
  }

  /** The extension of a structure whose flags say that it has one: nobody reads it. */
  extension(flags) {
    if (flags & EXTENDED) this.sized();
  }

  /** The end of a closed structure. */
  end() {
    if (this.at !== this.stop) this.refuse(`${this.left} bytes follow its end`);
  }
}
