// SPEC.md, "INDX": the index of a file, compared with the walk through it. Every field of the index
// has one right encoding, so it is enough to encode what the walk has found and to compare bytes.

import { ByteWriter } from "./byte-writer.js";
import { hex, sameBytes } from "./bytes.js";
import { FRAMING_SIZE } from "./chunks.js";
import { MOST_INDEXES, readOuter } from "./directory.js";
import { Refused } from "./errors.js";
import { writeTable } from "./index-tables.js";

const ascii = new TextEncoder();

/** Writes the fields of an index, and remembers where each part begins. */
class IndexWriter extends ByteWriter {
  constructor() {
    super(Infinity, "INDX");
    this.parts = [];
  }

  /** The part that the following bytes are; named where a file has others. */
  part(name) {
    this.parts.push({ at: this.size, name });
  }

  varint(value) {
    const bytes = [];
    let rest = value;
    while (rest >= 128) {
      bytes.push((rest % 128) + 128);
      rest = Math.floor(rest / 128);
    }
    bytes.push(rest);
    this.write(bytes);
  }
}

/**
 * An INDX that was found to be right, and how much it lists together with those before it.
 *
 * @typedef {{offset: number, length: number, crc: number, depth: number, shared: number,
 *   attachments: number, aliases: number, clips: number}} CheckedIndex
 */

/**
 * Checks an INDX against what the walk has found before it.
 *
 * @param {import("./chunks.js").Chunk} chunk
 * @param {object} found the walk: head, shared, attachments, aliases and clips in file order
 * @param {CheckedIndex[]} before those that the walk has passed
 * @param {number} fileBytes bytes of the whole file
 * @returns {CheckedIndex}
 * @throws {Refused}
 */
export function checkIndex({ offset, end, crc, payload }, found, before, fileBytes) {
  const { previous, content } = readOuter(payload, offset, fileBytes);
  let since = { depth: 0, shared: 0, attachments: 0, aliases: 0, clips: 0 };
  let start = 0;
  if (previous !== null) {
    const same = (one) => ["offset", "length", "crc"].every((key) => one[key] === previous[key]);
    since = before.find(same);
    if (!since) throw new Refused(`no INDX at ${previous.offset} is as the one that continues it says`);
    if (since.depth === MOST_INDEXES) throw new Refused("too many INDX continue each other");
    start = previous.offset + previous.length;
  }
  const writer = new IndexWriter();
  writeIndex(writer, found, since, start);
  const expected = writer.content();
  if (!sameBytes(content.subarray(0, expected.length), expected)) {
    let at = 0;
    while (content[at] === expected[at]) at++;
    const part = writer.parts.filter((one) => one.at <= at).pop();
    throw new Refused(`INDX disagrees with the file: ${part.name}`);
  }
  const { shared, attachments, aliases, clips } = found;
  const counts = { shared: shared.length, attachments: attachments.length };
  Object.assign(counts, { aliases: aliases.length, clips: clips.length });
  return { offset, length: end - offset, crc, depth: since.depth + 1, ...counts };
}

function writeIndex(writer, { head, ...found }, since, start) {
  const news = (name) => found[name].slice(since[name]);
  writer.part("HEAD");
  writer.varint(head.length);
  writer.write(head);
  const place = placer(start);
  const shared = news("shared").map((one) => ({ ...place(one), id: one.id }));
  writeTable(writer, "shared", shared);
  const attachments = news("attachments");
  const files = attachments.map(({ name, size, chunks }) => ({ name, size, nParts: chunks.length }));
  writeTable(writer, "attachments", files);
  const chunks = attachments.flatMap((one) => one.chunks.map((part) => ({ type: "ATTA", ...part })));
  writeTable(writer, "parts", chunks.map(placer(start)));
  writeTable(writer, "aliases", news("aliases").map(aliasRow));
  writeClips(writer, news("clips"), found.clips[since.clips - 1], start);
}

/** Makes rows of chunks that lie one behind the other, from `at` on. */
function placer(at) {
  let end = at;
  return ({ type = "", offset, length }) => {
    const gap = offset - end;
    end = offset + length + FRAMING_SIZE;
    return { type: ascii.encode(type), gap, length };
  };
}

function aliasRow({ name, of, target }) {
  const bytes = of === 1 ? target.id : ascii.encode(target.name);
  return { name, of, target: bytes };
}

function writeClips(writer, clips, last, start) {
  const behind = last ? last.ancillary.filter(({ offset }) => offset >= start) : [];
  const ids = [...new Map(clips.map(({ skeleton: { id } }) => [hex(id), id]))];
  const numberOf = new Map(ids.map(([key], index) => [key, index]));
  const ancillary = behind.map(placer(start));
  const segments = [];
  let at = start;
  const rows = clips.map((clip) => {
    const gap = clip.offset - at;
    let stop = clip.offset + clip.payloadSize + FRAMING_SIZE;
    for (const segment of clip.segments) {
      segments.push({ ...segment, gap: segment.offset - stop });
      stop = segment.offset + segment.size;
    }
    at = clip.end.offset + clip.end.length + FRAMING_SIZE;
    ancillary.push(...clip.ancillary.map(placer(at)));
    return {
      name: clip.name,
      skeleton: numberOf.get(hex(clip.skeleton.id)),
      nFrames: clip.nFrames,
      rateNumerator: clip.frameRate.numerator,
      rateDenominator: clip.frameRate.denominator,
      nSignals: clip.signals.length,
      gap,
      length: clip.payloadSize,
      nSegments: clip.segments.length,
      cendGap: clip.end.offset - stop,
      cendLength: clip.end.length,
      nAncillary: clip.ancillary.length,
    };
  });
  const signals = clips.flatMap((clip) =>
    clip.signals.map((signal) => ({ ...signal, nChannels: signal.channels.length })),
  );
  writer.part("skeletons");
  writer.varint(ids.length);
  for (const [, id] of ids) writer.write(id);
  writer.part("clips");
  writeTable(writer, "clips", rows);
  writeTable(writer, "signals", signals);
  writeTable(writer, "segments", segments);
  writer.part("n_behind");
  writer.varint(behind.length);
  writeTable(writer, "ancillary", ancillary);
}
