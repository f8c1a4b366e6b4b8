// SPEC.md, "Open DATA and packets".

import { ByteReader } from "./bytes.js";
import { crc32 } from "./crc32.js";
import { addSegment, frameSegment, readSegment } from "./data.js";
import { within } from "./limits.js";

const KIND_END = 0;
const KIND_SEGMENT = 1;
const KIND_FRAME = 2;
const KIND_NUMBERED = 3;
const KIND_BITS = 0x0f;
const FRESH_BIT = 0x80;

/** What INDX adds to the flags of a segment in a packet, by the kind of the packet. */
const INDEX_FLAGS = { [KIND_SEGMENT]: 128, [KIND_FRAME]: 64, [KIND_NUMBERED]: 32 };

/**
 * The kind of the packet that a segment is, as an index says it; 0 of a closed DATA.
 *
 * @param {number} indexFlags
 * @returns {{kind: number, bit: number}} `bit` is not one of the flags of the segment itself
 */
export function packetOf(indexFlags) {
  const kind = [KIND_SEGMENT, KIND_FRAME, KIND_NUMBERED].find((k) => indexFlags & INDEX_FLAGS[k]);
  return kind === undefined ? { kind: 0, bit: 0 } : { kind, bit: INDEX_FLAGS[kind] };
}

/**
 * Reads the packets of an open DATA and adds their segments to the signals of the clip.
 *
 * @param {Uint8Array} bytes the file
 * @param {number} start where the first packet begins
 * @param {import("./clip.js").Clip} clip
 * @param {object} limits of the profile
 * @param {(segment: import("./data.js").Segment) => void} found called for each, in order
 * @returns {number} where the open DATA ends
 * @throws {Refused}
 */
export function readPackets(bytes, start, clip, limits, found) {
  const reader = new ByteReader(bytes, `open DATA of ${clip.name}`, start);
  const packets = new Packets(clip, limits);
  for (;;) {
    const segment = packets.next(reader, 0);
    if (segment === null) return reader.at;
    found(segment);
  }
}

/** The packets of an open DATA, one after the other. */
export class Packets {
  /**
   * @param {import("./clip.js").Clip} clip whose signals are given the segments
   * @param {object} limits of the profile
   * @param {(offset: number, size: number) => void} [checkPlace] refuses a body by its place
   */
  constructor(clip, limits, checkPlace = () => {}) {
    this.clip = clip;
    this.limits = limits;
    this.checkPlace = checkPlace;
    this.sequence = 0;
    this.frameIsDue = false; // a segment of signal 0 has come in this DATA
  }

  /**
   * Reads the next packet.
   *
   * @param {ByteReader} reader at the packet
   * @param {number} base where the bytes of the reader begin in the file
   * @returns {import("./data.js").Segment | null} null at the end packet
   * @throws {Refused}
   */
  next(reader, base) {
    const { clip, limits } = this;
    const packet = readHead(reader, this.sequence, limits);
    if (packet.kind === KIND_END) {
      checkEnd(reader, packet);
      return null;
    }
    const offset = base + reader.at;
    const body = reader.take(packet.length);
    const check = reader.u16();
    let segment;
    if (packet.kind === KIND_SEGMENT) {
      checkBody(reader, check, crc32(body));
      segment = readSegment(body, clip, limits);
      if (segment.fresh !== packet.fresh) reader.refuse("packet and segment differ on freshness");
    } else {
      segment = readFrame(reader, packet, body, check, clip, this.frameIsDue, limits);
    }
    this.checkPlace(offset, packet.length);
    this.frameIsDue ||= segment.signal === 0;
    segment.offset = offset;
    segment.size = packet.length;
    segment.indexFlags |= INDEX_FLAGS[packet.kind];
    addSegment(clip.signals[segment.signal], segment);
    this.sequence++;
    return segment;
  }
}

/**
 * Steps over a packet that is whole; of kind 3 its head alone can tell.
 *
 * @returns {boolean} whether it is the end packet
 * @throws {Refused}
 */
export function passPacket(reader, sequence, limits) {
  const packet = readHead(reader, sequence, limits);
  if (packet.kind === KIND_END) {
    checkEnd(reader, packet);
    return true;
  }
  const body = reader.take(packet.length);
  const check = reader.u16();
  if (packet.kind !== KIND_NUMBERED) checkBody(reader, check, crc32(body));
  return false;
}

function readHead(reader, sequence, limits) {
  const start = reader.at;
  const kindByte = reader.u8();
  const found = reader.varint();
  const length = reader.varint();
  const check = crc32(reader.bytes, start, reader.at);
  if (reader.u16() !== (check & 0xffff)) reader.refuse("the head_check of a packet is wrong");
  const kind = kindByte & KIND_BITS;
  if (kind > KIND_NUMBERED || kindByte & ~(KIND_BITS | FRESH_BIT)) {
    reader.refuse(`a packet of kind ${kindByte}`);
  }
  if (found !== sequence) reader.refuse(`packet ${found} where ${sequence} is due`);
  within(length, limits.packetBytes, "bytes of a packet's body");
  return { kind, length, fresh: (kindByte & FRESH_BIT) !== 0 };
}

function checkEnd(reader, { length }) {
  if (length !== 0) reader.refuse("an end packet with a body");
  if (reader.u16() !== 0) reader.refuse("the body_check of an end packet is not 0");
}

function checkBody(reader, check, crc) {
  if (check !== (crc & 0xffff)) reader.refuse("the body_check of a packet is wrong");
}

function readFrame(reader, packet, body, check, clip, frameIsDue, limits) {
  const signal = clip.signals[0];
  if (signal.groupSizes.length !== 1 || signal.nResolutions !== 1) {
    reader.refuse("a frame of a signal with other than one group and one resolution");
  }
  if (!frameIsDue) reader.refuse("a frame before a segment of signal 0 said which is due");
  const number = packet.kind === KIND_NUMBERED ? u64Bytes(signal.due) : new Uint8Array(0);
  checkBody(reader, check, crc32(number, 0, number.length, crc32(body)));
  return frameSegment(body, packet.fresh, signal, limits);
}

/** The number of a frame, as the check of a packet of kind 3 has it behind the body. */
function u64Bytes(value) {
  const out = new Uint8Array(8);
  const view = new DataView(out.buffer);
  view.setUint32(0, value % 2 ** 32, true);
  view.setUint32(4, Math.floor(value / 2 ** 32), true);
  return out;
}

/** Bytes before the body of a packet that its head may have. */
export const MOST_HEAD = 1 + 8 + 8 + 2;
const CHECK_SIZE = 2;
const MOST_SEQUENCE = 8; // bytes of a sequence number

/**
 * The checked body of a packet that an index names.
 *
 * @param {Uint8Array} bytes up to the end of the packet, from {@link MOST_HEAD} bytes before its
 *   body on, or fewer where the file begins
 * @param {import("./data.js").Segment} segment as the index has it
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function indexedBody(bytes, { packet, offset, size, firstFrame, fresh }) {
  const begin = bytes.length - CHECK_SIZE - size;
  const what = `the packet at ${offset}`;
  const body = bytes.subarray(begin, begin + size);
  const number = packet === KIND_NUMBERED ? u64Bytes(firstFrame) : new Uint8Array(0);
  const reader = new ByteReader(bytes, what, begin + size);
  checkBody(reader, reader.u16(), crc32(number, 0, number.length, crc32(body)));
  const kind = packet | (fresh ? FRESH_BIT : 0);
  if (packet !== KIND_SEGMENT && !hasHead(bytes.subarray(0, begin), kind, size)) {
    reader.refuse("it is not as the index says");
  }
  return body;
}

/** Whether some bytes end with the head of such a packet, whatever its number in its DATA. */
function hasHead(bytes, kind, length) {
  for (let size = 1; size <= MOST_SEQUENCE; size++) {
    const start = bytes.length - CHECK_SIZE - varintSize(length) - size - 1;
    if (start < 0) return false;
    const reader = new ByteReader(bytes, "packet", start);
    const last = bytes[start + size];
    const isNumber = last < 0x80 && bytes.subarray(start + 1, start + size).every((b) => b > 0x7f);
    if (reader.u8() !== kind || !isNumber) continue;
    reader.skip(size);
    if (bytes[bytes.length - CHECK_SIZE - 1] > 0x7f || reader.varint() !== length) continue;
    const check = crc32(bytes, start, reader.at);
    if (reader.left === CHECK_SIZE && reader.u16() === (check & 0xffff)) return true;
  }
  return false;
}

function varintSize(value) {
  let size = 1;
  for (let rest = value; rest >= 128; rest = Math.floor(rest / 128)) size++;
  return size;
}
