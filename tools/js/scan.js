// SPEC.md, "Salvage": a walk through a damaged file, which passes over what is not whole.

import { ByteReader, hex, sameBytes } from "./bytes.js";
import { readClipEnd } from "./cend.js";
import {
  CRC_SIZE,
  FOOT_SIZE,
  FRAMING_SIZE,
  HEADER_SIZE,
  SIGNATURE_SIZE,
  checkSignature,
  isChunk,
  readChunk,
  readFoot,
  readHeader,
} from "./chunks.js";
import { COPIED, copiesIn } from "./copies.js";
import { Damage } from "./damage.js";
import { Refused } from "./errors.js";
import { readNeeds } from "./head.js";
import { idOf } from "./ids.js";
import { within } from "./limits.js";
import { supplied } from "./missing.js";
import { Packets } from "./packets.js";
import { resynchronize } from "./resynchronize.js";
import { frameNumbers } from "./time-base.js";
import { Walk } from "./walk.js";

const WINDOW = 4 * 1024 * 1024; // bytes that are read at once
export const MOST_CHUNK = 2 ** 29; // bytes of a payload
const ID_SIZE = 16;
const REPEATED = new Set(["HEAD", "SKEL", "MODL", "CLIP"]);
export const MOST_OF_PACKET = 64; // bytes of a packet beside its body, and more
const LEAST_BETWEEN = 2 * FRAMING_SIZE; // bytes in which a CEND and the next CLIP can have been

/** A walk that goes on behind what is damaged. */
export class Scan extends Walk {
  /**
   * @param {import("./ranges.js").Ranges} ranges
   * @param {number} limit bytes that an attachment or template may inflate to
   * @param {Map<string, Uint8Array>} [known] payloads of SKEL and MODL that another walk has found
   *   in REPT chunks, by type and id
   * @param {Map<string, string>} [owners] whose the segments and CENDs are, as an index says: names
   *   of clips by `placeKey`
   */
  constructor(ranges, limit, known = new Map(), owners = new Map()) {
    super(ranges.size, limit);
    this.ranges = ranges;
    this.window = { start: 0, bytes: new Uint8Array(0) };
    this.damage = new Damage();
    this.sound = []; // where chunks and FOOTs lie that are whole: start, stop
    this.badHeaders = []; // where one is due
    this.places = new Map(); // of chunks that may have copies: offsets by `chunkKey`
    this.copies = [];
    this.copyBytes = ranges.size; // that copies may still have
    this.known = known;
    this.repeated = new Map(); // what REPT chunks have of SKEL and MODL
    this.lostSkeletons = new Set();
    this.lostClip = null; // the name of a clip that cannot be read, until it ends
    this.owners = owners;
    this.faultAt = null; // where what cannot be taken in began, up to here
    this.isInDoubt = false; // the open clip may have ended in bytes that are lost
    this.hasDoubts = false;
    this.lastIndex = null; // the last INDX that is whole
    const { skeletons, templates } = this.file;
    this.references = {
      ...this.file,
      skeletons: { has: () => true, get: (id) => skeletons.get(id) },
      templates: { get: (id) => templates.get(id) ?? { id, format: null, data: null } },
    };
  }

  async run() {
    try {
      checkSignature(await this.view(0, Math.min(this.file.size, SIGNATURE_SIZE)));
    } catch (error) {
      this.note(error, 0, SIGNATURE_SIZE);
    }
    while (!(this.endOfFoot === this.file.size && this.clip === null)) {
      const begin = this.at;
      try {
        await this.step();
        this.faultAt = null;
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        this.faultAt ??= this.at;
        const next = await this.next(begin);
        this.note(error, begin, next ?? this.file.size);
        if (next === null) break;
        this.at = next;
      }
    }
    this.finish();
    return this.file;
  }

  /** Takes in what begins at `at`; of an open DATA `at` goes on packet by packet. */
  async step() {
    const start = this.at;
    if (start >= this.file.size) this.refuse("the file ends without a FOOT");
    if (!isChunk(await this.view(start, 1), 0)) {
      const foot = readFoot(await this.view(start, FOOT_SIZE), 0);
      this.closeClip();
      this.takeFoot(this.placed(foot, start));
      this.at = this.endOfFoot;
      this.sound.push(start, this.at);
      return;
    }
    const { open, length } = readHeader(await this.view(start, HEADER_SIZE), 0);
    if (open) {
      await this.readOpenData(start);
    } else {
      within(length, MOST_CHUNK, `bytes of the chunk at ${start}`);
      const bytes = await this.view(start, FRAMING_SIZE + length);
      const chunk = readChunk(bytes, 0, this.file.limits.payloadBytes);
      await supplied(() => this.take(this.placed(chunk, start)));
      if (COPIED.has(chunk.type)) this.keepPlace(chunkKey(chunk.type, bytes), start);
      this.at = start + FRAMING_SIZE + length;
    }
    this.sound.push(start, this.at);
  }

  keepPlace(key, start) {
    if (!this.places.has(key)) this.places.set(key, []);
    this.places.get(key).push(start);
  }

  /** A chunk or FOOT that was read apart, with its place in the file. */
  placed(found, start) {
    const end = found.end === null ? null : start + found.end;
    return { ...found, offset: start, end };
  }

  /** Bytes of the file, which are read in windows. */
  async view(start, size) {
    const { size: total } = this.file;
    if (start + size > total) {
      throw new Refused(`byte ${start}: ${size} bytes are needed, the file ends at ${total}`);
    }
    const from = start - this.window.start;
    if (from < 0 || from + size > this.window.bytes.length) {
      const stop = Math.min(total, start + Math.max(size, WINDOW));
      this.window = { start, bytes: await this.ranges.source.read(start, stop) };
      return this.window.bytes.subarray(0, size);
    }
    return this.window.bytes.subarray(from, from + size);
  }

  // What is another way in a damaged file

  take(chunk) {
    const isBody = !chunk.ancillary && chunk.type !== "DATA" && chunk.type !== "CEND";
    if (isBody && this.isRepeated(chunk)) return;
    if (isBody) this.closeClip();
    if (this.attachment && chunk.type !== "ATTA") {
      this.damage.add(`attachment ${this.attachment.name} is not whole`);
      this.attachment = null;
    }
    this.index = null;
    if (chunk.type !== "HEAD") this.dispatch(chunk);
    else if (this.file.head === null) this.readHead(chunk);
    else this.refuse("a second HEAD");
  }

  readHead(chunk) {
    super.readHead(chunk);
    this.references.limits = this.file.limits;
  }

  /** Whether a chunk lies in a REPT whose header is damaged: the clip that is open goes on. */
  isRepeated({ type, payload }) {
    if (!this.clip || !REPEATED.has(type)) return false;
    if (type === "HEAD") return this.file.head !== null && sameBytes(payload, this.file.head);
    if (type === "CLIP") return sameBytes(payload, this.clip.payload);
    const id = this.idOf(type, payload);
    return this.file[type === "SKEL" ? "skeletons" : "models"].has(id);
  }

  /** The id of a SKEL or MODL; null where it cannot be told. */
  idOf(type, payload) {
    try {
      return idOf(type, payload, this.file.limits, this.inflateLimit);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      return null;
    }
  }

  readAncillary(chunk) {
    const { type, offset, payload } = chunk;
    try {
      if (type === "COPY") this.keepCopies(chunk);
      if (type === "REPT") this.readRepeated(chunk);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      if (this.clip === null) this.note(error, offset, chunk.end); // else nothing is lost by it
    }
    if (this.clip || !this.lastClip) return;
    this.lastClip.ancillary.push({ type, offset, length: payload.length });
  }

  /** The copies of a COPY; all together are no longer than the file. */
  keepCopies(chunk) {
    const copies = copiesIn(chunk, this.copyBytes);
    for (const copy of copies) this.copyBytes -= copy.payload.length + FRAMING_SIZE;
    this.copies.push(...copies);
  }

  /** A REPT stands for its chunks where no clip is open; in a clip, for what may be lost. */
  readRepeated({ payload, offset }) {
    const chunks = chunksIn(payload, offset + HEADER_SIZE, this.file.limits.payloadBytes);
    for (const chunk of chunks) {
      if (chunk.type !== "SKEL" && chunk.type !== "MODL") continue;
      this.repeated.set(`${chunk.type} ${this.idOf(chunk.type, chunk.payload)}`, chunk);
    }
    if (this.isInDoubt) this.settle(chunks);
    if (this.clip !== null) return;
    for (const chunk of chunks) {
      if (chunk.type === "HEAD" && this.file.head !== null) continue;
      this.take(chunk);
    }
  }

  /** A REPT tells whether the clip goes on that may have ended: it has the CLIP of its own. */
  settle(chunks) {
    const clips = chunks.filter(({ type }) => type === "CLIP");
    const isSame = clips.length === 1 && sameBytes(clips[0].payload, this.clip.payload);
    this.isInDoubt = !isSame;
    if (clips.length > 0 && !isSame) this.closeClip();
  }

  readInBody(chunk) {
    const { type } = chunk;
    if (type === "DATA" || type === "CEND") this.orphan(chunk);
    else if (type === "INDX") [this.index, this.lastIndex] = [chunk, chunk];
    else super.readInBody(chunk);
  }

  /** What belongs to a clip that is lost. */
  orphan({ type, offset, end }) {
    if (type === "CEND") this.lostClip = null;
    else this.damage.orphan(offset, end, this.lostClip);
  }

  takeFoot(foot) {
    this.index = null;
    this.endOfFoot = foot.end;
  }

  readClip(chunk) {
    const { payload } = chunk;
    const reader = new ByteReader(payload, "CLIP");
    this.checkNeeds(reader);
    const name = reader.text();
    reader.skip(1);
    const skeleton = hex(reader.take(ID_SIZE));
    this.lostClip = name;
    if (!this.file.skeletons.has(skeleton)) this.takeKnown(`SKEL ${skeleton}`);
    if (!this.file.skeletons.has(skeleton)) {
      this.lostSkeletons.add(`SKEL ${skeleton}`);
      this.damage.add(`clip ${name} is lost, since its skeleton ${skeleton} is`, { clip: name });
      return;
    }
    super.readClip(chunk);
    this.lostClip = null;
    Object.assign(this.clip, { payload, damage: [], end: null });
    for (const signal of this.clip.signals) signal.mayLack = true;
  }

  /** Refuses a clip of another version, and no other. */
  checkNeeds(reader) {
    try {
      readNeeds(reader);
    } catch (error) {
      this.refuse(error.message);
    }
  }

  /** Takes in a SKEL that only a REPT behind its clip has. */
  takeKnown(key) {
    const chunk = this.known.get(key);
    if (chunk !== undefined) super.readInBody(chunk);
  }

  readData(chunk) {
    this.checkOwner("DATA", chunk.offset + HEADER_SIZE, chunk.payload.length);
    super.readData(chunk);
    this.release(this.clip.segments.at(-1));
  }

  /** Payloads are read again when they are wanted. */
  release(segment) {
    segment.payload = new Uint8Array(0);
  }

  async readOpenData(start) {
    this.index = null;
    if (!this.clip) this.refuse("an open DATA outside a clip");
    const { clip, file } = this;
    const place = (offset, size) => this.checkOwner("packet", offset, size);
    const packets = new Packets(file.limits, place);
    this.at = start + HEADER_SIZE;
    for (;;) {
      const most = Math.min(file.size - this.at, file.limits.packetBytes + MOST_OF_PACKET);
      const reader = new ByteReader(await this.view(this.at, most), `open DATA of ${clip.name}`);
      const { sequence } = packets;
      let segment;
      try {
        segment = packets.next(reader, this.at, clip);
      } catch (error) {
        if (error instanceof Refused) error.message += ` (from byte ${this.at} on)`;
        if (packets.sequence > sequence) {
          this.at += reader.at;
          await this.passPackets(packets);
        }
        throw error;
      }
      this.at += reader.at;
      if (segment === null) return;
      clip.segments.push(segment);
      this.release(segment);
    }
  }

  /** Goes behind the packets that are whole, though they cannot be used. */
  async passPackets(packets) {
    const { file } = this;
    try {
      for (;;) {
        const most = Math.min(file.size - this.at, file.limits.packetBytes + MOST_OF_PACKET);
        const reader = new ByteReader(await this.view(this.at, most), "open DATA");
        const { kind } = packets.read(reader);
        this.at += reader.at;
        if (kind === 0) return;
      }
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
    }
  }

  /** Refuses what may belong to another clip than the one that is open. */
  checkOwner(what, offset, size) {
    const owner = this.owners.get(placeKey(offset, size));
    if (owner === this.clip.name) this.isInDoubt = false;
    else if (owner !== undefined || this.isInDoubt)
      this.refuse(`${what} at ${offset} lies behind bytes that may have ended clip ${this.clip.name}`);
  }

  readClipEnd({ payload, offset }) {
    const { clip } = this;
    this.checkOwner("CEND", offset, payload.length);
    const end = readClipEnd(payload, clip, true);
    clip.end = { ...end, offset, length: payload.length };
    clip.nFrames = end.nFrames;
    this.closeClip();
  }

  readAttachment(chunk) {
    const { attachment } = this;
    try {
      super.readAttachment(chunk);
    } catch (error) {
      this.attachment = null;
      throw error;
    }
    for (const part of (this.attachment ?? attachment)?.parts ?? []) part.data = null;
  }

  /** Ends the clip that is open, perhaps without CEND. */
  closeClip() {
    const { clip } = this;
    this.isInDoubt = false;
    if (clip === null) return;
    this.clip = null;
    clip.payload = null;
    if (clip.end === null) {
      clip.declared = clip.nFrames;
      clip.nFrames = framesFound(clip);
      this.damage.noEnd(clip);
    }
    try {
      clip.numbers = frameNumbers(clip);
    } catch (error) {
      this.damage.add(error.message, { clip: clip.name });
    }
    this.damage.ofClip(clip);
    this.file.clips.set(clip.name, clip);
    this.lastClip = clip;
  }

  finish() {
    this.closeClip();
    for (const [key, chunk] of this.repeated) if (key.startsWith("MODL")) super.readInBody(chunk);
    if (this.endOfFoot === 0) this.damage.add("the file has no valid FOOT");
    this.damage.flush();
  }

  note(error, start, stop) {
    this.damage.fault(error.message, start, stop, this.clip);
  }

  /** Where to go on after a fault in what begins at `begin`; null: nowhere. */
  async next(begin) {
    this.index = null;
    if (this.at > begin) return this.doubted(await resynchronize(this, this.at)); // behind whole packets
    try {
      const { open, length } = readHeader(await this.view(begin, HEADER_SIZE), 0);
      const end = begin + FRAMING_SIZE + length;
      if (!open && end <= this.file.size) return end;
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.badHeaders.push(begin);
    }
    return this.doubted(await resynchronize(this, begin + 1));
  }

  /** `next`, up to which nothing is known: a clip may have ended there, and another one begun. */
  doubted(next) {
    if (this.clip !== null && next !== null) {
      this.isInDoubt ||= next - this.faultAt >= LEAST_BETWEEN;
      this.hasDoubts ||= this.isInDoubt;
    }
    return next;
  }
}

/** What tells a segment or CEND by its place in a file. */
export const placeKey = (offset, size) => `${offset} ${size}`;

/** What tells a chunk from others: its type, length and crc. */
export const chunkKey = (type, bytes) =>
  `${type} ${bytes.length} ${hex(bytes.subarray(bytes.length - CRC_SIZE))}`;

/** Frames of a clip without CEND: up to the last segment of each signal. */
function framesFound({ signals, nFrames }) {
  return signals.reduce((most, { due, skip, spare }) => {
    const shown = skip > 0 || spare > 0 ? nFrames : due; // those behind are spare
    return Math.max(most, Math.min(due - skip, shown));
  }, 0);
}

/** The chunks in a REPT, of which the payload begins at `start`. */
function chunksIn(payload, start, limit) {
  const chunks = [];
  for (let at = 0; at < payload.length; ) {
    const chunk = readChunk(payload, at, limit);
    if (chunk.open || !REPEATED.has(chunk.type)) throw new Refused(`REPT: a ${chunk.type} in it`);
    at = chunk.end;
    chunks.push({ ...chunk, offset: start + chunk.offset, end: start + chunk.end });
  }
  return chunks;
}
