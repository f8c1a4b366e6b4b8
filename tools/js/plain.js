// SPEC.md, "Limits and profiles": files of the profile small, in which nothing is packed.

import { ByteReader } from "./bytes.js";
import { LimitExceeded } from "./errors.js";
import { PRINTED } from "./grids.js";

const CODECS = new Set([0, 1]); // raw and fast
const ABSENT = new Set(["INDX", "COPY", "MODL"]);
const ENCODING_BITS = 3;
const FLAG_PACKED = 2;
const HASH_SIZE = 32;

/** Throws {@link LimitExceeded} for a chunk that such a file cannot have. */
export function checkPlainChunk({ type, payload }) {
  if (ABSENT.has(type)) throw new LimitExceeded(`${type} in a file of the profile small`);
  const encoded = ["SRCE", "ATTA", "META"].includes(type);
  const reader = new ByteReader(payload, type);
  if (type === "SRCE") reader.skip(1);
  if (type === "SKEL" || type === "ATTA") reader.text();
  if (type === "ATTA") {
    for (let i = 0; i < 3; i++) reader.varint();
    reader.skip(HASH_SIZE);
  }
  const packed = encoded ? ENCODING_BITS : type === "SKEL" ? FLAG_PACKED : 0;
  if (packed && reader.u8() & packed) {
    throw new LimitExceeded(`a packed ${type} in a file of the profile small`);
  }
}

/** The same for a signal. */
export function checkPlainSignal({ codec, gridRuns }) {
  if (!CODECS.has(codec)) throw new LimitExceeded(`codec ${codec} in the profile small`);
  if (gridRuns.some(({ grid }) => grid.kind === PRINTED)) {
    throw new LimitExceeded("grid PRINTED in the profile small");
  }
}
