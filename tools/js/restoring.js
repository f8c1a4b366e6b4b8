// SPEC.md, "Salvage": what can be put right in a damaged file, from its copies and from checks.

import { ByteReader, sameBytes } from "./bytes.js";
import { CRC_SIZE, FRAMING_SIZE, HEADER_SIZE, buildChunk, readHeader } from "./chunks.js";
import { crc32 } from "./crc32.js";
import { Refused } from "./errors.js";
import { within } from "./limits.js";
import { Packets } from "./packets.js";
import { MOST_CHUNK, MOST_OF_PACKET, chunkKey } from "./scan.js";

const MOST_READ = 4; // times the bytes of the file, in search of a bit

/**
 * @param {import("./ranges.js").Ranges} ranges
 * @param {import("./scan.js").Scan} scan that has gone through them
 * @param {import("./damage.js").Loss[]} notes what is put right, and what is not, is added
 * @returns {Promise<{start: number, bytes: Uint8Array}[]>} bytes that are known better; they do not
 *   overlap
 */
export async function restored(ranges, scan, notes) {
  const parts = await copiedParts(ranges, scan, notes);
  parts.push(...(await mendedHeaders(ranges, scan)));
  parts.sort((a, b) => a.start - b.start);
  let end = 0;
  return parts.filter(({ start, bytes, text }) => {
    if (start < end) return false;
    end = start + bytes.length;
    note(notes, text, start, end);
    return true;
  });
}

function note(notes, text, start, stop) {
  notes.push({ text, clip: null, signal: null, frames: null, bytes: [start, stop] });
}

/** The damaged chunks of which there are copies. */
async function copiedParts(ranges, scan, notes) {
  const parts = [];
  for (const { type, bytes, said, shift } of placed(scan)) {
    const start = said + (shift ?? 0);
    const stop = start + bytes.length;
    if (start < 0 || stop > ranges.size) continue;
    const copy = `the copy of ${type} at ${start}`;
    if (shift === null) {
      note(notes, `${copy} is not used: where it belongs is not clear`, start, stop);
    } else if (!sameBytes(await ranges.read(start, stop), bytes)) {
      const header = await ranges.read(start, start + HEADER_SIZE);
      if (meets(scan.sound, start, stop) || (await isWhole(ranges, start, header, scan))) {
        note(notes, `${copy} is not used: what lies there is sound`, start, stop);
      } else {
        parts.push({ start, bytes, text: `${copy} is used in place of what is damaged` });
      }
    }
  }
  return parts;
}

/**
 * The copies, where each says that its chunk lies, and how far from there that is. Bytes that were
 * put in or cut out before a COPY shift all that it says. Copied chunks that are whole tell it, for
 * the damaged ones between them, too: `shift` is null where those around one do not agree.
 */
function placed({ copies, places }) {
  const list = copies.map(({ offset: said, type, payload }) => {
    const bytes = buildChunk(type, payload);
    const offset = nearest(places.get(chunkKey(type, bytes)) ?? [], said);
    return { type, bytes, said, own: offset === null ? null : offset - said };
  });
  const own = list.map((copy) => copy.own);
  const before = carried(own);
  const behind = carried([...own].reverse()).reverse();
  return list.map((copy, i) => {
    const around = new Set([before[i], behind[i]].filter((shift) => shift !== null));
    const [only = 0] = around;
    return { ...copy, shift: copy.own ?? (around.size > 1 ? null : only) };
  });
}

/** The number of an ascending list that is nearest to another one, null where it is empty. */
function nearest(list, number) {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle] < number) low = middle + 1;
    else high = middle;
  }
  const [below, above] = [list[low - 1] ?? -Infinity, list[low] ?? Infinity];
  if (list.length === 0) return null;
  return number - below <= above - number ? below : above;
}

/** Each number, or the last one before it where it is null. */
function carried(numbers) {
  let last = null;
  return numbers.map((number) => (last = number ?? last));
}

/** The headers of which one bit is wrong: with that turned, all checks of the chunk hold. */
async function mendedHeaders(ranges, scan) {
  const parts = [];
  let left = MOST_READ * ranges.size;
  for (const start of scan.badHeaders) {
    if (start + HEADER_SIZE > ranges.size) continue;
    const given = await ranges.read(start, start + HEADER_SIZE);
    for (const bytes of withOneBitTurned(given)) {
      const size = sizeOf(bytes);
      if (size === 0) continue;
      left -= size;
      if (left < 0) return parts;
      if (!(await isWhole(ranges, start, bytes, scan))) continue;
      const text = `a header at ${start} has one wrong bit, which is put right`;
      parts.push({ start, bytes, text });
      break;
    }
  }
  return parts;
}

function* withOneBitTurned(given) {
  for (let bit = 0; bit < 8 * given.length; bit++) {
    const bytes = given.slice();
    bytes[bit >> 3] ^= 1 << (bit & 7);
    yield bytes;
  }
}

/** Bytes to read of what a header begins, 0 where it is none; what a COPY says comes too late. */
function sizeOf(header) {
  try {
    const { type, open, length } = readHeader(header, 0);
    if (type === "COPY") return 0;
    return open ? HEADER_SIZE : FRAMING_SIZE + length;
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return 0;
  }
}

/** Whether a chunk with this header is whole; of an open DATA the first packet tells. */
async function isWhole(ranges, offset, header, { file: { limits } }) {
  const start = offset + HEADER_SIZE;
  try {
    const { open, length } = readHeader(header, 0);
    if (open) {
      const stop = Math.min(ranges.size, start + limits.packetBytes + MOST_OF_PACKET);
      const reader = new ByteReader(await ranges.read(start, stop), "packet");
      return new Packets(limits).read(reader).kind !== 0;
    }
    within(length, MOST_CHUNK, `bytes of the chunk at ${offset}`);
    const rest = await ranges.read(start, start + length + CRC_SIZE);
    return new ByteReader(rest, "crc", length).u32() === crc32(rest, 0, length, crc32(header));
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return false;
  }
}

/** Whether one of the spans has bytes from `start` up to `stop`; they are starts and stops. */
function meets(spans, start, stop) {
  let [low, high] = [0, spans.length / 2];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (spans[2 * middle + 1] <= start) low = middle + 1;
    else high = middle;
  }
  return low < spans.length / 2 && spans[2 * low] < stop;
}
