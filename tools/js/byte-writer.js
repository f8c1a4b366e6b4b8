// Bytes that are written one after the other, up to a limit.

import { LimitExceeded } from "./errors.js";

export class ByteWriter {
  /**
   * @param {number} limit bytes that may be written
   * @param {string} what named in the message
   */
  constructor(limit, what) {
    this.limit = limit;
    this.what = what;
    this.bytes = new Uint8Array(Math.min(limit, 4096));
    this.size = 0;
  }

  /** Makes room for n bytes and returns where they go. */
  room(n) {
    const at = this.size;
    const size = at + n;
    if (size > this.limit) {
      throw new LimitExceeded(`${this.what}: more than the limit of ${this.limit} bytes`);
    }
    if (size > this.bytes.length) {
      const more = new Uint8Array(Math.min(this.limit, Math.max(size, 2 * this.bytes.length)));
      more.set(this.bytes.subarray(0, at));
      this.bytes = more;
    }
    this.size = size;
    return at;
  }

  write(bytes) {
    const at = this.room(bytes.length); // first, for it may replace this.bytes
    this.bytes.set(bytes, at);
  }

  /** Writes a text of ASCII alone. */
  ascii(text) {
    const at = this.room(text.length);
    for (let i = 0; i < text.length; i++) this.bytes[at + i] = text.charCodeAt(i);
  }

  blanks(n) {
    const at = this.room(n);
    this.bytes.fill(32, at, at + n);
  }

  zeros(n) {
    const at = this.room(n);
    this.bytes.fill(0, at, at + n);
  }

  /** What was written. */
  content() {
    return this.bytes.subarray(0, this.size);
  }
}
