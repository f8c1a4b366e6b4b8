// SPEC.md, "Shared chunks": SRCE, MODL, ATTA, ALIA and paths.

import { ByteReader, EXTENDED, hex, sameBytes, textOf } from "./bytes.js";
import { Refused } from "./errors.js";
import { inflate } from "./inflate.js";
import { within } from "./limits.js";
import { Sha256 } from "./sha256.js";
import { inflateAfterWords } from "./words.js";

export const ENCODING = 3; // mask of the bits of flags: 0 stored
const RAW_DEFLATE = 1;
const AFTER_WORDS = 2;

/**
 * Reads the flags of SRCE, ATTA, COPY or META.
 *
 * @param {ByteReader} reader
 * @returns {number}
 * @throws {Refused}
 */
export function encodingFlags(reader) {
  const flags = reader.flags(ENCODING | EXTENDED);
  if ((flags & ENCODING) > AFTER_WORDS) reader.refuse(`encoding ${flags & ENCODING}`);
  return flags;
}

/** Decodes the `data` of SRCE, ATTA, COPY and META. */
export function decoded(flags, data, size, what) {
  const encoding = flags & ENCODING;
  if (encoding === RAW_DEFLATE) return inflate(data, size, what);
  if (encoding === AFTER_WORDS) return inflateAfterWords(data, size, what);
  if (data.length !== size) throw new Refused(`${what}: ${data.length} bytes, not ${size}`);
  return data;
}

/**
 * @param {Uint8Array} payload of SRCE
 * @param {object} limits of the profile
 * @param {number} limit bytes that it may inflate to
 * @returns {{format: number, data: Uint8Array}} the template
 * @throws {Refused}
 */
export function readTemplate(payload, limits, limit) {
  const reader = new ByteReader(payload, "SRCE");
  const format = reader.u8();
  const flags = encodingFlags(reader);
  const size = reader.varint();
  reader.extension(flags);
  within(size, Math.min(limits.templateBytes, limit), "bytes of a template");
  return { format, data: decoded(flags, reader.rest(), size, "SRCE") };
}

/**
 * @param {Uint8Array} payload of MODL
 * @returns {{kind: number, data: Uint8Array}}
 * @throws {Refused}
 */
export function readModel(payload) {
  const reader = new ByteReader(payload, "MODL");
  const flags = reader.flags(EXTENDED);
  const kind = reader.varint();
  reader.extension(flags);
  return { kind, data: reader.rest() };
}

/** An attached file, put together from its ATTA chunks, which follow one another. */
export class Attachment {
  /**
   * @param {Uint8Array} payload of its first ATTA
   * @param {number} limit bytes that it may inflate to
   * @throws {Refused}
   */
  constructor(payload, limit) {
    const first = readPart(payload);
    checkPath(first.name, "ATTA");
    this.name = first.name;
    this.nParts = first.nParts;
    this.size = first.size;
    this.sha256 = first.sha256;
    this.limit = limit;
    this.parts = [];
    this.found = 0;
    this.hash = new Sha256();
    this.add(payload);
  }

  get complete() {
    return this.parts.length === this.nParts;
  }

  /**
   * Adds the next part; the last one is told by the hash of them all.
   *
   * @param {Uint8Array} payload of the next ATTA
   * @throws {Refused}
   */
  add(payload) {
    const part = readPart(payload);
    if (part.part !== this.parts.length) {
      this.refuse(`part ${part.part} where part ${this.parts.length} is expected`);
    }
    if (!this.hasPart(part)) this.refuse("its parts do not agree");
    within(this.found + part.partSize, this.limit, `bytes of attachment ${this.name}`);
    const bytes = decoded(part.flags, part.data, part.partSize, `ATTA ${this.name}`);
    this.found += bytes.length;
    this.hash.update(bytes);
    // What inflates to more is inflated anew when it is asked for.
    this.parts.push({ flags: part.flags, data: part.data, size: part.partSize });
    if (!this.complete) return;
    if (this.found !== this.size) this.refuse(`${this.found} bytes, not the stated ${this.size}`);
    if (!sameBytes(this.hash.digest(), this.sha256)) this.refuse("the hash is wrong");
  }

  hasPart(part) {
    return (
      part.name === this.name &&
      part.nParts === this.nParts &&
      part.size === this.size &&
      sameBytes(part.sha256, this.sha256)
    );
  }

  /** @returns {Uint8Array} the file */
  content() {
    const out = new Uint8Array(this.size);
    let at = 0;
    for (const part of this.parts) {
      out.set(decoded(part.flags, part.data, part.size, `ATTA ${this.name}`), at);
      at += part.size;
    }
    return out;
  }

  refuse(message) {
    throw new Refused(`attachment ${this.name}: ${message}`);
  }
}

function readPart(payload) {
  const reader = new ByteReader(payload, "ATTA");
  const name = reader.text();
  const part = reader.varint();
  const nParts = reader.varint();
  const size = reader.varint();
  const sha256 = reader.take(32);
  const flags = encodingFlags(reader);
  const partSize = reader.varint();
  reader.extension(flags);
  const data = reader.rest();
  if (nParts < 1) reader.refuse("a file has no parts");
  return { name, part, nParts, size, sha256, flags, partSize, data };
}

export const ALIAS_OF = { CLIP: 0, SKELETON: 1, ATTACHMENT: 2 };

/**
 * @param {Uint8Array} payload of ALIA
 * @param {{clips: Map, skeletons: Map, attachments: Map}} file what comes before it, by name or id
 * @returns {{name: string, of: number, target: object}} a path, and what has its content
 * @throws {Refused}
 */
export function readAlias(payload, file) {
  const reader = new ByteReader(payload, "ALIA");
  const name = reader.text();
  const of = reader.u8();
  const bytes = reader.sized();
  reader.rest();
  checkPath(name, "ALIA");
  const target = aliasTarget(of, bytes, file);
  if (!target) throw new Refused(`ALIA ${name}: its target does not come before it`);
  if (of !== ALIAS_OF.ATTACHMENT && !target.source) {
    throw new Refused(`ALIA ${name}: its target has no source`);
  }
  return { name, of, target };
}

function aliasTarget(of, bytes, file) {
  if (of === ALIAS_OF.CLIP) return file.clips.get(textOf(bytes, "ALIA"));
  if (of === ALIAS_OF.SKELETON) return file.skeletons.get(hex(bytes));
  if (of === ALIAS_OF.ATTACHMENT) return file.attachments.get(textOf(bytes, "ALIA"));
  throw new Refused(`ALIA: a copy of kind ${of}`);
}

/**
 * Checks a path of "Paths".
 *
 * @param {string} path
 * @param {string} what named in messages
 * @throws {Refused}
 */
export function checkPath(path, what) {
  const parts = path.split("/");
  const plain = parts.every((part) => part !== "" && part !== "." && part !== "..");
  if (!plain || parts[0].includes(":") || path.includes("\\") || path.includes("\0")) {
    throw new Refused(`${what}: ${JSON.stringify(path)} is no plain relative path`);
  }
}
