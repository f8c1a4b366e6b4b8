// SPEC.md, "Salvage": the next place in a damaged file where a chunk or FOOT is whole.

import { FOOT_SIZE, FRAMING_SIZE, HEADER_SIZE, readChunk, readFoot, readHeader } from "./chunks.js";
import { MczError, Unsupported } from "./errors.js";
import { crc32 } from "./crc32.js";

const STRIDE = 1024 * 1024; // bytes that are looked through at once
const LEAST_TRIED = 2 ** 26;
const TRIED_PER_BYTE = 8;
const END_MAGIC_AT = 24; // in a FOOT

/**
 * @param {import("./scan.js").Scan} scan whose bytes are looked through
 * @param {number} start
 * @returns {Promise<number | null>} where it begins, at or behind `start`; null: there is none, or
 *   too much looks like one
 */
export async function resynchronize(scan, start) {
  const { size } = scan.file;
  for (let from = start; from < size; ) {
    const stop = Math.min(size, from + STRIDE);
    // A header may begin in the last bytes and end behind them.
    const bytes = await scan.view(from, Math.min(size, stop + FOOT_SIZE - 1) - from);
    for (const at of candidates(bytes, stop - from)) {
      if (await isWhole(scan, from + at)) return from + at;
    }
    from = stop;
  }
  return null;
}

/** Where the header of a chunk may begin, or a FOOT, before `end`. */
function candidates(bytes, end) {
  const found = [];
  for (let i = 0; i < end; i++) {
    const first = bytes[i] & 0xdf;
    if (first >= 0x41 && first <= 0x5a) {
      if (bytes[i + 5] === 0 && bytes[i + 4] <= 3 && hasHeader(bytes, i)) found.push(i);
    } else if (bytes[i + END_MAGIC_AT] === 0x89 && hasFoot(bytes, i)) {
      found.push(i);
    }
  }
  return found;
}

function hasHeader(bytes, at) {
  if (at + HEADER_SIZE > bytes.length) return false;
  const crc = crc32(bytes, at + 8, at + 16, crc32(bytes, at, at + 6));
  return bytes[at + 6] === (crc & 255) && bytes[at + 7] === ((crc >> 8) & 255);
}

function hasFoot(bytes, at) {
  try {
    readFoot(bytes.subarray(at, at + FOOT_SIZE), 0);
    return true;
  } catch {
    return false;
  }
}

/** Whether what looks like a chunk is one, with its crc. */
async function isWhole(scan, start) {
  try {
    const header = await scan.view(start, 1);
    const first = header[0] & 0xdf;
    if (first < 0x41 || first > 0x5a) return true; // a FOOT, which was checked
    const { open, length } = readHeader(await scan.view(start, HEADER_SIZE), 0);
    if (open) return true;
    scan.tried = (scan.tried ?? 0) + Math.max(256, length);
    if (scan.tried > Math.max(LEAST_TRIED, TRIED_PER_BYTE * scan.file.size)) return false;
    readChunk(await scan.view(start, FRAMING_SIZE + length), 0, scan.file.limits.payloadBytes);
    return true;
  } catch (error) {
    if (error instanceof Unsupported) return true; // whole, and nobody knows what it is
    if (error instanceof MczError) return false;
    throw error;
  }
}
