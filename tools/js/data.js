// SPEC.md, "DATA": segments with their stream table, group notes and masks.

import { ByteReader, EXTENDED, count } from "./bytes.js";
import { crc32 } from "./crc32.js";
import { Refused } from "./errors.js";
import { INTEGER, hasText, parseGrid } from "./grids.js";
import { decodedBytes, within } from "./limits.js";
import { tokenValue } from "./text.js";

const FLAG_FRESH = 1;
const FLAG_FRAME_NOTES = 2;
const FLAG_GROUP_NOTES = 4;
const FLAG_MASKS = 8;
const NOTHING = new Uint8Array(0);

/**
 * @typedef {object} Segment
 * @property {number} signal index in CLIP
 * @property {number} firstFrame stored frame
 * @property {number} nFrames
 * @property {number} nRows
 * @property {number} lead frames before firstFrame that it affects
 * @property {number} tail frames behind its last that it affects
 * @property {number} flags as in DATA
 * @property {boolean} fresh needs no segment before it
 * @property {Uint8Array} payload of DATA or of its packet
 * @property {number | null} tableAt where `present` begins in it; null where it is all one stream
 * @property {Uint8Array | null} mask that a packet of kind 2 implies
 * @property {number} offset of its bytes in the file, for INDX
 * @property {number} size of these, for INDX
 * @property {number} indexFlags of INDX: the flags, and the kind of its packet
 */

/**
 * Reads a segment with its table.
 *
 * @param {Uint8Array} payload of a closed DATA, or the body of a packet of kind 1
 * @param {import("./clip.js").Clip} clip
 * @param {object} limits of the profile
 * @returns {Segment}
 * @throws {Refused}
 */
export function readSegment(payload, clip, limits) {
  const reader = new ByteReader(payload, `DATA of ${clip.name}`);
  const { signal: index, ...fields } = segmentFields(reader);
  if (index >= clip.signals.length) reader.refuse(`signal ${index} of ${clip.signals.length}`);
  const signal = clip.signals[index];
  const segment = newSegment(signal, fields);
  if (segment.flags & FLAG_FRAME_NOTES && !(index === 0 && clip.source)) {
    reader.refuse("frame notes, but no source that they could be of");
  }
  checkSegment(segment, signal, limits);
  segment.payload = payload;
  segment.tableAt = reader.at;
  const lengths = readTable(reader, nStreams(segment.flags, signal));
  reader.extension(segment.flags);
  const crc = crc32(payload, 0, reader.at);
  if (reader.u32() !== crc) reader.refuse("the table_crc is wrong");
  for (const length of lengths) reader.skip(length);
  reader.end();
  return segment;
}

/** The fields of a segment before its table. */
export function segmentFields(reader) {
  const signal = reader.varint();
  const firstFrame = reader.varint();
  const nFrames = reader.varint();
  const lead = reader.varint();
  const tail = reader.varint();
  const known = FLAG_FRESH | FLAG_FRAME_NOTES | FLAG_GROUP_NOTES | FLAG_MASKS | EXTENDED;
  const flags = reader.flags(known);
  return { signal, firstFrame, nFrames, lead, tail, flags };
}

/** A segment without its bytes. */
export function newSegment(signal, { firstFrame, nFrames, lead, tail, flags }) {
  return {
    signal: signal.index,
    firstFrame,
    nFrames,
    nRows: nFrames * signal.samplesPerFrame,
    lead,
    tail,
    flags,
    fresh: (flags & FLAG_FRESH) !== 0,
    payload: NOTHING,
    tableAt: null,
    mask: null,
    offset: 0,
    size: 0,
    indexFlags: flags,
  };
}

/**
 * The segment that a packet of kind 2 stands for.
 *
 * @param {{body: Uint8Array, fresh: boolean, number: number, mask: Uint8Array | null}} frame
 * @param {import("./clip.js").Signal} signal that 0 of its clip
 * @param {object} limits of the profile
 * @returns {Segment}
 * @throws {Refused}
 */
export function frameSegment({ body, fresh, number, mask }, signal, limits) {
  if (signal.groupSizes.length !== 1 || signal.nResolutions !== 1) {
    throw new Refused("a frame of a signal with other than one group and one resolution");
  }
  const flags = (fresh ? FLAG_FRESH : 0) | (mask ? FLAG_MASKS : 0);
  const head = { firstFrame: number, nFrames: 1, lead: 0, tail: 0, flags };
  const segment = newSegment(signal, head);
  checkSegment(segment, signal, limits);
  segment.indexFlags = flags & FLAG_FRESH;
  segment.payload = body;
  segment.mask = mask;
  return segment;
}

/** Whether frames behind a segment in a packet, which has these flags, imply a mask. */
export function hasMask(flags) {
  return (flags & FLAG_MASKS) !== 0;
}

/**
 * The mask that frames behind a segment in a packet imply.
 *
 * @param {Uint8Array} payload the segment
 * @returns {Uint8Array | null} null: they have none
 * @throws {Refused} where it has the masks of several frames
 */
export function impliedMask(payload) {
  const reader = new ByteReader(payload, "segment");
  const { nFrames, flags } = segmentFields(reader);
  if (!hasMask(flags)) return null;
  if (nFrames !== 1) reader.refuse("a frame implies the masks of several");
  const one = { groupSizes: [1], nResolutions: 1 };
  return takeStreams({ payload, tableAt: reader.at, flags, mask: null }, one).masks[0];
}

/** What a segment's frames and size have to be. */
function checkSegment(segment, signal, limits) {
  const { firstFrame, nFrames, nRows, lead, tail } = segment;
  const what = `segment at frame ${firstFrame} of ${signal.name}`;
  if (nFrames === 0) throw new Refused(`${what}: no frames`);
  const isDue = firstFrame === signal.due || (signal.mayLack && firstFrame > signal.due);
  if (!isDue) throw new Refused(`${what}: the segment must begin with frame ${signal.due}`);
  if (lead > firstFrame) throw new Refused(`${what}: a lead of ${lead}`);
  if (firstFrame === 0 && !segment.fresh) throw new Refused(`${what}: it does not start fresh`);
  count(firstFrame + nFrames + tail, `${what}: its end`);
  count((firstFrame + nFrames) * signal.samplesPerFrame, `${what}: its rows`);
  within(decodedBytes(nRows, signal.channels.length), limits.segmentBytes, `${what}: its bytes`);
  within(nRows, limits.rows, `${what}: its rows`);
  within(limits.plain ? segment.flags & FLAG_GROUP_NOTES : 0, 0, `${what}: group notes`);
}

function nStreams(flags, signal) {
  const nGroups = signal.groupSizes.length;
  return (
    (flags & FLAG_FRAME_NOTES ? 1 : 0) +
    (flags & FLAG_GROUP_NOTES ? nGroups : 0) +
    (flags & FLAG_MASKS ? nGroups : 0) +
    signal.nResolutions * nGroups
  );
}

/** The stream table between the flags and table_crc: the bytes of each stream. */
function readTable(reader, n) {
  const present = reader.take(Math.ceil(n / 8));
  if (n % 8 !== 0 && present[present.length - 1] >> n % 8 !== 0) {
    reader.refuse("streams are present beyond the last");
  }
  const lengths = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    if ((present[i >> 3] >> (i & 7)) % 2 === 0) continue;
    lengths[i] = reader.varint();
    if (lengths[i] === 0) reader.refuse(`stream ${i} is present and empty`);
  }
  return lengths;
}

/**
 * The streams of a segment. They are taken when they are decoded: a file may have many more of
 * them than bytes.
 *
 * @param {Segment} segment
 * @param {import("./clip.js").Signal} signal
 * @returns {{frameNotes: Uint8Array, groupNotes: Uint8Array[], masks: Uint8Array[],
 *   streams: Uint8Array[][]}} notes and masks one a group, or none; the streams of the codec by
 *   resolution, the coarsest first, then by group
 */
export function takeStreams({ payload, tableAt, flags, mask }, signal) {
  if (tableAt === null) {
    return { frameNotes: NOTHING, groupNotes: [], masks: mask ? [mask] : [], streams: [[payload]] };
  }
  const reader = new ByteReader(payload, "DATA", tableAt);
  const lengths = readTable(reader, nStreams(flags, signal));
  reader.extension(flags);
  reader.u32();
  let next = 0;
  const take = () => {
    const length = lengths[next++];
    return length === 0 ? NOTHING : reader.take(length);
  };
  const ofGroups = () => signal.groupSizes.map(take);
  const frameNotes = flags & FLAG_FRAME_NOTES ? take() : NOTHING;
  const groupNotes = flags & FLAG_GROUP_NOTES ? ofGroups() : [];
  const masks = flags & FLAG_MASKS ? ofGroups() : [];
  const streams = Array.from({ length: signal.nResolutions }, ofGroups);
  return { frameNotes, groupNotes, masks, streams };
}

/**
 * Puts a segment behind those of its signal that came before.
 *
 * @param {import("./clip.js").Signal} signal
 * @param {Segment} segment
 */
export function addSegment(signal, segment) {
  signal.segments.push(segment);
  signal.due = segment.firstFrame + segment.nFrames;
}

/**
 * @typedef {object} Exception
 * @property {number} row of the segment
 * @property {number} column of the signal
 * @property {Uint8Array} text the token
 * @property {number} value
 */

/**
 * The group notes of a segment.
 *
 * @param {Segment & {groupNotes: Uint8Array[]}} segment with its streams
 * @param {{name: string, integer: boolean, grids: object[], groups: number[][]}} signal with the
 *   grid of each column and the columns of each group
 * @returns {{grids: object[], exceptions: Exception[]}} the grid of each column in this segment,
 *   and the exceptions group by group
 * @throws {Refused}
 */
export function readGroupNotes(segment, signal) {
  const notes = { grids: signal.grids, exceptions: [] };
  segment.groupNotes.forEach((bytes, group) => {
    if (bytes.length === 0) return;
    const reader = new ByteReader(bytes, `group notes of ${signal.name}`);
    const columns = signal.groups[group];
    readGridChanges(reader, columns, signal, notes);
    readExceptions(reader, columns, segment.nRows, notes);
    reader.end();
  });
  return notes;
}

function readGridChanges(reader, columns, signal, notes) {
  let last = -1;
  reader.counted(() => {
    const channel = reader.varint();
    if (channel >= columns.length) reader.refuse(`a grid of channel ${channel} of the group`);
    if (channel <= last) reader.refuse("grid changes do not ascend");
    const grid = parseGrid(reader);
    if (signal.integer && grid.kind !== INTEGER) {
      reader.refuse("another grid in a signal of integers");
    }
    if (notes.grids === signal.grids) notes.grids = [...signal.grids];
    notes.grids[columns[channel]] = grid;
    last = channel;
  });
}

function readExceptions(reader, columns, nRows, notes) {
  let row = 0;
  let last = -1;
  reader.counted(() => {
    const step = reader.varint();
    const channel = reader.varint();
    const text = reader.sized();
    row += step;
    if (row >= nRows) reader.refuse(`an exception in row ${row} of ${nRows}`);
    if (channel >= columns.length) reader.refuse(`an exception in channel ${channel}`);
    if (step === 0 && channel <= last) reader.refuse("exceptions do not ascend");
    last = channel;
    const column = columns[channel];
    if (!hasText(notes.grids[column])) reader.refuse("an exception on a grid without text");
    notes.exceptions.push({ row, column, text, value: tokenValue(text) });
  });
}

/**
 * Writes the masks of a segment.
 *
 * @param {Segment & {masks: Uint8Array[]}} segment with its streams
 * @param {{name: string, channels: object[], groups: number[][]}} signal
 * @param {Uint8Array} mask of the rows of the segment, row after row; all 1 before
 * @throws {Refused}
 */
export function readMasks(segment, signal, mask) {
  segment.masks.forEach((bytes, group) => {
    if (bytes.length === 0) return;
    const reader = new ByteReader(bytes, `mask of ${signal.name}`);
    readMask(reader, signal.groups[group], segment.nRows, signal.channels.length, mask);
  });
}

/** Runs of valid and of invalid values by turns, column after column. */
function readMask(reader, columns, nRows, nChannels, mask) {
  const total = columns.length * nRows;
  let at = 0;
  let valid = true;
  while (at < total) {
    const run = reader.varint();
    if (run === 0 && !(valid && at === 0)) reader.refuse("a run of no values");
    if (run > total - at) reader.refuse(`runs of more than ${total} values`);
    if (!valid) {
      for (let i = at; i < at + run; i++) {
        mask[(i % nRows) * nChannels + columns[Math.floor(i / nRows)]] = 0;
      }
    }
    at += run;
    valid = !valid;
  }
  reader.end();
}
