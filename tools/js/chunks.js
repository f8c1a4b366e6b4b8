// SPEC.md, "Chunks": the signature, the frame of a chunk, and FOOT.

import { ByteReader, sameBytes } from "./bytes.js";
import { crc32 } from "./crc32.js";
import { Refused, Unsupported } from "./errors.js";
import { within } from "./limits.js";

const SIGNATURE = Uint8Array.of(0x89, 0x4d, 0x43, 0x5a, 0x0d, 0x0a, 0x1a, 0x0a);
const END_MAGIC = Uint8Array.of(0x89, 0x5a, 0x43, 0x4d, 0x0d, 0x0a, 0x1a, 0x0a);

export const SIGNATURE_SIZE = 8;
export const HEADER_SIZE = 16; // of a chunk, up to its payload
export const CRC_SIZE = 4;
export const FRAMING_SIZE = HEADER_SIZE + CRC_SIZE;
export const FOOT_SIZE = 32;

const FLAG_ANCILLARY = 1;
const FLAG_SAFE_TO_COPY = 2;
const ALL_ONES = 0xffffffff;

/** The chunk types of this document, each with the flags that it MUST have. */
const FLAGS_OF = {
  HEAD: 0,
  SKEL: 0,
  MODL: 0,
  SRCE: 0,
  ATTA: 0,
  ALIA: 0,
  CLIP: 0,
  DATA: 0,
  CEND: 0,
  INDX: FLAG_ANCILLARY,
  QUAL: FLAG_ANCILLARY | FLAG_SAFE_TO_COPY,
  REPT: FLAG_ANCILLARY,
  COPY: FLAG_ANCILLARY,
  META: FLAG_ANCILLARY | FLAG_SAFE_TO_COPY,
  RECV: FLAG_ANCILLARY,
};

/**
 * Checks that a file begins with the signature.
 *
 * @throws {Refused}
 */
export function checkSignature(bytes) {
  if (!sameBytes(bytes.subarray(0, SIGNATURE_SIZE), SIGNATURE)) {
    throw new Refused("the file does not begin with the signature of MCZ");
  }
}

/**
 * @typedef {object} Chunk
 * @property {string} type four letters
 * @property {boolean} ancillary INDX is not, for it is a part of the grammar
 * @property {boolean} open an open DATA: its packets follow, `payload` and `end` are null
 * @property {number} offset where the chunk begins in the file
 * @property {Uint8Array | null} payload
 * @property {number} [crc] of a closed chunk
 * @property {number | null} end where the chunk ends, its crc included
 */

/**
 * Reads a chunk. Its checks are in the order in which its bytes may be believed.
 *
 * @param {Uint8Array} bytes the file
 * @param {number} offset where the chunk begins
 * @param {number} payloadLimit bytes of the longest payload
 * @returns {Chunk}
 * @throws {Refused | Unsupported}
 */
export function readChunk(bytes, offset, payloadLimit) {
  const { type, ancillary, open, length, reader } = readHeader(bytes, offset);
  if (open) return { type, ancillary, open, offset, payload: null, end: null };
  within(length, payloadLimit, `bytes of ${type} at ${offset}`);
  const payload = reader.take(length);
  const crcAt = reader.at;
  const crc = reader.u32();
  if (crc !== crc32(bytes, offset, crcAt)) reader.refuse("the crc is wrong");
  if (!ancillary && !(type in FLAGS_OF)) throw new Unsupported(`critical chunks ${type}`);
  return { type, ancillary, open, offset, payload, crc, end: reader.at };
}

/**
 * Reads the header of a chunk.
 *
 * @param {Uint8Array} bytes
 * @param {number} offset where the chunk begins
 * @returns {{type: string, ancillary: boolean, open: boolean, length: number | null,
 *   reader: ByteReader}} `length` of the payload, null of an open DATA; the reader is behind it
 * @throws {Refused}
 */
export function readHeader(bytes, offset) {
  const reader = new ByteReader(bytes, "chunk", offset);
  const type = String.fromCharCode(...reader.take(4));
  if (!/^[A-Za-z]{4}$/.test(type)) reader.refuse("a chunk type is four letters");
  reader.what = `chunk ${type}`;
  const flags = reader.u8();
  const reserved = reader.u8();
  const check = reader.u16();
  const lengthAt = reader.at;
  const allOnes = reader.u32() === ALL_ONES && reader.u32() === ALL_ONES;
  checkHeader(bytes, offset, check, reader);
  if (flags & ~(FLAG_ANCILLARY | FLAG_SAFE_TO_COPY) || reserved !== 0) {
    reader.refuse("reserved bits are set");
  }
  checkFlags(type, flags, reader);
  const ancillary = (flags & FLAG_ANCILLARY) !== 0 && type !== "INDX";
  if (allOnes && type === "DATA") return { type, ancillary, open: true, length: null, reader };
  reader.at = lengthAt;
  return { type, ancillary, open: false, length: reader.u64(), reader };
}

/**
 * A whole chunk of one of the types that have no flags.
 *
 * @param {string} type
 * @param {Uint8Array} payload
 * @returns {Uint8Array}
 */
export function buildChunk(type, payload) {
  const bytes = new Uint8Array(FRAMING_SIZE + payload.length);
  const view = new DataView(bytes.buffer);
  for (let i = 0; i < 4; i++) bytes[i] = type.charCodeAt(i);
  view.setUint32(8, payload.length % 2 ** 32, true);
  view.setUint32(12, Math.floor(payload.length / 2 ** 32), true);
  view.setUint16(6, crc32(bytes, 8, 16, crc32(bytes, 0, 6)) & 0xffff, true);
  bytes.set(payload, HEADER_SIZE);
  const crcAt = HEADER_SIZE + payload.length;
  view.setUint32(crcAt, crc32(bytes, 0, crcAt), true);
  return bytes;
}

/** `header_check`: the CRC-32 of the header without the two bytes of the check itself. */
function checkHeader(bytes, offset, check, reader) {
  const crc = crc32(bytes, offset + 8, offset + 16, crc32(bytes, offset, offset + 6));
  if ((crc & 0xffff) !== check) reader.refuse("the header_check is wrong");
}

function checkFlags(type, flags, reader) {
  if (type in FLAGS_OF && flags !== FLAGS_OF[type]) {
    reader.refuse(`flags ${flags}, which are ${FLAGS_OF[type]} for this type`);
  }
}

/** Whether a chunk, and no FOOT, begins at `offset`. */
export function isChunk(bytes, offset) {
  const first = bytes[offset] & ~0x20;
  return first >= 0x41 && first <= 0x5a;
}

/**
 * Reads a FOOT.
 *
 * @param {Uint8Array} bytes the file
 * @param {number} offset where the FOOT begins
 * @returns {{indexOffset: number, indexLength: number, end: number}}
 * @throws {Refused}
 */
export function readFoot(bytes, offset) {
  const reader = new ByteReader(bytes, "FOOT", offset);
  const flags = reader.u32();
  const crc = reader.u32();
  const indexOffset = reader.u64();
  const indexLength = reader.u64();
  const magic = reader.take(END_MAGIC.length);
  if (!sameBytes(magic, END_MAGIC)) reader.refuse("the end_magic is wrong");
  const found = crc32(bytes, offset + 8, offset + FOOT_SIZE, crc32(bytes, offset, offset + 4));
  if (found !== crc) reader.refuse("the crc is wrong");
  if (flags !== 0) reader.refuse("flags are set");
  return { indexOffset, indexLength, end: reader.at };
}
