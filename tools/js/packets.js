// SPEC.md, "Open DATA and packets".

import { ByteReader } from "./bytes.js";
import { crc32 } from "./crc32.js";
import { addSegment, frameSegment, impliedMask, readSegment, segmentFields } from "./data.js";
import { Refused } from "./errors.js";
import { within } from "./limits.js";

const KIND_END = 0;
const KIND_SEGMENT = 1;
const KIND_FRAME = 2;
const KIND_BITS = 0x0f;
const FRESH_BIT = 0x80;
const NOTHING = new Uint8Array(0);

/** Bytes before the body of a packet that its head may have. */
export const MOST_HEAD = 1 + 8 + 3;
/** Bytes of its check. */
export const CHECK_SIZE = 4;
const MOST_SEQUENCE = 8; // bytes of a sequence number

/** What INDX adds to the flags of a segment in a packet, by the kind of the packet. */
const INDEX_FLAGS = { [KIND_SEGMENT]: 64, [KIND_FRAME]: 32 };

/**
 * The kind of the packet that a segment is, as an index says it; 0 of a closed DATA.
 *
 * @param {number} indexFlags
 * @returns {{kind: number, bit: number}} `bit` is not one of the flags of the segment itself
 */
export function packetOf(indexFlags) {
  const kind = [KIND_SEGMENT, KIND_FRAME].find((k) => indexFlags & INDEX_FLAGS[k]);
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
  const packets = new Packets(limits);
  for (;;) {
    const segment = packets.next(reader, 0, clip);
    if (segment === null) return reader.at;
    found(segment);
  }
}

/** The packets of an open DATA, one after the other. */
export class Packets {
  /**
   * @param {object} limits of the profile
   * @param {(offset: number, size: number) => void} [checkPlace] refuses a body by its place
   */
  constructor(limits, checkPlace = () => {}) {
    this.limits = limits;
    this.checkPlace = checkPlace;
    this.sequence = 0;
    this.number = null; // of the frame that is due, once a segment of signal 0 has told it
    this.told = null; // that segment, whose mask frames imply
  }

  /**
   * Reads a packet that is whole.
   *
   * @param {ByteReader} reader at the packet
   * @returns {{kind: number, fresh: boolean, body: Uint8Array, number: number | null,
   *   mask: Uint8Array | null}} `mask` is null where a frame has none
   * @throws {Refused}
   */
  read(reader) {
    const start = reader.at;
    const kindByte = reader.u8();
    const kind = kindByte & KIND_BITS;
    if (kind > KIND_FRAME || kindByte & ~(KIND_BITS | FRESH_BIT)) {
      reader.refuse(`a packet of kind ${kindByte}`);
    }
    const sequence = reader.varint();
    const length = reader.varint();
    if (sequence !== this.sequence) reader.refuse(`packet ${sequence} where packet ${this.sequence} is expected`);
    within(length, this.limits.packetBytes, "bytes of a packet's body");
    const head = reader.bytes.subarray(start, reader.at);
    const body = reader.take(length);
    const { number } = this;
    let mask = null;
    let implied = NOTHING;
    if (kind === KIND_FRAME) {
      if (number === null) reader.refuse("no packet before it states its frame");
      mask = impliedMask(this.told);
      implied = impliedBy(number, mask);
    }
    if (reader.u32() !== checkOf(head, implied, body)) reader.refuse("the crc of a packet is wrong");
    this.sequence++;
    if (kind === KIND_FRAME) this.number++;
    else if (kind === KIND_SEGMENT) this.tell(body);
    return { kind, fresh: (kindByte & FRESH_BIT) !== 0, body, number, mask };
  }

  /** Learns from a segment which frame is due. */
  tell(body) {
    const { number } = this;
    this.number = null;
    try {
      const fields = segmentFields(new ByteReader(body, "segment"));
      if (fields.signal === 0) {
        this.told = body;
        this.number = fields.firstFrame + fields.nFrames;
      } else {
        this.number = number;
      }
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
    }
  }

  /**
   * Reads the next packet, and adds its segment to its signal.
   *
   * @param {ByteReader} reader at the packet
   * @param {number} base where the bytes of the reader begin in the file
   * @param {import("./clip.js").Clip} clip whose signals are given the segments
   * @returns {import("./data.js").Segment | null} null at the end packet
   * @throws {Refused}
   */
  next(reader, base, clip) {
    const { kind, fresh, body, number, mask } = this.read(reader);
    if (kind === KIND_END) {
      if (body.length !== 0) reader.refuse("the end packet must be empty");
      return null;
    }
    const offset = base + reader.at - CHECK_SIZE - body.length;
    let segment;
    if (kind === KIND_SEGMENT) {
      segment = readSegment(body, clip, this.limits);
      if (segment.fresh !== fresh) reader.refuse("packet and segment disagree whether it starts fresh");
    } else {
      segment = frameSegment({ body, fresh, number, mask }, clip.signals[0], this.limits);
    }
    this.checkPlace(offset, body.length);
    segment.offset = offset;
    segment.size = body.length;
    segment.indexFlags |= INDEX_FLAGS[kind];
    addSegment(clip.signals[segment.signal], segment);
    return segment;
  }
}

/** The CRC-32 that a packet has. */
function checkOf(head, implied, body) {
  return crc32(body, 0, body.length, crc32(implied, 0, implied.length, crc32(head)));
}

/** What the check of a frame covers between its head and its body: its number, and its mask. */
function impliedBy(number, mask) {
  const out = new Uint8Array(8 + (mask?.length ?? 0));
  const view = new DataView(out.buffer);
  view.setUint32(0, number % 2 ** 32, true);
  view.setUint32(4, Math.floor(number / 2 ** 32), true);
  if (mask !== null) out.set(mask, 8);
  return out;
}

/**
 * The checked body of a packet that an index names.
 *
 * @param {Uint8Array} bytes up to the end of the packet, from {@link MOST_HEAD} bytes before its
 *   body on, or fewer where the file begins
 * @param {import("./data.js").Segment} segment as the index has it
 * @param {Uint8Array | null} mask that it implies
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function indexedBody(bytes, { packet, offset, size, firstFrame, fresh }, mask) {
  const begin = bytes.length - CHECK_SIZE - size;
  const body = bytes.subarray(begin, begin + size);
  const reader = new ByteReader(bytes, `the packet at ${offset}`, begin + size);
  const check = reader.u32();
  const implied = packet === KIND_FRAME ? impliedBy(firstFrame, mask) : NOTHING;
  const kind = packet | (fresh ? FRESH_BIT : 0);
  for (const head of headsIn(bytes.subarray(0, begin), kind, size)) {
    if (checkOf(head, implied, body) === check) return body;
  }
  return reader.refuse("its crc is wrong, or it differs from the index");
}

/** The heads of such a packet that some bytes end with, whatever its number in its DATA. */
function* headsIn(bytes, kind, length) {
  for (let size = 1; size <= MOST_SEQUENCE; size++) {
    const start = bytes.length - varintSize(length) - size - 1;
    if (start < 0) return;
    const reader = new ByteReader(bytes, "packet", start);
    const last = bytes[start + size];
    const isNumber = last < 0x80 && bytes.subarray(start + 1, start + size).every((b) => b > 0x7f);
    if (reader.u8() !== kind || !isNumber) continue;
    reader.skip(size);
    if (bytes[bytes.length - 1] > 0x7f || reader.varint() !== length) continue;
    yield bytes.subarray(start);
  }
}

function varintSize(value) {
  let size = 1;
  for (let rest = value; rest >= 128; rest = Math.floor(rest / 128)) size++;
  return size;
}
