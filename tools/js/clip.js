// SPEC.md, "CLIP": a clip, its signals, their grids and groups.

import { ByteReader, EXTENDED, count, hex } from "./bytes.js";
import { Refused } from "./errors.js";
import { INTEGER, parseGrid } from "./grids.js";
import { readNeeds } from "./head.js";
import { within } from "./limits.js";
import { checkPlainSignal } from "./plain.js";
import { MOTION, RESIDUALS, TIMES, TIMES_PER_SECOND, checkSourceFormat, isScalar } from "./registry.js";
import { checkPath } from "./shared.js";
import { readChannel } from "./skel.js";
import { readTimeBase } from "./time-base.js";

const FLAG_OPEN = 1;
const FLAG_ROUNDED_RATE = 2;
const FLAG_TIME_BASE = 4;
const FLAG_OWN_CHANNELS = 1;
const ID_SIZE = 16;

const GROUPS_ALL = 0;
const GROUPS_PER_JOINT = 1;
const GROUPS_PER_CHANNEL = 2;
const GROUPS_LISTED = 3;

/**
 * @typedef {object} Clip
 * @property {string} name
 * @property {number} offset of the CLIP chunk
 * @property {number} payloadSize bytes of its payload
 * @property {boolean} open the number of frames is not known before CEND
 * @property {boolean} roundedRate the source states the frame rate rounded
 * @property {import("./skel.js").Skeleton} skeleton
 * @property {number} nFrames frames that are shown; of an open clip 0 until CEND has come
 * @property {{numerator: number, denominator: number}} frameRate numerator 0: unknown
 * @property {import("./time-base.js").TimeBase | null} timeBase
 * @property {Map<string, string>} metadata
 * @property {object | null} source template, format, detail, path, size
 * @property {Signal[]} signals the motion, if any, is the first
 * @property {import("./cend.js").ClipEnd} [end] where CEND was read
 */

/**
 * @typedef {object} Signal
 * @property {string} name
 * @property {number} index in CLIP
 * @property {number} role of the registry; 0: none
 * @property {number | null} of of residuals the index of their signal
 * @property {boolean} ownChannels its channels are not those of the skeleton
 * @property {import("./skel.js").Channel[]} channels
 * @property {number} samplesPerFrame rows a frame
 * @property {number} skip stored frames before the first that is shown
 * @property {number} spare stored frames after the last that is shown
 * @property {{nChannels: number, grid: object}[]} gridRuns
 * @property {boolean} integer has channels, and all grids are INTEGER: its values are i64
 * @property {number} codec id
 * @property {number} preset of the codec, a name alone
 * @property {number} codecVersion
 * @property {Uint8Array} header of the codec
 * @property {number[]} groupSizes channels of each group, in column order
 * @property {number} nResolutions
 * @property {import("./data.js").Segment[]} segments as far as they were read, in frame order
 * @property {number} due the stored frame that the next segment begins with
 * @property {boolean} [mayLack] or with a later one, since the file is damaged
 */

/**
 * @param {Uint8Array} payload of CLIP
 * @param {number} offset of the chunk in the file
 * @param {{head: Uint8Array?, limits: object, clips: Map, skeletons: Map, templates: Map}} file what comes before it
 * @returns {Clip}
 * @throws {Refused}
 */
export function readClip(payload, offset, file) {
  const reader = new ByteReader(payload, "CLIP");
  if (file.head) checkNeeds(payload, file.head);
  readNeeds(reader);
  const name = reader.text();
  if (name === "") reader.refuse("the clip has no name");
  if (file.clips.has(name)) reader.refuse(`a second clip is named ${name}`);
  reader.what = `CLIP ${name}`;
  const flags = reader.flags(FLAG_OPEN | FLAG_ROUNDED_RATE | FLAG_TIME_BASE);
  const open = (flags & FLAG_OPEN) !== 0;
  const skeleton = file.skeletons.get(hex(reader.take(ID_SIZE)));
  if (!skeleton) reader.refuse("its SKEL does not come before it");
  const nFrames = reader.varint();
  if (open && nFrames !== 0) reader.refuse(`an open clip states ${nFrames} frames`);
  const frameRate = { numerator: reader.varint(), denominator: reader.varint() };
  if (frameRate.denominator === 0) reader.refuse("the denominator of the frame rate is 0");
  const timeBase = flags & FLAG_TIME_BASE ? readTimeBase(reader, open) : null;
  const metadata = readMetadata(reader);
  const source = reader.optional(() => readClipSource(reader, file));
  const signals = reader.counted((_, index) => readSignal(reader, index, skeleton, file.limits));
  if (signals.length === 0) reader.refuse("the clip has no signal");
  within(signals.length, file.limits.signals, "signals of a clip");
  if (file.limits.plain) signals.forEach(checkPlainSignal);
  checkRoles(reader, signals, timeBase);
  reader.rest();
  for (const signal of signals) checkStoredFrames(signal, nFrames, open);
  return {
    name,
    offset,
    payloadSize: payload.length,
    open,
    roundedRate: (flags & FLAG_ROUNDED_RATE) !== 0,
    skeleton,
    nFrames,
    frameRate,
    timeBase,
    metadata,
    source,
    signals,
  };
}

/** A clip needs no more than its file says. */
function checkNeeds(payload, head) {
  const more = payload[0] - head[2] || payload[1] - head[3];
  if (more > 0) throw new Refused(`CLIP: it needs version ${payload[0]}.${payload[1]}, HEAD less`);
}

function readMetadata(reader) {
  const metadata = new Map();
  reader.counted(() => {
    const key = reader.text();
    const value = reader.text();
    if (metadata.has(key)) reader.refuse(`the metadata key ${key} occurs twice`);
    metadata.set(key, value);
  });
  return metadata;
}

function readClipSource(reader, file) {
  const flags = reader.flags(EXTENDED);
  const template = file.templates.get(hex(reader.take(ID_SIZE)));
  if (!template) reader.refuse("the SRCE of its source does not come before it");
  const format = reader.u8();
  const detail = reader.sized();
  const path = reader.text();
  const size = reader.varint();
  reader.extension(flags);
  if (path !== "") checkPath(path, reader.what);
  checkSourceFormat(format, template, "clip", reader.what);
  return { template, format, detail, path, size };
}

function checkRoles(reader, signals, timeBase) {
  if (signals.slice(1).some(({ role }) => role === MOTION)) {
    reader.refuse("only the first signal can be a motion");
  }
  const times = signals.filter(({ role }) => role === TIMES);
  if (times.length > 1) reader.refuse("more than one signal of times");
  if (times.length > 0 && (timeBase?.firstTime ?? null) !== null) {
    reader.refuse("both the time of the first frame and a signal of times are given");
  }
  for (const { channels, ownChannels, samplesPerFrame } of times) {
    const isPlain = ownChannels && samplesPerFrame === 1 && channels.length === 1;
    if (!isPlain || !isScalar(channels[0]) || !TIMES_PER_SECOND.has(channels[0].unit)) {
      reader.refuse("times must be one plain scalar a frame, in a unit of time");
    }
  }
  for (const { index, of } of signals) {
    if (of !== null && (of >= signals.length || of === index)) {
      reader.refuse(`residuals of signal ${of}`);
    }
  }
}

function readSignal(reader, index, skeleton, limits) {
  const name = reader.text();
  const flags = reader.flags(FLAG_OWN_CHANNELS | EXTENDED);
  const ownChannels = (flags & FLAG_OWN_CHANNELS) !== 0;
  const role = reader.u8();
  const of = role === RESIDUALS ? reader.varint() : null;
  const channels = ownChannels
    ? reader.counted(() => readChannel(reader, -1))
    : skeleton.channels;
  within(channels.length, limits.channels, "channels of a signal");
  const samplesPerFrame = reader.varint();
  if (samplesPerFrame === 0) reader.refuse("a frame has no rows");
  const skip = reader.varint();
  const spare = reader.varint();
  const gridRuns = readGrids(reader, channels.length);
  const codec = reader.varint();
  const preset = reader.u8();
  const codecVersion = reader.varint();
  const header = reader.sized();
  const groupSizes = readGroups(reader, channels, ownChannels);
  const nResolutions = reader.u8();
  if (nResolutions === 0) reader.refuse("the signal has no resolutions");
  reader.extension(flags);
  return {
    name,
    index,
    role,
    of,
    ownChannels,
    channels,
    samplesPerFrame,
    skip,
    spare,
    gridRuns,
    integer: gridRuns.length > 0 && gridRuns.every(({ grid }) => grid.kind === INTEGER),
    codec,
    preset,
    codecVersion,
    header,
    groupSizes,
    nResolutions,
    segments: [],
    due: 0,
  };
}

function readGrids(reader, total) {
  let found = 0;
  const runs = reader.counted(() => {
    const nChannels = reader.varint();
    const grid = parseGrid(reader);
    if (nChannels === 0) reader.refuse("a run of grids has no channel");
    found += nChannels;
    if (found > total) reader.refuse(`grids of more than ${total} channels`);
    return { nChannels, grid };
  });
  if (found !== total) reader.refuse(`grids of ${found} of ${total} channels`);
  return runs;
}

/** The sizes of the groups: they follow one another in column order. */
function readGroups(reader, channels, ownChannels) {
  const kind = reader.u8();
  switch (kind) {
    case GROUPS_ALL:
      return channels.length > 0 ? [channels.length] : [];
    case GROUPS_PER_JOINT:
      if (ownChannels) reader.refuse("channels are grouped by joint, but belong to no joints");
      return sizesByJoint(channels);
    case GROUPS_PER_CHANNEL:
      return sizesByChannel(channels);
    case GROUPS_LISTED:
      return listedSizes(reader, channels.length);
    default:
      return reader.refuse(`groups of kind ${kind}`);
  }
}

/** Computes something of channels once: many signals may have those of one skeleton. */
function remembered(compute) {
  const results = new WeakMap();
  return (channels) => {
    if (!results.has(channels)) results.set(channels, compute(channels));
    return results.get(channels);
  };
}

const sizesByChannel = remembered((channels) => channels.map(() => 1));
const sizesByJoint = remembered((channels) => {
  const sizes = new Map();
  for (const { joint } of channels) sizes.set(joint, (sizes.get(joint) ?? 0) + 1);
  return [...sizes.values()];
});

function listedSizes(reader, total) {
  let found = 0;
  const sizes = reader.counted(() => {
    const size = reader.varint();
    if (size === 0) reader.refuse("a group has no channels");
    found += size;
    if (found > total) reader.refuse(`groups of more than ${total} channels`);
    return size;
  });
  if (found !== total) reader.refuse(`groups of ${found} of ${total} channels`);
  return sizes;
}

/**
 * The grid of each column. Not kept with the signal: a few bytes may say it of many channels.
 *
 * @param {Signal} signal
 * @returns {object[]}
 */
export function gridsOf(signal) {
  return signal.gridRuns.flatMap(({ nChannels, grid }) => new Array(nChannels).fill(grid));
}

/**
 * The columns of each group.
 *
 * @param {Signal} signal
 * @returns {number[][]}
 */
export function groupsOf(signal) {
  let first = 0;
  return signal.groupSizes.map((size) => {
    first += size;
    return Array.from({ length: size }, (_, i) => first - size + i);
  });
}

function checkStoredFrames(signal, nFrames, open) {
  if (open && (signal.skip !== 0 || signal.spare !== 0)) {
    throw new Refused(`signal ${signal.name}: an open clip with frames that are not shown`);
  }
  const stored = count(signal.skip + nFrames + signal.spare, `stored frames of ${signal.name}`);
  count(stored * signal.samplesPerFrame, `rows of ${signal.name}`);
}
