// SPEC.md, "Conventions": an id is of what a chunk says uncompressed.

import { ByteReader, EXTENDED, hex, joined } from "./bytes.js";
import { Sha256 } from "./sha256.js";
import { ENCODING, encodingFlags, readTemplate } from "./shared.js";
import { plainSkeleton } from "./skel.js";

const ID_SIZE = 16;

/**
 * The payload of a SKEL, MODL or SRCE that says the same uncompressed.
 *
 * @param {string} type
 * @param {Uint8Array} payload
 * @param {object} limits of the profile
 * @param {number} limit bytes that a template may inflate to
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function plainPayload(type, payload, limits, limit) {
  if (type === "SKEL") return plainSkeleton(payload, limits);
  if (type !== "SRCE") return payload;
  const { data } = readTemplate(payload, limits, limit);
  const reader = new ByteReader(payload, "SRCE");
  reader.u8();
  const flags = encodingFlags(reader);
  if ((flags & ENCODING) === 0) return payload;
  reader.varint();
  reader.extension(flags);
  const head = payload.slice(0, reader.at);
  head[1] = flags & EXTENDED;
  return joined(head, data);
}

/**
 * @param {string} type
 * @param {Uint8Array} plain the payload, uncompressed
 * @returns {Uint8Array} the id of the chunk
 */
export function plainId(type, plain) {
  const hash = new Sha256();
  hash.update(Uint8Array.from(type, (letter) => letter.charCodeAt(0)));
  hash.update(plain);
  return hash.digest().slice(0, ID_SIZE);
}

/** @returns {string} the id of a chunk with this payload; arguments are those of plainPayload */
export function idOf(type, payload, limits, limit) {
  return hex(plainId(type, plainPayload(type, payload, limits, limit)));
}
