// SPEC.md, "Salvage": what a damaged file still holds, with what its copies give back.

import { sameBytes } from "./bytes.js";
import { buildChunk } from "./chunks.js";
import { Rows, readIndex } from "./directory.js";
import { Refused } from "./errors.js";
import { decodedLimit } from "./limits.js";
import { overlaid } from "./overlay.js";
import { Ranges } from "./ranges.js";
import { Scan, placeKey } from "./scan.js";
import { directoryFrom } from "./walked.js";

/**
 * @param {Ranges} ranges
 * @param {number} [limit] bytes that an attachment or template may inflate to
 * @returns {Promise<{ranges: Ranges, directory: import("./directory.js").Directory}>} `ranges` have
 *   the bytes of copies in place of damaged ones; the directory has `damage`
 * @throws {import("./errors.js").MczError} where nothing can be salvaged
 */
export async function salvaged(ranges, limit = decodedLimit(ranges.size)) {
  let scan = new Scan(ranges, limit);
  await scan.run();
  const notes = [];
  let better = ranges;
  if (scan.damage.losses.length > 0) {
    const parts = await partsOf(ranges, scan, notes);
    const isKnown = [...scan.lostSkeletons].some((key) => scan.repeated.has(key));
    if (parts.length > 0) better = new Ranges(overlaid(ranges.source, parts));
    if (parts.length > 0 || isKnown) {
      scan = new Scan(better, limit, scan.repeated);
      await scan.run();
    }
  }
  const owners = scan.hasDoubts ? ownersOf(scan.lastIndex, ranges.size) : new Map();
  if (owners.size > 0) {
    scan = new Scan(better, limit, scan.repeated, owners);
    await scan.run();
  }
  if (scan.sound.length === 0) throw new Refused("nothing can be salvaged: no chunk is whole");
  const damage = [...notes, ...scan.damage.losses];
  return { ranges: better, directory: { ...directoryFrom(scan.file), damage } };
}

/** Whose the segments and CENDs are, as the last index says that is whole. */
function ownersOf(payload, fileBytes) {
  const owners = new Map();
  try {
    const { rows } = payload === null ? { rows: new Rows(0) } : readIndex(payload, fileBytes);
    for (let i = 0; i < rows.length; i++) {
      const { name, end, segments } = rows.at(i);
      for (const { offset, size } of segments()) owners.set(placeKey(offset, size), name);
      owners.set(placeKey(end.offset, end.length), name);
    }
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
  }
  return owners;
}

/** The damaged chunks of which there are copies. */
async function partsOf(ranges, scan, notes) {
  const parts = [];
  for (const { offset, type, payload } of scan.copies) {
    const bytes = buildChunk(type, payload);
    const stop = offset + bytes.length;
    if (sameBytes(await ranges.read(offset, stop), bytes)) continue;
    const use = meets(scan.sound, offset, stop)
      ? "is not used: what lies there is sound"
      : "is used in place of what is damaged";
    const text = `the copy of ${type} at ${offset} ${use}`;
    notes.push({ text, clip: null, signal: null, frames: null, bytes: [offset, stop] });
    if (!meets(scan.sound, offset, stop)) parts.push({ start: offset, bytes });
  }
  return parts;
}

/** Whether something sound has bytes from `start` up to `stop`; `spans` are starts and stops. */
function meets(spans, start, stop) {
  let [low, high] = [0, spans.length / 2];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (spans[2 * middle + 1] <= start) low = middle + 1;
    else high = middle;
  }
  return low < spans.length / 2 && spans[2 * low] < stop;
}
