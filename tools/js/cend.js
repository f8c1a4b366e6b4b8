// SPEC.md, "CEND": the end of a clip, and the hashes of its canonical arrays.

import { ByteReader } from "./bytes.js";
import { Sha256 } from "./sha256.js";
import { readMissing } from "./time-base.js";

const HASH_SIZE = 32;

/**
 * @typedef {object} ClipEnd
 * @property {number} nFrames
 * @property {{frames: number, length: number}[]} missing runs of missing frames of an open clip
 * @property {Uint8Array | null} sourceSha256
 * @property {Uint8Array[]} valueSha256 one a signal
 */

/**
 * Reads CEND and checks that it fits its clip: the frames of CLIP and of the segments.
 *
 * @param {Uint8Array} payload of CEND
 * @param {import("./clip.js").Clip} clip with all its segments
 * @param {boolean} [salvage] the clip may lack segments
 * @returns {ClipEnd}
 * @throws {Refused}
 */
export function readClipEnd(payload, clip, salvage = false) {
  const reader = new ByteReader(payload, `CEND of ${clip.name}`);
  const nFrames = reader.varint();
  const missing = readMissing(reader);
  const sourceSha256 = reader.optional(() => reader.take(HASH_SIZE));
  const valueSha256 = reader.counted(() => reader.take(HASH_SIZE));
  reader.rest();
  if (missing.length > 0 && !clip.open) reader.refuse("missing frames of a clip that is not open");
  if (!salvage) checkFrames(reader, nFrames, clip);
  if ((sourceSha256 !== null) !== (clip.source !== null)) {
    reader.refuse("a source and its hash must be given together");
  }
  if (valueSha256.length !== clip.signals.length) {
    reader.refuse(`${valueSha256.length} hashes of ${clip.signals.length} signals`);
  }
  return { nFrames, missing, sourceSha256, valueSha256 };
}

function checkFrames(reader, nFrames, clip) {
  if (!clip.open && nFrames !== clip.nFrames) {
    reader.refuse(`${nFrames} frames, ${clip.nFrames} in CLIP`);
  }
  for (const { name, skip, spare, due } of clip.signals) {
    if (due !== skip + nFrames + spare) {
      reader.refuse(`${skip} + ${nFrames} + ${spare} frames, ${due} stored of ${name}`);
    }
  }
}

/**
 * Makes every NaN of some values 0x7FF8000000000000, in place.
 *
 * @param {Float64Array} values
 */
export function canonicalNaNs(values) {
  const words = new Uint32Array(values.buffer, values.byteOffset, 2 * values.length);
  for (let i = 0; i < values.length; i++) {
    if (Number.isNaN(values[i])) {
      words[2 * i] = 0;
      words[2 * i + 1] = 0x7ff80000;
    }
  }
}

/** The bytes of a typed array; JavaScript runs on little-endian machines. */
export function bytesOf(array) {
  return new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
}

/**
 * @param {Float64Array | BigInt64Array} values the canonical array
 * @param {Uint8Array | null} mask null where all values are valid
 * @returns {Uint8Array} the value hash
 */
export function valueHash(values, mask) {
  const hash = new Sha256().update(bytesOf(values));
  if (mask) hash.update(mask);
  return hash.digest();
}
