// SPEC.md, "COPY": chunks that stand in the file a second time.

import { ByteReader, sameBytes } from "./bytes.js";
import { FRAMING_SIZE } from "./chunks.js";
import { within } from "./limits.js";
import { decoded } from "./shared.js";

/** The types of the chunks of which there may be copies. */
export const COPIED = new Set(["HEAD", "SKEL", "MODL", "SRCE", "ALIA", "CLIP", "CEND"]);

/**
 * Compares what a COPY says with the chunks that the walk has found.
 *
 * @param {import("./chunks.js").Chunk} chunk the COPY
 * @param {Map<number, import("./chunks.js").Chunk>} before chunks of {@link COPIED}, by offset
 * @param {number} fileBytes bytes of the whole file
 * @throws {import("./errors.js").Refused}
 */
export function checkCopies({ offset, payload }, before, fileBytes) {
  const content = readContent(payload, fileBytes);
  const reader = new ByteReader(content, "COPY, decoded");
  let end = 0; // of the chunk that was copied last
  while (reader.left > 0) {
    const start = offset - reader.varint();
    const type = String.fromCharCode(...reader.take(4));
    const copy = reader.sized();
    if (!COPIED.has(type)) reader.refuse(`a copy of a chunk ${type}`);
    const stop = start + FRAMING_SIZE + copy.length;
    if (start < end || stop > offset) reader.refuse(`a copy of ${type} at ${start} out of order`);
    const chunk = before.get(start);
    if (!chunk || chunk.type !== type || !sameBytes(chunk.payload, copy)) {
      reader.refuse(`no ${type} at ${start} is as its copy says`);
    }
    end = stop;
  }
}

function readContent(payload, fileBytes) {
  const reader = new ByteReader(payload, "COPY");
  const encoding = reader.u8();
  const size = reader.varint();
  within(size, fileBytes, "bytes of copies");
  return decoded(encoding, reader.rest(), size, "COPY");
}
