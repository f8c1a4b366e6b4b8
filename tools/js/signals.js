// SPEC.md, "DATA" and "CEND": the rows of a signal, whole or in part, from its segments.

import { hex, sameBytes } from "./bytes.js";
import { canonicalNaNs, valueHash } from "./cend.js";
import { gridsOf, groupsOf } from "./clip.js";
import { findCodec } from "./codecs.js";
import { readGroupNotes, readMasks, takeStreams } from "./data.js";
import { Refused } from "./errors.js";
import { checkColumn, columnValues } from "./grids.js";
import { decodedBytes, profile, within } from "./limits.js";
import { TIMES } from "./registry.js";

/** Bytes that are decoded beside what is wanted: the rest of the first and of the last segment. */
const MOST_BESIDE = 2 * profile(0).segmentBytes;

/**
 * @typedef {object} DecodedSignal
 * @property {import("./clip.js").Signal} signal
 * @property {object[]} grids of CLIP, one a column
 * @property {number} nRows
 * @property {number} nChannels
 * @property {Float64Array | BigInt64Array} values rows x channels, row after row; i64 where all
 *   grids are INTEGER
 * @property {BigInt64Array | null} ordinals the same of ordinals; null where the codec has none
 * @property {Uint8Array | null} mask the same, 1 valid, 0 invalid; null: all are valid
 * @property {Part[]} parts the segments that the rows are of
 */

/**
 * The rows that a segment has in what was decoded.
 *
 * @typedef {object} Part
 * @property {number} firstRow of the decoded rows
 * @property {number} nRows
 * @property {number} skippedRows rows of the segment before firstRow that were not asked for
 * @property {number} segmentRows all rows of the segment
 * @property {object[]} grids of this segment, one a column
 * @property {{row: number, column: number, text: Uint8Array, value: number}[]} exceptions of these
 *   rows; `row` is one of the decoded rows
 * @property {Uint8Array} frameNotes of the whole segment
 * @property {object} segment with its streams
 */

/**
 * Decodes frames of a signal.
 *
 * @param {import("./clip.js").Clip} clip as {@link readFile} has read it
 * @param {import("./clip.js").Signal} signal of it
 * @param {{from: number, to: number, dropped: number, room: import("./limits.js").Room}}
 *   request frames of the clip from <= f < to; how many of the finest details are left out; where
 *   they go
 * @returns {DecodedSignal}
 * @throws {Refused | Unsupported}
 */
export function decodeSignal(clip, signal, { from, to, dropped, room }) {
  const opened = openSignal(clip, signal);
  const needed = segmentsOf(opened, { from, to, dropped, room });
  return decodeSegments(opened, needed, { from, to, dropped });
}

/**
 * A signal whose header was read.
 *
 * @typedef {{clip: object, signal: object, layout: object, decoder: object}} OpenSignal
 */

/**
 * @param {import("./clip.js").Clip} clip
 * @param {import("./clip.js").Signal} signal of it
 * @returns {OpenSignal} checked as far as it can be without streams
 * @throws {Refused | Unsupported}
 */
export function openSignal(clip, signal) {
  const layout = signalLayout(clip, signal);
  return { clip, signal, layout, decoder: openDecoder(signal, layout) };
}

/**
 * The segments that frames are decoded from.
 *
 * @param {OpenSignal} opened
 * @param {{from: number, to: number, dropped: number, room: object}} request as of
 *   {@link decodeSignal}
 * @returns {import("./data.js").Segment[]}
 * @throws {Refused}
 */
export function segmentsOf({ signal, decoder }, { from, to, dropped, room }) {
  if (dropped >= signal.nResolutions) {
    throw new Refused(`signal ${signal.name}: ${dropped} of ${signal.nResolutions} resolutions`);
  }
  const wanted = { from: signal.skip + from, to: signal.skip + to };
  takeRoom(wanted, signal, room);
  return neededSegments(signal.segments, wanted, decoder.alone === true);
}

/**
 * Decodes frames from segments that have their payloads.
 *
 * @param {OpenSignal} opened
 * @param {import("./data.js").Segment[]} needed those of {@link segmentsOf}
 * @param {{from: number, to: number, dropped: number}} request
 * @returns {DecodedSignal}
 * @throws {Refused | Unsupported}
 */
export function decodeSegments({ clip, signal, layout, decoder }, needed, { from, to, dropped }) {
  const wanted = { from: signal.skip + from, to: signal.skip + to };
  const segments = needed.map((segment) => withStreams(segment, signal, dropped));
  const decoded = segments.length > 0 ? decoder.decode(segments, { dropped, ...wanted }) : null;

  const parts = partsOf(segments, wanted, layout);
  const isOrdinals = decoder.decodes === "ordinals";
  const rows = decoded
    ? wantedRows(decoded, segments, wanted, layout)
    : new (isOrdinals ? BigInt64Array : Float64Array)(0);
  if (decoder.exactColumns?.length > 0 && decoded) {
    const ordinals = decoder.ordinals(segments, { dropped });
    const exact = wantedRows(ordinals, segments, wanted, layout);
    setColumns(rows, exact, decoder.exactColumns, parts, layout.channels.length);
  }
  const out = {
    signal,
    grids: layout.grids,
    nRows: (to - from) * signal.samplesPerFrame,
    nChannels: signal.channels.length,
    values: isOrdinals ? valuesOf(rows, parts, layout) : withExceptions(rows, parts, layout),
    ordinals: isOrdinals ? rows : null,
    mask: maskOf(parts, rows.length, layout),
    parts,
  };
  if (!signal.integer) canonicalNaNs(out.values);
  const whole = from === 0 && to === clip.nFrames && dropped === 0;
  if (whole && clip.end) checkHash(out, clip.end.valueSha256[signal.index]);
  if (signal.role === TIMES) checkTimes(out);
  return out;
}

/** The decoder of a signal, which has checked all that it can without its streams. */
function openDecoder(signal, layout) {
  const decoder = findCodec(signal).open(signal.header, layout);
  if (signal.integer && decoder.decodes !== "ordinals") {
    throw new Refused(`signal ${signal.name}: integers of a codec of values`);
  }
  if (signal.role === TIMES && decoder.decodes !== "ordinals") {
    throw new Refused(`signal ${signal.name}: times of a lossy codec`);
  }
  decoder.check?.(signal.segments);
  return decoder;
}

/** The frames that are wanted, and the rest of the segments that they lie in. */
function takeRoom({ from, to }, signal, room) {
  const nChannels = signal.channels.length;
  const size = decodedBytes((to - from) * signal.samplesPerFrame, nChannels);
  within(size, room.limit, `decoded bytes of signal ${signal.name}`);
  room.take(size);
  const overlapping = signal.segments.filter((segment) => overlaps(segment, { from, to }));
  const nRows = overlapping.reduce((sum, segment) => sum + segment.nRows, 0);
  const most = room.limit + MOST_BESIDE;
  within(decodedBytes(nRows, nChannels), most, `bytes of the segments of signal ${signal.name}`);
}

function overlaps({ firstFrame, nFrames }, { from, to }) {
  return firstFrame < to && from < firstFrame + nFrames;
}

/** What a codec is told of a signal. */
function signalLayout(clip, signal) {
  return {
    name: signal.name,
    channels: signal.channels,
    skeleton: signal.ownChannels ? null : clip.skeleton,
    groups: groupsOf(signal),
    grids: gridsOf(signal),
    integer: signal.integer,
    nResolutions: signal.nResolutions,
    samplesPerFrame: signal.samplesPerFrame,
    findModel: (id) => clip.findModel(hex(id)),
  };
}

/**
 * The segments that affect some stored frames, as one run, and those before it back to one that
 * starts fresh. Where each segment stands alone, those that have the frames.
 */
function neededSegments(segments, { from, to }, alone) {
  if (from === to) return [];
  if (alone) return segments.filter((segment) => overlaps(segment, { from, to }));
  const bears = ({ firstFrame, nFrames, lead, tail }) =>
    firstFrame - lead < to && from < firstFrame + nFrames + tail;
  let first = segments.findIndex(bears);
  const last = segments.findLastIndex(bears);
  while (!segments[first].fresh) first--;
  return segments.slice(first, last + 1);
}

/** A segment with its streams, but those of the finest resolutions. */
function withStreams(segment, signal, dropped) {
  const { streams, ...others } = takeStreams(segment, signal);
  const kept = streams.length - dropped;
  return { ...segment, ...others, streams: streams.map((of, r) => (r < kept ? of : null)) };
}

/** The parts that the segments have in the wanted frames, with their notes. */
function partsOf(segments, { from, to }, layout) {
  const { samplesPerFrame } = layout;
  const parts = [];
  for (const segment of segments) {
    const start = Math.max(segment.firstFrame, from);
    const end = Math.min(segment.firstFrame + segment.nFrames, to);
    if (start >= end) continue;
    const part = {
      firstRow: (start - from) * samplesPerFrame,
      nRows: (end - start) * samplesPerFrame,
      skippedRows: (start - segment.firstFrame) * samplesPerFrame,
      segmentRows: segment.nRows,
      frameNotes: segment.frameNotes,
      segment,
    };
    const { grids, exceptions } = readGroupNotes(segment, layout);
    parts.push({ ...part, grids, exceptions: exceptionsOf(part, exceptions) });
  }
  return parts;
}

/** The exceptions in the rows of a part, which are counted from the first wanted row. */
function exceptionsOf({ firstRow, nRows, skippedRows }, exceptions) {
  return exceptions
    .filter(({ row }) => row >= skippedRows && row < skippedRows + nRows)
    .map((exception) => ({ ...exception, row: exception.row - skippedRows + firstRow }));
}

/** Cuts the wanted rows out of what the codec has decoded: these alone, or whole segments. */
function wantedRows(decoded, segments, { from, to }, { channels, samplesPerFrame }) {
  const size = (to - from) * samplesPerFrame * channels.length;
  if (decoded.length === size) return decoded;
  const start = (from - segments[0].firstFrame) * samplesPerFrame * channels.length;
  return decoded.slice(start, start + size);
}

/** The values of ordinals, by the grids of their segments, and of exceptions. */
function valuesOf(ordinals, parts, layout) {
  const { integer, channels } = layout;
  const values = integer ? ordinals : new Float64Array(ordinals.length);
  const nChannels = channels.length;
  for (const { firstRow, nRows, grids } of parts) {
    for (let column = 0; column < nChannels; column++) {
      const first = firstRow * nChannels + column;
      if (integer) checkColumn(grids[column], ordinals, first, nChannels, nRows);
      else columnValues(grids[column], ordinals, values, first, nChannels, nRows);
    }
  }
  return withExceptions(values, parts, layout);
}

/** Sets the values of the exact channels of a codec of values: those of their ordinals. */
function setColumns(values, ordinals, columns, parts, nChannels) {
  for (const { firstRow, nRows, grids } of parts) {
    for (const column of columns) {
      columnValues(grids[column], ordinals, values, firstRow * nChannels + column, nChannels, nRows);
    }
  }
}

/** Sets the values of exceptions, which are those of their tokens. */
function withExceptions(values, parts, { channels }) {
  for (const { exceptions } of parts) {
    for (const { row, column, value } of exceptions) values[row * channels.length + column] = value;
  }
  return values;
}

/** The mask of the wanted rows; null where all values are valid. */
function maskOf(parts, size, layout) {
  if (parts.every(({ segment }) => segment.masks.length === 0)) return null;
  const nChannels = layout.channels.length;
  const mask = new Uint8Array(size).fill(1);
  for (const { segment, firstRow, nRows, skippedRows } of parts) {
    const ofSegment = new Uint8Array(segment.nRows * nChannels).fill(1);
    readMasks(segment, layout, ofSegment);
    const start = skippedRows * nChannels;
    mask.set(ofSegment.subarray(start, start + nRows * nChannels), firstRow * nChannels);
  }
  return mask.includes(0) ? mask : null;
}

function checkTimes({ signal, values, mask }) {
  const times = Float64Array.from(values, (value, row) => (mask?.[row] === 0 ? NaN : Number(value)));
  const isFault = (time, row) => !Number.isFinite(time) || (row > 0 && time < times[row - 1]);
  const row = times.findIndex(isFault);
  if (row >= 0) throw new Refused(`signal ${signal.name}: no time in row ${row}`);
}

function checkHash({ signal, values, mask }, expected) {
  if (!sameBytes(valueHash(values, mask), expected)) {
    throw new Refused(`signal ${signal.name}: the value hash is wrong`);
  }
}

/**
 * Some columns of a decoded signal, for a request of joints.
 *
 * @param {DecodedSignal} decoded
 * @param {number[]} columns
 * @returns {{signal: object, nRows: number, nChannels: number, values: object, mask: object}}
 */
export function takeColumns({ signal, nRows, nChannels, values, mask }, columns) {
  const take = (array) => {
    const out = new array.constructor(nRows * columns.length);
    columns.forEach((column, first) => {
      let from = column;
      for (let to = first; to < out.length; to += columns.length, from += nChannels) {
        out[to] = array[from];
      }
    });
    return out;
  };
  const takenMask = mask && take(mask);
  return { signal, nRows, nChannels: columns.length, values: take(values), mask: takenMask };
}
