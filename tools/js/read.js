// SPEC.md, "Strict reading": a whole file that is at hand, chunk by chunk.

import {
  FOOT_SIZE,
  HEADER_SIZE,
  checkSignature,
  isChunk,
  readChunk,
  readFoot,
} from "./chunks.js";
import { Refused } from "./errors.js";
import { decodedLimit } from "./limits.js";
import { readPackets } from "./packets.js";
import { Walk } from "./walk.js";

/**
 * Reads a file strictly: whatever is wrong in its container is refused. Streams, notes and masks
 * are only found, not decoded.
 *
 * @param {Uint8Array} bytes the whole file
 * @param {{decodedLimit?: number}} [options] bytes that an attachment or template may
 *   inflate to
 * @returns {import("./walk.js").MczFile}
 * @throws {Refused | Unsupported}
 */
export function readFile(bytes, options = {}) {
  return new StrictWalk(bytes, options.decodedLimit ?? decodedLimit(bytes.length)).run();
}

class StrictWalk extends Walk {
  constructor(bytes, limit) {
    super(bytes.length, limit);
    this.bytes = bytes;
  }

  run() {
    try {
      checkSignature(this.bytes);
      this.step(this.chunk());
      do {
        if (isChunk(this.bytes, this.at)) this.step(this.chunk());
        else this.readFoot();
      } while (this.at < this.bytes.length);
      if (this.endOfFoot !== this.bytes.length) this.refuse("the file does not end in a FOOT");
    } catch (error) {
      if (error instanceof Refused && this.endOfFoot > 0) {
        error.message += ` (up to the FOOT at ${this.endOfFoot - FOOT_SIZE} the file is whole)`;
      }
      throw error;
    }
    return this.file;
  }

  chunk() {
    return readChunk(this.bytes, this.at, this.file.limits.payloadBytes);
  }

  step(chunk) {
    if (chunk.open && this.clip && !this.attachment && !this.index) {
      this.readOpenData(chunk);
      return;
    }
    this.take(chunk);
    this.at = chunk.end;
  }

  readFoot() {
    this.takeFoot(readFoot(this.bytes, this.at));
    this.at = this.endOfFoot;
  }

  readOpenData({ offset }) {
    const start = offset + HEADER_SIZE;
    this.at = readPackets(this.bytes, start, this.clip, this.file.limits, (segment) => {
      this.clip.segments.push(segment);
    });
  }
}
