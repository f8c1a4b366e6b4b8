// SPEC.md, "Salvage": what a damaged file still holds, with what its copies give back.

import { readDirectory } from "./directory.js";
import { MczError, Refused } from "./errors.js";
import { BASE_HEAD, readHead } from "./head.js";
import { decodedLimit } from "./limits.js";
import { overlaid } from "./overlay.js";
import { Ranges } from "./ranges.js";
import { restored } from "./restoring.js";
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
    const parts = await restored(ranges, scan, notes);
    const isKnown = [...scan.lostSkeletons].some((key) => scan.repeated.has(key));
    if (parts.length > 0) better = new Ranges(overlaid(ranges.source, parts));
    if (parts.length > 0 || isKnown) {
      scan = new Scan(better, limit, scan.repeated);
      await scan.run();
    }
  }
  const listed = scan.damage.losses.length > 0 ? await indexIn(scan.lastIndex, better) : null;
  const owners = scan.hasDoubts && listed !== null ? ownersOf(listed) : new Map();
  if (owners.size > 0) {
    scan = new Scan(better, limit, scan.repeated, owners);
    await scan.run();
  }
  if (scan.sound.length === 0) throw new Refused("nothing can be salvaged: no chunk is whole");
  const directory = directoryFrom(scan.file);
  for (const text of fromIndex(directory, listed)) scan.damage.add(text);
  const damage = [...notes, ...scan.damage.losses];
  return { ranges: better, directory: { ...directory, damage } };
}

/** What the last index says that is whole, and those that it continues; null without one. */
async function indexIn(index, ranges) {
  if (index === null) return null;
  const { offset, end } = index;
  const read = (at, length) => ranges.read(at, at + length);
  try {
    return await readDirectory(read, offset, end - offset, ranges.size, true);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return null;
  }
}

/** Whose the segments and CENDs are, as an index says. */
function ownersOf({ rows }) {
  const owners = new Map();
  try {
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

/** Gives a directory the HEAD and the aliases that are lost; yields what was. */
function* fromIndex(directory, listed) {
  if (directory.head === null && listed !== null && isHead(listed.head)) {
    directory.head = listed.head;
    yield "the file has no HEAD; it is taken from the index";
  }
  if (directory.head === null) {
    directory.head = BASE_HEAD;
    yield "the file has no HEAD; it is read as one of this version";
  }
  for (const [name, alias] of listed?.aliases ?? []) {
    if (directory.aliases.has(name)) continue;
    directory.aliases.set(name, alias);
    yield `the alias ${name} is lost; it is taken from the index`;
  }
}

function isHead(payload) {
  try {
    readHead(payload);
    return true;
  } catch (error) {
    if (!(error instanceof MczError)) throw error;
    return false;
  }
}
