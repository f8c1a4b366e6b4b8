// SPEC.md, "META": what is said of clips behind them.

import { ByteReader } from "./bytes.js";
import { indexLimit, within } from "./limits.js";
import { decoded, encodingFlags } from "./shared.js";

/** Keys that belong to the values and the source of a clip: nothing behind it may say them. */
const INTERPRETED = new Set(["name-encoding", "skeleton-note", "source-note"]);

/**
 * The records of a META.
 *
 * @param {Uint8Array} payload
 * @param {number} fileBytes bytes of the whole file
 * @returns {{name: string, removed: string[], entries: Map<string, string>}[]}
 * @throws {import("./errors.js").Refused}
 */
export function readRecords(payload, fileBytes) {
  const outer = new ByteReader(payload, "META");
  const flags = encodingFlags(outer);
  const size = outer.varint();
  outer.extension(flags);
  within(size, indexLimit(fileBytes), "bytes of metadata");
  const reader = new ByteReader(decoded(flags, outer.rest(), size, "META"), "META, decoded");
  const records = [];
  while (reader.left > 0) records.push(readRecord(reader));
  return records;
}

function readRecord(reader) {
  const name = reader.text();
  const removed = [];
  const entries = new Map();
  reader.counted(() => {
    const key = checked(reader, reader.text());
    if (removed.includes(key)) reader.refuse(`${key} is removed twice`);
    removed.push(key);
  });
  reader.counted(() => {
    const key = checked(reader, reader.text());
    const value = reader.text();
    if (entries.has(key)) reader.refuse(`${key} is set twice`);
    entries.set(key, value);
  });
  return { name, removed, entries };
}

function checked(reader, key) {
  if (INTERPRETED.has(key)) reader.refuse(`${key} must not follow a clip`);
  return key;
}

/**
 * Changes `pairs`, the metadata of a clip or of the file, by a record.
 *
 * @param {Map<string, string>} pairs
 * @param {{removed: string[], entries: Map<string, string>}} record
 */
export function apply(pairs, { removed, entries }) {
  for (const key of removed) pairs.delete(key);
  for (const [key, value] of entries) pairs.set(key, value);
}
