// Opens a file of which parts are read when they are wanted.

import { hex } from "./bytes.js";
import {
  FOOT_SIZE,
  FRAMING_SIZE,
  SIGNATURE_SIZE,
  checkSignature,
  readChunk,
  readFoot,
} from "./chunks.js";
import { clipList } from "./clip-list.js";
import { DecodedRuns } from "./decoded-runs.js";
import { readDirectory } from "./directory.js";
import { Refused } from "./errors.js";
import { readHead } from "./head.js";
import { decodedLimit, within } from "./limits.js";
import { guarded, guardedLater } from "./memory.js";
import { apply, readRecords } from "./metadata.js";
import { supplied } from "./missing.js";
import { openClip } from "./ranged-clip.js";
import { Ranges } from "./ranges.js";
import { salvaged } from "./salvage.js";
import { SharedChunks } from "./shared-chunks.js";
import { Attachment } from "./shared.js";
import { walked } from "./walked.js";

const ALIASED = ["clip", "skeleton", "attachment"];
const TAIL = 128 * 1024; // bytes at the end that are read first
const MOST_INDEX = 2 ** 29; // bytes of an INDX chunk

/**
 * Opens a file. Strictly: it has to end in a valid FOOT, and what is read of it has to be right.
 * A file without an index is walked through.
 *
 * @param {import("./from-bytes.js").Source | Promise<import("./from-bytes.js").Source>} source
 * @param {{salvage?: boolean, limit?: number}} [options] `limit`: bytes that one signal or file may
 *   be decoded to, in place of the limit of SPEC.md
 * @returns {Promise<MczFile>}
 * @throws {import("./errors.js").MczError}
 */
export async function open(source, options = {}) {
  return guardedLater(() => opened(source, options));
}

async function opened(source, { salvage = false, limit }) {
  const ranges = new Ranges(await source);
  const most = limit ?? decodedLimit(ranges.size);
  if (salvage) {
    const found = await salvaged(ranges, most);
    return new MczFile(found.ranges, found.directory, most, true);
  }
  return new MczFile(ranges, await directoryOf(ranges, most), most, false);
}

async function directoryOf(ranges, limit) {
  const { size } = ranges;
  const start = Math.max(0, size - TAIL);
  const tail = await ranges.read(start, size);
  const foot = footIn(tail, size);
  if (foot === null || !ranges.remote) {
    checkSignature(await ranges.read(0, Math.min(size, SIGNATURE_SIZE)));
  }
  if (foot === null || foot.indexLength === 0) return walked(ranges, limit);
  const { indexOffset: offset, indexLength } = foot;
  const end = size - FOOT_SIZE;
  if (indexLength < FRAMING_SIZE || offset + indexLength !== end) {
    throw new Refused(`FOOT at ${end}: an index of ${indexLength} bytes at ${offset}`);
  }
  const read = (at, n) => bytesOf(ranges, at, n, start, tail);
  const directory = await readDirectory(read, offset, indexLength, size);
  if (!ranges.remote) await compareHead(ranges, directory.head);
  return directory;
}

/** The bytes of an INDX, those from `start` on out of `tail`. */
async function bytesOf(ranges, offset, length, start, tail) {
  within(length, MOST_INDEX, "bytes of an index");
  const stop = offset + length;
  if (offset >= start) return tail.subarray(offset - start, stop - start);
  const before = await ranges.read(offset, Math.min(start, stop));
  if (stop <= start) return before;
  const bytes = new Uint8Array(length);
  bytes.set(before);
  bytes.set(tail.subarray(0, stop - start), before.length);
  return bytes;
}

/** The FOOT at the end of a file; null where there is none. */
function footIn(tail, size) {
  if (tail.length < FOOT_SIZE) return null;
  try {
    return readFoot(tail, tail.length - FOOT_SIZE);
  } catch (error) {
    if (error instanceof Refused) return null;
    throw error;
  }
}

/** HEAD has to be as the index says. */
async function compareHead(ranges, head) {
  const end = SIGNATURE_SIZE + FRAMING_SIZE + head.length;
  const bytes = await ranges.read(0, Math.min(end, ranges.size));
  const { type, payload } = readChunk(bytes, SIGNATURE_SIZE, head.length);
  if (type !== "HEAD" || hex(payload) !== hex(head)) {
    throw new Refused("HEAD is not as the index says");
  }
}

/** An open file. */
export class MczFile {
  constructor(ranges, directory, limit, salvage) {
    this.ranges = ranges;
    this.directory = directory;
    this.decodedLimit = limit;
    this.limits = readHead(directory.head);
    this.shared = new SharedChunks(ranges, directory, this.limits, limit, salvage);
    this.salvage = salvage;
    this.records = null;
    this.decoded = new DecodedRuns();
    /** Bytes of the file. */
    this.size = ranges.size;
    /** The clips in file order: see clip-list.js. */
    this.clips = clipList(directory);
    /** Attached files: see {@link attachment}. */
    this.attachments = Array.from(directory.attachments.values(), ({ name, size }) => {
      return { name, size };
    });
    /** Paths that have the content of the source of a clip or skeleton, or of an attached file. */
    this.aliases = Array.from(directory.aliases.values(), ({ name, of, target }) => {
      return { name, of: ALIASED[of], target };
    });
    /** What is lost of a damaged file that is salvaged: see damage.js. */
    this.damage = directory.damage ?? [];
  }

  /**
   * Opens a clip.
   *
   * @param {number | string} which index or name
   * @returns {Promise<import("./ranged-clip.js").RangedClip>}
   * @throws {import("./errors.js").MczError}
   */
  async clip(which) {
    const index = typeof which === "string" ? this.directory.rows.indexOf(which) : which;
    const row = this.directory.rows.at(index);
    if (row === undefined) throw new Refused(`no clip ${which}`);
    return openClip(this, index, row);
  }

  /**
   * @param {string} id in hexadecimal, as the clips have it
   * @returns {Promise<import("./skel.js").Skeleton>}
   * @throws {import("./errors.js").MczError}
   */
  async skeleton(id) {
    const found = await supplied(() => this.shared.skeletons.get(id));
    if (!found) throw new Refused(`no skeleton ${id}`);
    return found;
  }

  /**
   * An attached file.
   *
   * @param {string} name
   * @returns {Promise<Uint8Array>}
   * @throws {import("./errors.js").MczError}
   */
  async attachment(name) {
    const found = this.directory.attachments.get(name);
    if (!found) throw new Refused(`no attachment ${name}`);
    within(found.size, this.decodedLimit, `bytes of attachment ${name}`);
    let attachment = null;
    for (const part of found.parts) {
      const payload = await this.ranges.payload(part, this.limits.payloadBytes);
      await supplied(() => {
        if (attachment === null) attachment = new Attachment(payload, this.decodedLimit);
        else attachment.add(payload);
      });
    }
    if (!attachment.complete) throw new Refused(`attachment ${name} is not whole`);
    return guarded(() => attachment.content());
  }

  /**
   * What is said of a clip, in it and behind it; without an index, of the file as a whole.
   *
   * @param {number | string} [which] index or name of a clip
   * @returns {Promise<Map<string, string>>}
   * @throws {import("./errors.js").MczError}
   */
  async metadata(which) {
    const clip = which === undefined ? null : await this.clip(which);
    const pairs = new Map(clip?.metadata);
    const start = clip === null ? 0 : clip.row.place.offset;
    const said = (await this.said()).get(clip === null ? "" : clip.name) ?? [];
    for (const { at, record } of said) if (at > start) apply(pairs, record);
    return pairs;
  }

  /**
   * What META chunks say, by the names of clips; no clip is read for it.
   *
   * @returns {Promise<Map<string, {at: number, record: object}[]>>}
   */
  async said() {
    this.records ??= this.readRecords().catch((error) => {
      this.records = null;
      throw error;
    });
    return this.records;
  }

  async readRecords() {
    const found = new Map();
    for (const place of this.directory.metadata) {
      const payload = await this.ranges.payload(place, this.limits.payloadBytes);
      for (const record of await supplied(() => readRecords(payload, this.size))) {
        if (!found.has(record.name)) found.set(record.name, []);
        found.get(record.name).push({ at: place.offset, record });
      }
    }
    return found;
  }
}
