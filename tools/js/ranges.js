// Reading parts of a source: near ones together, small ones kept, chunks checked.

import { FRAMING_SIZE, readChunk } from "./chunks.js";
import { Refused } from "./errors.js";
import { within } from "./limits.js";

const GAP = 32 * 1024; // bytes that are read in vain rather than to ask once more
const MOST_AT_ONCE = 8 * 1024 * 1024; // bytes of parts that are read together
const MOST_HELD = 16 * 1024 * 1024; // bytes that are kept
const MOST_OF_ONE = 2 * 1024 * 1024; // of what is kept

/** A source, whose parts are kept for a while. */
export class Ranges {
  /** @param {import("./from-bytes.js").Source} source */
  constructor(source) {
    this.source = source;
    this.size = source.size;
    this.remote = source.remote === true;
    this.held = []; // parts: start, stop and a promise of bytes; the one used last is the last
    this.heldBytes = 0;
  }

  /**
   * The bytes from `start` up to `stop`.
   *
   * @param {number} start
   * @param {number} stop
   * @param {number} [ahead] where requests cost, bytes up to here are read as well
   * @returns {Promise<Uint8Array>}
   * @throws {Refused} where the file ends before
   */
  async read(start, stop, ahead = stop) {
    if (!(start >= 0 && start <= stop && stop <= this.size)) {
      throw new Refused(`bytes ${start} to ${stop} of a file of ${this.size} bytes`);
    }
    const index = this.held.findLastIndex((part) => part.start <= start && stop <= part.stop);
    let part;
    if (index >= 0) {
      [part] = this.held.splice(index, 1);
      this.held.push(part);
    } else {
      const end = this.remote ? Math.min(this.size, Math.max(stop, ahead)) : stop;
      part = this.keep({ start, stop: end, bytes: this.source.read(start, end) });
    }
    const bytes = await part.bytes;
    if (bytes.length !== part.stop - part.start) throw new Refused("a source gives too few bytes");
    return bytes.subarray(start - part.start, stop - part.start);
  }

  keep(part) {
    const size = part.stop - part.start;
    if (size > MOST_OF_ONE) return part;
    this.held.push(part);
    this.heldBytes += size;
    part.bytes.catch(() => this.drop(part));
    while (this.heldBytes > MOST_HELD) this.drop(this.held[0]);
    return part;
  }

  drop(part) {
    const index = this.held.indexOf(part);
    if (index < 0) return;
    this.held.splice(index, 1);
    this.heldBytes -= part.stop - part.start;
  }

  /**
   * Several parts, those that lie near one another by one request.
   *
   * @param {{start: number, stop: number}[]} parts in any order
   * @returns {Promise<Uint8Array[]>} in the same order
   * @throws {Refused}
   */
  async readAll(parts) {
    const runs = [];
    for (const part of [...parts].sort((a, b) => a.start - b.start)) {
      const run = runs.at(-1);
      const stop = run && Math.max(run.stop, part.stop);
      if (run && part.start - run.stop <= GAP && stop - run.start <= MOST_AT_ONCE) {
        run.stop = stop;
        run.parts.push(part);
      } else {
        runs.push({ start: part.start, stop: part.stop, parts: [part] });
      }
    }
    const found = new Map();
    await Promise.all(
      runs.map(async (run) => {
        // What is kept one by one is not read again together.
        if (run.parts.every(({ start, stop }) => this.holds(start, stop))) {
          for (const part of run.parts) found.set(part, await this.read(part.start, part.stop));
          return;
        }
        const bytes = await this.read(run.start, run.stop);
        for (const part of run.parts) {
          found.set(part, bytes.subarray(part.start - run.start, part.stop - run.start));
        }
      }),
    );
    return parts.map((part) => found.get(part));
  }

  holds(start, stop) {
    return this.held.some((part) => part.start <= start && stop <= part.stop);
  }

  /**
   * The checked payload of a chunk.
   *
   * @param {{type: string, offset: number, length: number}} place
   * @param {number} limit bytes of the longest payload
   * @param {number} [ahead] as of {@link read}
   * @returns {Promise<Uint8Array>}
   * @throws {Refused} where the file has no such chunk there, or its crc is wrong
   */
  async payload(place, limit, ahead) {
    within(place.length, limit, `bytes of ${place.type} at ${place.offset}`);
    const stop = place.offset + FRAMING_SIZE + place.length;
    return payloadIn(await this.read(place.offset, stop, ahead), place);
  }
}

/**
 * The checked payload of a chunk whose bytes are at hand.
 *
 * @param {Uint8Array} bytes of the whole chunk
 * @param {{type: string, offset: number, length: number}} place
 * @throws {Refused}
 */
export function payloadIn(bytes, { type, offset, length }) {
  let chunk;
  try {
    chunk = readChunk(bytes, 0, length);
  } catch (error) {
    if (error instanceof Refused) error.message = `${type} at ${offset}: ${error.message}`;
    throw error;
  }
  if (chunk.type !== type || chunk.open || chunk.payload.length !== length) {
    throw new Refused(`${type} at ${offset}: what lies there is not as the index says`);
  }
  return chunk.payload;
}
