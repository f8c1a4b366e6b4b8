// SPEC.md, "INDX": what a file holds and where, read from its index. The rows of clips are made
// when they are asked for, since an archive has very many.

import { ByteReader, hex, textOf } from "./bytes.js";
import { FRAMING_SIZE } from "./chunks.js";
import { newSegment } from "./data.js";
import { Refused } from "./errors.js";
import { inflate } from "./inflate.js";
import { indexLimit, within } from "./limits.js";
import { packetOf } from "./packets.js";

const ID_SIZE = 16;
const LEAST_CLIP = 31; // bytes of the smallest entry
const NUMBERS_OF_SIGNAL = 6;
const NUMBERS_OF_SEGMENT = 7;
const MOST_NAMED = 2 ** 20; // clips whose names are compared at once, when a file is opened

/**
 * Where a chunk lies.
 *
 * @typedef {{type: string, offset: number, length: number}} Place
 */

/**
 * What an index says of a clip.
 *
 * @typedef {object} ClipRow
 * @property {string} name
 * @property {string} skeletonId in hexadecimal
 * @property {number} nFrames
 * @property {{numerator: number, denominator: number}} frameRate
 * @property {{nChannels: number, samplesPerFrame: number, skip: number, spare: number,
 *   codec: number, codecVersion: number}[]} signals
 * @property {Place} place of CLIP
 * @property {Place | null} end that of CEND
 * @property {number} bytes of the payloads of its segments
 * @property {Place[]} ancillary
 * @property {() => object[]} segments as of data.js, their payloads empty, `packet` the kind of
 *   their packet, 0 of a closed DATA
 */

/**
 * @typedef {object} Directory
 * @property {Uint8Array} head payload of HEAD
 * @property {Map<string, Place>} shared by type and id: "SKEL 0123..."
 * @property {Map<string, {name: string, size: number, parts: Place[]}>} attachments
 * @property {Map<string, {name: string, of: number, target: string}>} aliases `target` is a name,
 *   or an id in hexadecimal
 * @property {Rows} rows of clips
 * @property {Place[]} metadata the META chunks
 */

/** The rows of clips in file order. */
export class Rows {
  /**
   * @param {number} length
   * @param {(index: number) => ClipRow} make
   */
  constructor(length, make) {
    this.length = length;
    this.make = make;
    this.names = null;
  }

  /** @returns {ClipRow | undefined} */
  at(index) {
    return index >= 0 && index < this.length ? this.make(index) : undefined;
  }

  /**
   * @param {string} name
   * @returns {number} the index of the clip; -1 without one
   * @throws {Refused} where two clips have a name
   */
  indexOf(name) {
    if (this.names === null) {
      this.names = new Map();
      for (let i = 0; i < this.length; i++) this.names.set(this.make(i).name, i);
      if (this.names.size < this.length) throw new Refused("INDX: two clips have the same name");
    }
    return this.names.get(name) ?? -1;
  }
}

/**
 * @param {Uint8Array} payload of INDX
 * @param {number} fileBytes bytes of the whole file
 * @returns {Directory}
 * @throws {Refused}
 */
export function readIndex(payload, fileBytes) {
  const outer = new ByteReader(payload, "INDX");
  const size = outer.varint();
  within(size, indexLimit(fileBytes), "bytes of INDX, inflated");
  const reader = new ByteReader(inflate(outer.rest(), size, "INDX"), "INDX, inflated");
  const head = reader.sized();
  const shared = new Map();
  reader.counted(() => readShared(reader, shared));
  const attachments = named(reader, readAttachment);
  const aliases = named(reader, readAlias);
  const { rows, metadata } = readRows(reader);
  if (rows.length <= MOST_NAMED) rows.indexOf("");
  return { head, shared, attachments, aliases, rows, metadata };
}

function readShared(reader, shared) {
  const type = typeOf(reader);
  const key = `${type} ${hex(reader.take(ID_SIZE))}`;
  if (shared.has(key)) reader.refuse(`two entries of ${key}`);
  shared.set(key, placeOf(reader, type));
}

function named(reader, read) {
  const list = new Map();
  reader.counted(() => {
    const entry = read(reader);
    if (list.has(entry.name)) reader.refuse(`two entries are named ${entry.name}`);
    list.set(entry.name, entry);
  });
  return list;
}

function readAttachment(reader) {
  const name = reader.text();
  const size = reader.varint();
  const parts = reader.counted(() => placeOf(reader, "ATTA"));
  if (parts.length === 0) reader.refuse(`attachment ${name} has no part`);
  return { name, size, parts };
}

function readAlias(reader) {
  const name = reader.text();
  const of = reader.u8();
  const target = reader.sized();
  if (of > 2) reader.refuse(`alias ${name} is one of kind ${of}`);
  return { name, of, target: of === 1 ? hex(target) : textOf(target, "INDX") };
}

function typeOf(reader) {
  return String.fromCharCode(...reader.take(4));
}

function placeOf(reader, type) {
  return { type, offset: reader.varint(), length: reader.varint() };
}

// Clips

/** Where each entry begins; all of them are read once, so that none is refused later. */
function readRows(reader) {
  const n = reader.varint();
  if (n > reader.left / LEAST_CLIP) reader.refuse(`${n} clips in ${reader.left} bytes`);
  const starts = new Float64Array(n);
  const metadata = [];
  for (let i = 0; i < n; i++) {
    starts[i] = reader.at;
    for (const place of readRow(reader).ancillary) if (place.type === "META") metadata.push(place);
  }
  const make = (i) => readRow(new ByteReader(reader.bytes, "INDX, inflated", starts[i]));
  return { rows: new Rows(n, make), metadata };
}

function readRow(reader) {
  const name = reader.text();
  if (name === "") reader.refuse("a clip without a name");
  const skeletonId = hex(reader.take(ID_SIZE));
  const nFrames = reader.varint();
  const frameRate = { numerator: reader.varint(), denominator: reader.varint() };
  if (frameRate.denominator === 0) reader.refuse(`clip ${name} has a frame rate over 0`);
  const signals = readSignals(reader, name);
  const place = placeOf(reader, "CLIP");
  const packed = reader.sized();
  const begin = place.offset + place.length + FRAMING_SIZE;
  const { stop, bytes } = extentOf(packed, begin);
  const end = { type: "CEND", offset: stop + reader.varint(), length: reader.varint() };
  const ancillary = reader.counted(() => placeOf(reader, typeOf(reader)));
  const segments = () => unpacked(packed, begin, name, signals);
  const facts = { name, skeletonId, nFrames, frameRate, signals, place, end, bytes };
  return { ...facts, ancillary, segments, damage: [] };
}

function readSignals(reader, name) {
  const n = reader.varint();
  if (n === 0) reader.refuse(`clip ${name} has no signal`);
  if (n > reader.left / NUMBERS_OF_SIGNAL) reader.refuse(`${n} signals in ${reader.left} bytes`);
  return Array.from({ length: n }, () => ({
    nChannels: reader.varint(),
    samplesPerFrame: reader.varint(),
    skip: reader.varint(),
    spare: reader.varint(),
    codec: reader.varint(),
    codecVersion: reader.varint(),
  }));
}

/** Where the last segment ends, and the bytes of all. */
function extentOf(packed, begin) {
  const reader = new ByteReader(packed, "segments of INDX");
  let stop = begin;
  let bytes = 0;
  while (reader.left > 0) {
    stop += reader.varint();
    const size = reader.varint();
    stop += size;
    bytes += size;
    for (let i = 2; i < NUMBERS_OF_SEGMENT; i++) reader.varint();
  }
  return { stop, bytes };
}

function unpacked(packed, begin, name, signals) {
  const reader = new ByteReader(packed, `INDX: segments of clip ${name}`);
  const due = signals.map(() => 0);
  const segments = [];
  let stop = begin;
  while (reader.left > 0) {
    const offset = stop + reader.varint();
    const size = reader.varint();
    const index = reader.varint();
    const numbers = { nFrames: reader.varint(), lead: reader.varint(), tail: reader.varint() };
    const indexFlags = reader.varint();
    if (index >= signals.length) reader.refuse(`a segment of signal ${index}`);
    const { kind: packet, bit } = packetOf(indexFlags);
    const head = { ...numbers, firstFrame: due[index], flags: indexFlags - bit };
    const signal = { index, samplesPerFrame: signals[index].samplesPerFrame };
    segments.push({ ...newSegment(signal, head), offset, size, packet, indexFlags });
    due[index] += numbers.nFrames;
    stop = offset + size;
  }
  return segments;
}
