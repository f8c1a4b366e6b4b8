// SPEC.md, "COPY": chunks that stand in the file a second time.

import { ByteReader, sameBytes } from "./bytes.js";
import { FRAMING_SIZE } from "./chunks.js";
import { Refused } from "./errors.js";
import { within } from "./limits.js";
import { decoded, encodingFlags } from "./shared.js";

/** The types of the chunks of which there may be copies. */
export const COPIED = new Set(["HEAD", "SKEL", "MODL", "SRCE", "ALIA", "CLIP", "CEND"]);

/**
 * Compares what a COPY says with the chunks that the walk has found.
 *
 * @param {import("./chunks.js").Chunk} chunk the COPY
 * @param {Map<number, import("./chunks.js").Chunk>} before chunks of {@link COPIED}, by offset
 * @param {number} fileBytes bytes of the whole file
 * @throws {Refused}
 */
export function checkCopies(chunk, before, fileBytes) {
  for (const { offset, type, payload } of copiesIn(chunk, fileBytes)) {
    const there = before.get(offset);
    if (!there || there.type !== type || !sameBytes(there.payload, payload)) {
      throw new Refused(`COPY at ${chunk.offset}: no ${type} at ${offset} is as its copy says`);
    }
  }
}

/**
 * What a COPY says, in file order.
 *
 * @param {import("./chunks.js").Chunk} chunk the COPY
 * @param {number} limit bytes of all copies
 * @returns {{offset: number, type: string, payload: Uint8Array}[]} where each chunk begins
 * @throws {Refused}
 */
export function copiesIn({ offset, payload }, limit) {
  const reader = new ByteReader(readContent(payload, limit), "COPY, decoded");
  const copies = [];
  let end = 0; // of the chunk that was copied last
  while (reader.left > 0) {
    const start = offset - reader.varint();
    const type = String.fromCharCode(...reader.take(4));
    const copy = reader.sized();
    if (!COPIED.has(type)) reader.refuse(`a copy of a chunk ${type}`);
    const stop = start + FRAMING_SIZE + copy.length;
    if (start < end || stop > offset) reader.refuse(`a copy of ${type} at ${start} out of order`);
    end = stop;
    copies.push({ offset: start, type, payload: copy });
  }
  return copies;
}

function readContent(payload, limit) {
  const reader = new ByteReader(payload, "COPY");
  const flags = encodingFlags(reader);
  const size = reader.varint();
  reader.extension(flags);
  within(size, limit, "bytes of copies");
  return decoded(flags, reader.rest(), size, "COPY");
}
