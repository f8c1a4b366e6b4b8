// SPEC.md, "INDX": the index of a file, compared with the walk through it. Every field of the index
// has one right encoding, so it is enough to encode what the walk has found and to compare bytes.

import { ByteWriter } from "./byte-writer.js";
import { ByteReader, sameBytes } from "./bytes.js";
import { FRAMING_SIZE } from "./chunks.js";
import { Refused } from "./errors.js";
import { inflate } from "./inflate.js";
import { indexLimit, within } from "./limits.js";

const utf8 = new TextEncoder();

/** Writes the fields of an index, and remembers where each entry begins. */
class IndexWriter extends ByteWriter {
  constructor() {
    super(Infinity, "INDX");
    this.entries = [];
  }

  /** The entry that the following fields belong to; named where a file has another one. */
  entry(name) {
    this.entries.push({ at: this.size, name });
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

  sized(bytes) {
    this.varint(bytes.length);
    this.write(bytes);
  }

  text(string) {
    this.sized(utf8.encode(string));
  }

  counted(list, write) {
    this.varint(list.length);
    for (const item of list) write(item);
  }
}

/**
 * Checks an INDX against what the walk has found before it.
 *
 * @param {Uint8Array} payload of INDX
 * @param {object} found the walk: head, shared, attachments, aliases and clips in file order
 * @param {number} fileBytes bytes of the whole file
 * @throws {Refused}
 */
export function checkIndex(payload, found, fileBytes) {
  const reader = new ByteReader(payload, "INDX");
  const size = reader.varint();
  within(size, indexLimit(fileBytes), "bytes of INDX, inflated");
  const index = inflate(reader.rest(), size, "INDX");
  const writer = new IndexWriter();
  writeIndex(writer, found);
  const expected = writer.content();
  if (sameBytes(index.subarray(0, expected.length), expected)) return; // the rest is `extension`
  let at = 0;
  while (index[at] === expected[at]) at++;
  const entry = writer.entries.filter((e) => e.at <= at).pop();
  throw new Refused(`INDX disagrees with the file: ${entry.name}`);
}

function writeIndex(writer, { head, shared, attachments, aliases, clips }) {
  writer.entry("HEAD");
  writer.sized(head);
  writer.entry("shared chunks");
  writer.counted(shared, (chunk) => {
    writer.entry(`${chunk.type} at ${chunk.offset}`);
    writer.ascii(chunk.type);
    writer.write(chunk.id);
    writer.varint(chunk.offset);
    writer.varint(chunk.length);
  });
  writer.entry("attachments");
  writer.counted(attachments, (attachment) => {
    writer.entry(`attachment ${attachment.name}`);
    writer.text(attachment.name);
    writer.varint(attachment.size);
    writer.counted(attachment.chunks, (chunk) => {
      writer.varint(chunk.offset);
      writer.varint(chunk.length);
    });
  });
  writer.entry("aliases");
  writer.counted(aliases, (alias) => writer.write(alias.payload));
  writer.entry("clips");
  writer.counted(clips, (clip) => writeClip(writer, clip));
}

function writeClip(writer, clip) {
  writer.entry(`clip ${clip.name}`);
  writer.text(clip.name);
  writer.write(clip.skeleton.id);
  writer.varint(clip.nFrames);
  writer.varint(clip.frameRate.numerator);
  writer.varint(clip.frameRate.denominator);
  writer.counted(clip.signals, (signal) => {
    writer.varint(signal.channels.length);
    writer.varint(signal.samplesPerFrame);
    writer.varint(signal.skip);
    writer.varint(signal.spare);
    writer.varint(signal.codec);
    writer.varint(signal.codecVersion);
  });
  writer.varint(clip.offset);
  writer.varint(clip.payloadSize);
  writer.entry(`segments of clip ${clip.name}`);
  const segments = new IndexWriter();
  let at = clip.offset + clip.payloadSize + FRAMING_SIZE;
  for (const segment of clip.segments) {
    segments.varint(segment.offset - at);
    segments.varint(segment.size);
    segments.varint(segment.signal);
    segments.varint(segment.nFrames);
    segments.varint(segment.lead);
    segments.varint(segment.tail);
    segments.varint(segment.indexFlags);
    at = segment.offset + segment.size;
  }
  writer.sized(segments.content());
  writer.entry(`CEND of clip ${clip.name}`);
  writer.varint(clip.end.offset - at);
  writer.varint(clip.end.length);
  writer.entry(`ancillary chunks behind clip ${clip.name}`);
  writer.counted(clip.ancillary, (chunk) => {
    writer.ascii(chunk.type);
    writer.varint(chunk.offset);
    writer.varint(chunk.length);
  });
}
