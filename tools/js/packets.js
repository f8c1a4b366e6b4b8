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
  let frameIsDue = false; // a segment of signal 0 has come in this DATA
  for (let sequence = 0; ; sequence++) {
    const packet = readHead(reader, sequence, limits);
    if (packet.kind === KIND_END) {
      checkEnd(reader, packet);
      return reader.at;
    }
    const offset = reader.at;
    const body = reader.take(packet.length);
    const check = reader.u16();
    let segment;
    if (packet.kind === KIND_SEGMENT) {
      checkBody(reader, check, crc32(body));
      segment = readSegment(body, clip, limits);
      if (segment.fresh !== packet.fresh) reader.refuse("packet and segment differ on freshness");
      frameIsDue ||= segment.signal === 0;
    } else {
      segment = readFrame(reader, packet, body, check, clip, frameIsDue, limits);
    }
    segment.offset = offset;
    segment.size = packet.length;
    segment.indexFlags |= INDEX_FLAGS[packet.kind];
    addSegment(clip.signals[segment.signal], segment);
    found(segment);
  }
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
