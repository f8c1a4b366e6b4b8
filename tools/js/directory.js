// SPEC.md, "INDX": what a file holds and where, read from its index. The rows of clips are made
// when they are asked for, since an archive has very many.

import { ByteReader, count, hex, sameBytes, textOf } from "./bytes.js";
import { CRC_SIZE, FRAMING_SIZE } from "./chunks.js";
import { hasMask, newSegment } from "./data.js";
import { Refused } from "./errors.js";
import { TABLES, Table, boundsOf } from "./index-tables.js";
import { inflate } from "./inflate.js";
import { indexLimit, within } from "./limits.js";
import { packetOf } from "./packets.js";
import { payloadIn } from "./ranges.js";

const ID_SIZE = 16;
const CONTINUES = 1;
export const MOST_INDEXES = 8; // that continue each other
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
 *   codec: number, preset: number, codecVersion: number}[]} signals
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
   * @param {(index: number) => string} nameOf
   */
  constructor(length, make, nameOf = (index) => make(index).name) {
    this.length = length;
    this.make = make;
    this.nameOf = nameOf;
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
      for (let i = 0; i < this.length; i++) this.names.set(this.nameOf(i), i);
      if (this.names.size < this.length) throw new Refused("INDX: two clips have the same name");
    }
    return this.names.get(name) ?? -1;
  }
}

/**
 * What an INDX continues, and its content, inflated.
 *
 * @param {Uint8Array} payload
 * @param {number} offset of the chunk
 * @param {number} fileBytes bytes of the whole file
 * @throws {Refused}
 */
export function readOuter(payload, offset, fileBytes) {
  const outer = new ByteReader(payload, "INDX");
  let previous = null;
  if (outer.flags(CONTINUES) & CONTINUES) {
    previous = { offset: outer.varint(), length: outer.varint(), crc: outer.u32() };
    if (previous.length < FRAMING_SIZE || previous.offset + previous.length > offset) {
      outer.refuse("it continues an INDX that does not lie before it");
    }
  }
  const size = outer.varint();
  within(size, indexLimit(fileBytes), "bytes of INDX, inflated");
  return { previous, content: inflate(outer.rest(), size, "INDX") };
}

/**
 * Reads an INDX and those that it continues.
 *
 * @param {(offset: number, length: number) => Promise<Uint8Array>} read
 * @param {number} offset of the INDX
 * @param {number} length bytes of the whole chunk
 * @param {number} fileBytes bytes of the whole file
 * @param {boolean} [lenient] what a damaged one continues is left out
 * @returns {Promise<Directory>}
 * @throws {Refused}
 */
export async function readDirectory(read, offset, length, fileBytes, lenient = false) {
  const found = [];
  let place = { offset, length, crc: null };
  while (place !== null) {
    if (found.length === MOST_INDEXES) throw new Refused("too many INDX continue each other");
    try {
      found.unshift(readListing(await read(place.offset, place.length), place, fileBytes));
    } catch (error) {
      if (!(lenient && found.length > 0 && error instanceof Refused)) throw error;
      break;
    }
    place = found[0].previous;
  }
  return directoryOf(found);
}

function readListing(bytes, { offset, length, crc }, fileBytes) {
  const place = { type: "INDX", offset, length: length - FRAMING_SIZE };
  const payload = payloadIn(bytes, place);
  if (crc !== null && new ByteReader(bytes, "INDX", length - CRC_SIZE).u32() !== crc) {
    throw new Refused(`INDX at ${offset} is not the one that another continues`);
  }
  const { previous, content } = readOuter(payload, offset, fileBytes);
  const reader = new ByteReader(content, "INDX, inflated");
  const start = previous === null ? 0 : previous.offset + previous.length;
  const listing = { previous, start, head: reader.sized() };
  for (const name of ["shared", "attachments", "parts", "aliases"]) {
    listing[name] = new Table(reader, name);
  }
  listing.skeletons = reader.counted(() => hex(reader.take(ID_SIZE)));
  for (const name of ["clips", "signals", "segments"]) listing[name] = new Table(reader, name);
  listing.nBehind = reader.varint();
  listing.ancillary = new Table(reader, "ancillary");
  return listing;
}

/** What these say together, the first one of them first. */
function directoryOf(found) {
  const { head } = found.at(-1);
  const directory = { head, shared: new Map(), attachments: new Map(), aliases: new Map() };
  const clips = new Clips();
  for (const listing of found) {
    if (!sameBytes(listing.head, head)) throw new Refused("two INDX differ in their HEAD");
    addShared(directory.shared, listing);
    addAttachments(directory.attachments, listing);
    addAliases(directory.aliases, listing);
    clips.add(new ClipTables(listing));
  }
  const rows = new Rows(clips.length, (i) => clips.row(i), (i) => clips.name(i));
  if (rows.length <= MOST_NAMED) rows.indexOf("");
  return { ...directory, rows, metadata: clips.chunksOf("META") };
}

function addShared(map, { shared, start }) {
  const places = placesIn(shared, 0, shared.n, start);
  places.forEach((place, i) => {
    const type = shared.typeAt(i);
    add(map, `${type} ${hex(shared.bytes("id", i))}`, { ...place, type });
  });
}

function addAttachments(map, { attachments, parts, start }) {
  const places = placesIn(parts, 0, parts.n, start);
  const bounds = groups(attachments.nParts, parts, "parts");
  for (let i = 0; i < attachments.n; i++) {
    const name = attachments.text("name", i);
    const own = places.slice(bounds[i], bounds[i + 1]);
    if (own.length === 0) throw new Refused(`INDX: attachment ${name} has no part`);
    add(map, name, { name, size: attachments.size[i], parts: own });
  }
}

function addAliases(map, { aliases }) {
  for (let i = 0; i < aliases.n; i++) {
    const name = aliases.text("name", i);
    const of = aliases.of[i];
    if (of > 2) throw new Refused(`INDX: alias ${name} is one of kind ${of}`);
    const bytes = aliases.bytes("target", i);
    add(map, name, { name, of, target: of === 1 ? hex(bytes) : textOf(bytes, "INDX") });
  }
}

function add(map, key, value) {
  if (map.has(key)) throw new Refused(`INDX: two entries are named ${key}`);
  map.set(key, value);
}

/** The chunks `first` to `stop` of a table, the first of them behind `start`. */
function placesIn(table, first, stop, start, type = "ATTA") {
  const places = [];
  let end = start;
  for (let i = first; i < stop; i++) {
    const offset = end + table.gap[i];
    const length = table.length[i];
    end = count(offset + length + FRAMING_SIZE, "offset in INDX");
    places.push({ type, offset, length });
  }
  return places;
}

function groups(counts, table, what) {
  const bounds = boundsOf(counts);
  if (bounds.at(-1) !== table.n) {
    throw new Refused(`INDX: ${what} are not as many as their counts say`);
  }
  return bounds;
}

// Clips

/** The clips that one INDX lists. */
class ClipTables {
  constructor(listing) {
    const { clips, signals, segments, ancillary, skeletons, nBehind, start } = listing;
    Object.assign(this, { clips, signals, segments, ancillary, skeletons, nBehind, start });
    this.signalBounds = groups(clips.nSignals, signals, "signals");
    this.segmentBounds = groups(clips.nSegments, segments, "segments");
    this.ancillaryBounds = groups([nBehind, ...clips.nAncillary], ancillary, "ancillary chunks");
    this.offsets = new Float64Array(clips.n);
    this.ends = new Float64Array(clips.n); // of each CEND
    this.sizes = new Float64Array(clips.n); // of the payloads of the segments
    let end = start;
    for (let i = 0; i < clips.n; i++) {
      this.offsets[i] = end + clips.gap[i];
      end = this.offsets[i] + clips.length[i] + FRAMING_SIZE;
      for (let s = this.segmentBounds[i]; s < this.segmentBounds[i + 1]; s++) {
        end += segments.gap[s] + segments.size[s];
        this.sizes[i] += segments.size[s];
      }
      end = count(end + clips.cendGap[i] + clips.cendLength[i] + FRAMING_SIZE, "offset in INDX");
      this.ends[i] = end;
      this.check(i);
    }
  }

  check(i) {
    const { clips } = this;
    if (clips.skeleton[i] >= this.skeletons.length) throw new Refused("INDX: a clip of no skeleton");
    if (clips.nSignals[i] === 0) throw new Refused("INDX: a clip has no signal");
    if (clips.rateDenominator[i] === 0) throw new Refused("INDX: a clip has a frame rate over 0");
  }

  name(i) {
    return this.clips.text("name", i);
  }

  row(i) {
    const { clips } = this;
    const name = this.name(i);
    if (name === "") throw new Refused("INDX: a clip without a name");
    const length = clips.length[i];
    const place = { type: "CLIP", offset: this.offsets[i], length };
    const cendLength = clips.cendLength[i];
    const offset = this.ends[i] - cendLength - FRAMING_SIZE;
    const signals = this.rowsOf("signals", this.signalBounds, i);
    return {
      name,
      skeletonId: this.skeletons[clips.skeleton[i]],
      nFrames: clips.nFrames[i],
      frameRate: { numerator: clips.rateNumerator[i], denominator: clips.rateDenominator[i] },
      signals,
      place,
      end: { type: "CEND", offset, length: cendLength },
      bytes: this.sizes[i],
      ancillary: this.chunks(i + 1, this.ends[i]),
      segments: () => this.segmentsOf(i, name, signals),
      damage: [],
    };
  }

  rowsOf(table, bounds, i) {
    const fields = Object.keys(TABLES[table]);
    const rows = [];
    for (let at = bounds[i]; at < bounds[i + 1]; at++) {
      rows.push(Object.fromEntries(fields.map((field) => [field, this[table][field][at]])));
    }
    return rows;
  }

  /** The ancillary chunks behind clip `group` - 1, or of group 0 behind the clips before. */
  chunks(group, start) {
    const first = this.ancillaryBounds[group];
    const places = placesIn(this.ancillary, first, this.ancillaryBounds[group + 1], start);
    return places.map((place, i) => ({ ...place, type: this.ancillary.typeAt(first + i) }));
  }

  segmentsOf(i, name, signals) {
    const due = signals.map(() => 0);
    let told = null; // the segment whose mask frames imply
    let stop = this.offsets[i] + this.clips.length[i] + FRAMING_SIZE;
    return this.rowsOf("segments", this.segmentBounds, i).map((row) => {
      const { gap, size, signal: index, nFrames, lead, tail, indexFlags } = row;
      if (index >= signals.length) throw new Refused(`INDX: clip ${name} has no signal ${index}`);
      const { kind: packet, bit } = packetOf(indexFlags);
      const flags = indexFlags - bit;
      const head = { nFrames, lead, tail, firstFrame: due[index], flags };
      const signal = { index, samplesPerFrame: signals[index].samplesPerFrame };
      const offset = stop + gap;
      due[index] += nFrames;
      stop = offset + size;
      const segment = { ...newSegment(signal, head), offset, size, packet, indexFlags };
      if (packet > 1) segment.told = told;
      else if (index === 0) told = packet && hasMask(flags) ? segment : null;
      return segment;
    });
  }
}

/** The clips of several INDX, in file order. */
class Clips {
  constructor() {
    this.length = 0;
    this.parts = []; // tables of clips, and the number of the first
    this.behind = new Map(); // ancillary chunks of a clip that later INDX list
  }

  add(tables) {
    const last = this.length - 1;
    if (tables.nBehind > 0 && last < 0 && tables.start === 0) {
      throw new Refused("INDX: ancillary chunks of a clip before the first");
    }
    if (tables.nBehind > 0 && last >= 0) {
      const chunks = tables.chunks(0, tables.start);
      this.behind.set(last, [...(this.behind.get(last) ?? []), ...chunks]);
    }
    this.parts.push({ first: this.length, tables });
    this.length += tables.clips.n;
  }

  partOf(i) {
    return this.parts.findLast(({ first }) => first <= i);
  }

  name(i) {
    const { first, tables } = this.partOf(i);
    return tables.name(i - first);
  }

  row(i) {
    const { first, tables } = this.partOf(i);
    const row = tables.row(i - first);
    row.ancillary.push(...(this.behind.get(i) ?? []));
    return row;
  }

  /** The ancillary chunks of a type that belong to clips. */
  chunksOf(type) {
    const found = [];
    for (const { tables } of this.parts) {
      let group = 0;
      let last = -1;
      for (let i = 0; i < tables.ancillary.n; i++) {
        if (tables.ancillary.typeAt(i) !== type) continue;
        while (tables.ancillaryBounds[group + 1] <= i) group++;
        if (group === last) continue;
        last = group;
        const start = group === 0 ? tables.start : tables.ends[group - 1];
        found.push(...tables.chunks(group, start).filter((chunk) => chunk.type === type));
      }
    }
    return found;
  }
}
