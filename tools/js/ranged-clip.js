// A clip of a file that is read by ranges: what it is, and its frames as they are asked for.

import { readClipEnd } from "./cend.js";
import { readClip } from "./clip.js";
import { codecLabel } from "./codecs.js";
import { addSegment, takeStreams } from "./data.js";
import { joined, runsOf, runsWithin } from "./decoded-runs.js";
import { Refused } from "./errors.js";
import { Room, decodedBytes } from "./limits.js";
import { loadSegments } from "./loading.js";
import { lostFrames, storedFrames } from "./losses.js";
import { guardedLater } from "./memory.js";
import { supplied } from "./missing.js";
import { readQuality } from "./qual.js";
import { c3dRecording } from "./recording.js";
import { isC3d, sourceFormatLabel } from "./registry.js";
import { salvageSignal } from "./salvaged-signal.js";
import { decodeSegments, openSignal, segmentsOf, takeColumns } from "./signals.js";
import { restoreClip } from "./sources.js";
import { frameNumbers } from "./time-base.js";
import { timesOf } from "./times.js";

const AHEAD = 64 * 1024; // bytes of segments that come with CLIP where requests cost
const AXES = [null, "x", "y", "z", "-x", "-y", "-z"];
const HANDS = [null, "right", "left"];
const LENGTH_UNITS = { 0.1: "mm", 1: "cm", 10: "dm", 100: "m", 2.54: "in", 30.48: "ft" };

/**
 * Opens a clip.
 *
 * @param {import("./open.js").MczFile} file
 * @param {number} index of the clip
 * @param {import("./directory.js").ClipRow} row
 * @returns {Promise<RangedClip>}
 * @throws {Refused | Unsupported}
 */
export async function openClip(file, index, row) {
  const { place } = row;
  const ahead = place.offset + place.length + AHEAD;
  const payload = await file.ranges.payload(place, file.limits.payloadBytes, ahead);
  const clip = await supplied(() => readClip(payload, place.offset, file.shared));
  if (!file.salvage) compare(clip, row);
  clip.declared = clip.nFrames;
  clip.nFrames = row.nFrames;
  clip.findModel = file.shared.modelFinder(place.offset);
  for (const segment of row.segments()) addSegment(clip.signals[segment.signal], segment);
  if (clip.open && row.end !== null) clip.end = await readEnd(file, row, clip);
  clip.numbers = numbersOf(clip, file.salvage);
  return new RangedClip(file, index, row, clip);
}

async function readEnd(file, { end }, clip) {
  const payload = await file.ranges.payload(end, file.limits.payloadBytes);
  return readClipEnd(payload, clip, file.salvage);
}

function numbersOf(clip, salvage) {
  try {
    return frameNumbers(clip);
  } catch (error) {
    if (!salvage) throw error;
    return [{ frame: 0, number: 1n }]; // they may speak of frames that are lost
  }
}

function compare(clip, row) {
  const same =
    clip.name === row.name &&
    (clip.open || clip.nFrames === row.nFrames) &&
    clip.frameRate.numerator === row.frameRate.numerator &&
    clip.frameRate.denominator === row.frameRate.denominator &&
    clip.signals.length === row.signals.length &&
    clip.signals.every((signal, s) => sameSignal(signal, row.signals[s]));
  if (!same) throw new Refused(`clip ${row.name}: CLIP is not as the index says`);
}

function sameSignal(signal, listed) {
  const fields = ["samplesPerFrame", "skip", "spare", "codec", "preset", "codecVersion"];
  const sameChannels = signal.channels.length === listed.nChannels;
  return sameChannels && fields.every((field) => signal[field] === listed[field]);
}

/**
 * @typedef {object} SignalFacts
 * @property {string} name
 * @property {number} index
 * @property {number} role of SPEC.md's registry; 0: none
 * @property {number | null} of of residuals the index of their signal
 * @property {string} codec
 * @property {number} nChannels
 * @property {import("./skel.js").Channel[]} channels with names, kinds and units
 * @property {string[]} units of the channels, each once
 * @property {{nChannels: number, grid: string}[]} grids in column order
 * @property {boolean} integer the values are i64
 * @property {boolean} ownChannels they are not those of the skeleton
 * @property {number} samplesPerFrame
 * @property {number} nResolutions
 * @property {number} nGroups
 * @property {number} bytes of its segments
 */

export class RangedClip {
  constructor(file, index, row, clip) {
    this.file = file;
    this.row = row;
    this.clip = clip;
    this.opened = new Map(); // signals whose headers were read
    this.cut = new Map(); // signals in runs
    this.chains = new Map(); // of a damaged file: signals with a part of their segments
    this.index = index;
    this.name = clip.name;
    this.nFrames = clip.nFrames;
    this.frameRate = clip.frameRate;
    this.rate = rateOf(clip.frameRate);
    this.roundedRate = clip.roundedRate;
    this.skeleton = clip.skeleton;
    this.skeletonId = row.skeletonId;
    this.upAxis = AXES[clip.skeleton.upAxis];
    this.forwardAxis = AXES[clip.skeleton.forwardAxis];
    this.handedness = HANDS[clip.skeleton.handedness];
    this.unitCm = clip.skeleton.unitCm;
    this.lengthUnit = LENGTH_UNITS[clip.skeleton.unitCm] ?? null;
    this.firstFrame = Number(clip.numbers[0].number);
    this.frameNumbers = clip.numbers;
    /** The time of the first frame in seconds; null where its number and the rate tell it. */
    this.firstTime = clip.timeBase?.firstTime ?? null;
    /** What is said in CLIP; `file.metadata(i)` has also what is said behind it. */
    this.metadata = clip.metadata;
    const { source } = clip;
    this.origin = source && {
      path: source.path,
      format: sourceFormatLabel(source.format),
      size: source.size,
    };
    /** @type {SignalFacts[]} */
    this.signals = clip.signals.map(factsOf);
  }

  /**
   * The segments of a signal in the order of their frames, which are counted as stored: the clip
   * shows those from `skip` of the signal on.
   *
   * @param {string | number} [signal] name or index
   * @returns {{firstFrame: number, nFrames: number, offset: number, bytes: number,
   *   fresh: boolean}[]} `firstFrame` counts from the first that the clip shows
   */
  segments(signal = 0) {
    const { segments, skip } = this.signal(signal);
    return segments.map(({ firstFrame, nFrames, offset, size, fresh }) => {
      return { firstFrame: firstFrame - skip, nFrames, offset, bytes: size, fresh };
    });
  }

  /**
   * Decodes frames of a signal. What is needed for them is fetched and checked, and no more.
   *
   * @param {object} [request]
   * @param {[number, number]} [request.frames] frames a <= f < b; all without
   * @param {number} [request.resolution] without so many of the finest details
   * @param {number[]} [request.joints] the columns of these joints in this order
   * @param {string | number} [request.signal] name or index; the motion without
   * @returns {Promise<{name: string, nRows: number, nChannels: number,
   *   values: Float64Array | BigInt64Array, mask: Uint8Array | null, lost: [number, number][]}>}
   *   rows x channels, row after row; mask 1 valid, 0 invalid, null: all are valid; `lost` are the
   *   frames that a damaged file does not have any more
   * @throws {import("./errors.js").MczError}
   */
  async read(request = {}) {
    return guardedLater(() => this.readRows(request));
  }

  async readRows({ frames, resolution = 0, joints, signal: wanted = 0 }) {
    const signal = this.signal(wanted);
    const [from, to] = this.range(frames);
    if (!isCount(resolution)) throw new Refused(`resolution ${resolution}`);
    const columns = joints && this.columnsOf(signal, joints);
    const decoded = await this.decode(signal, { from, to, dropped: resolution });
    const { nRows, nChannels, values, mask } = columns ? takeColumns(decoded, columns) : decoded;
    const anyInvalid = mask !== null && mask.includes(0);
    return {
      name: signal.name,
      nRows,
      nChannels,
      values,
      mask: anyInvalid ? mask : null,
      lost: decoded.lost ?? [],
    };
  }

  /**
   * The file that the clip was made of, byte for byte where its codecs are lossless.
   *
   * @returns {Promise<Uint8Array | null>} null where the clip has no source
   * @throws {import("./errors.js").MczError}
   */
  async source() {
    return guardedLater(() => this.restore());
  }

  async restore() {
    const { clip } = this;
    if (clip.source === null) return null;
    await this.file.shared.loadTemplate(clip.source, "clip");
    const { sourceSha256 } = await this.end();
    if (clip.signals.some((of) => lostFrames(of.segments, this.stored(of)).length > 0)) {
      throw new Refused(`clip ${this.name} has lost frames, and its source with them`);
    }
    const signals = [];
    for (const signal of clip.signals) {
      signals.push(await this.decodeStrictly(signal, { from: 0, to: clip.nFrames, dropped: 0 }));
    }
    const { numbers } = clip;
    const maxBytes = this.file.decodedLimit;
    return restoreClip({ clip, signals, numbers, sourceSha256, maxBytes });
  }

  /**
   * What the source of the clip, a C3D, says beside its numbers: events, names, units, scales.
   *
   * @returns {Promise<import("./recording.js").Recording | null>} null where it is no C3D
   * @throws {import("./errors.js").MczError}
   */
  async recording() {
    const { source } = this.clip;
    if (!source || !isC3d(source.format)) return null;
    await this.file.shared.loadTemplate(source, "clip");
    return c3dRecording(source, this.rate);
  }

  /**
   * The times of all frames, in seconds on the clock of the recording (SPEC.md, "Time").
   *
   * @returns {Promise<Float64Array | null>} null where neither times nor a rate are known
   * @throws {import("./errors.js").MczError}
   */
  async times() {
    return guardedLater(() => timesOf(this));
  }

  /**
   * The quality record of the clip.
   *
   * @returns {Promise<{key: string, value: string}[] | null>} null where it has none
   * @throws {Refused}
   */
  async quality() {
    const place = this.row.ancillary.find(({ type }) => type === "QUAL");
    if (place === undefined) return null;
    return readQuality(await this.file.ranges.payload(place, this.file.limits.payloadBytes));
  }

  /**
   * The bytes of the streams of some frames, which are read for it.
   *
   * @param {{frames?: [number, number], signal?: string | number}} [request]
   * @returns {Promise<{firstFrame: number, nFrames: number, bytes: number, notes: number,
   *   masks: number, groups: number[], resolutions: number[]}[]>} of each segment: bytes of its
   *   notes and masks, and those of its codec by group, and by resolution, the coarsest first
   */
  async streamSizes({ frames, signal: wanted = 0 } = {}) {
    const signal = this.signal(wanted);
    const [from, to] = this.range(frames).map((frame) => frame + signal.skip);
    const overlapping = signal.segments.filter(
      ({ firstFrame, nFrames }) => firstFrame < to && from < firstFrame + nFrames,
    );
    const loaded = await loadSegments(this.file, this.clip, signal, overlapping);
    return loaded.map((segment) => sizesOf(segment, signal));
  }

  // What these need

  signal(wanted) {
    const { signals } = this.clip;
    const signal =
      typeof wanted === "number" ? signals[wanted] : signals.find(({ name }) => name === wanted);
    if (!signal) throw new Refused(`clip ${this.name}: no signal ${wanted}`);
    return signal;
  }

  range(frames) {
    const [from, to] = frames ?? [0, this.nFrames];
    if (isCount(from) && isCount(to) && from <= to && to <= this.nFrames) return [from, to];
    throw new Refused(`frames ${from} to ${to} of ${this.nFrames} of clip ${this.name}`);
  }

  columnsOf(signal, joints) {
    if (signal.ownChannels) throw new Refused(`signal ${signal.name} has no channels of joints`);
    return joints.flatMap((index) => {
      const joint = this.skeleton.joints[index];
      if (!joint) throw new Refused(`no joint ${index} of ${this.skeleton.joints.length}`);
      return joint.channels.map((_, i) => joint.firstColumn + i);
    });
  }

  async decode(signal, request) {
    if (this.file.salvage) return this.decodeSalvaged(signal, request);
    return this.decodeNear(signal, request);
  }

  /** Runs of frames, which are kept, and the part of them that is wanted. */
  async decodeNear(signal, request) {
    const { from, to, dropped } = request;
    const { skip } = signal;
    const { decoder } = await this.open(signal);
    const isWhole = from === 0 && to === this.nFrames;
    const runs = isWhole || from === to ? null : this.runs(signal, dropped, decoder.alone === true);
    const near = runs && runsWithin(runs, skip + from, skip + to);
    const shown = (run) => {
      const end = Math.min(this.nFrames, run.to - skip);
      return { dropped, from: Math.max(0, run.from - skip), to: end };
    };
    const { decoded: kept } = this.file;
    if (!near || !near.every((run) => kept.mayKeep(bytesOf(shown(run), signal)))) {
      return this.decodeStrictly(signal, request);
    }
    new Room(this.file.decodedLimit).take(bytesOf(request, signal));
    const parts = [];
    for (const run of near) {
      const own = shown(run);
      const decode = () => this.decodeStrictly(signal, own);
      parts.push({ ...own, decoded: await kept.get(run, bytesOf(own, signal), decode) });
    }
    return joined(parts, signal, request);
  }

  runs(signal, dropped, alone) {
    const key = `${dropped} ${alone}`;
    if (!this.cut.has(signal)) this.cut.set(signal, new Map());
    const ofSignal = this.cut.get(signal);
    if (!ofSignal.has(key)) ofSignal.set(key, runsOf(signal, alone));
    return ofSignal.get(key);
  }

  /** The frames that are there; what their segments are is known from a walk through the file. */
  async decodeSalvaged(signal, request) {
    new Room(this.file.decodedLimit).take(bytesOf(request, signal));
    return salvageSignal(signal, request, this.stored(signal), (segments, from, to) => {
      const chain = this.chain(signal, segments);
      return this.decodeNear(chain, { ...request, from, to });
    });
  }

  /** The stored frames of a signal; Infinity where its clip was cut off and does not say it. */
  stored({ skip, spare }) {
    return storedFrames(this.clip, skip + spare, this.row.end !== null);
  }

  /** The signal with these segments alone. */
  chain(signal, segments) {
    const key = segments[0];
    if (!this.chains.has(key)) this.chains.set(key, { ...signal, segments });
    return this.chains.get(key);
  }

  async decodeStrictly(signal, request) {
    const opened = await this.open(signal);
    const room = new Room(this.file.decodedLimit);
    const needed = segmentsOf(opened, { ...request, room });
    const segments = await loadSegments(this.file, this.clip, signal, needed);
    const isWhole = request.from === 0 && request.to === this.nFrames && request.dropped === 0;
    if (isWhole && !this.file.salvage) await this.end();
    return supplied(() => decodeSegments(opened, segments, request));
  }

  async open(signal) {
    if (!this.opened.has(signal)) {
      this.opened.set(signal, await supplied(() => openSignal(this.clip, signal)));
    }
    return this.opened.get(signal);
  }

  async end() {
    if (!this.clip.end) {
      if (this.row.end === null) throw new Refused(`clip ${this.name} has no CEND`);
      this.clip.end = await readEnd(this.file, this.row, this.clip);
    }
    return this.clip.end;
  }
}

function bytesOf({ from, to }, { samplesPerFrame, channels }) {
  return decodedBytes((to - from) * samplesPerFrame, channels.length);
}

function sizesOf(segment, signal) {
  const { frameNotes, groupNotes, masks, streams } = takeStreams(segment, signal);
  const sum = (list) => list.reduce((total, { length }) => total + length, 0);
  return {
    firstFrame: segment.firstFrame - signal.skip,
    nFrames: segment.nFrames,
    bytes: segment.payload.length,
    notes: frameNotes.length + sum(groupNotes),
    masks: sum(masks),
    groups: signal.groupSizes.map((_, g) => sum(streams.map((ofGroups) => ofGroups[g]))),
    resolutions: streams.map(sum),
  };
}

function factsOf(signal) {
  const { name, index, role, of, channels, gridRuns, integer, ownChannels } = signal;
  return {
    name,
    index,
    role,
    of,
    codec: codecLabel(signal),
    nChannels: channels.length,
    channels,
    units: [...new Set(channels.map(({ unit }) => unit))],
    grids: gridRuns.map(({ nChannels, grid }) => ({ nChannels, grid: String(grid) })),
    integer,
    ownChannels,
    samplesPerFrame: signal.samplesPerFrame,
    nResolutions: signal.nResolutions,
    nGroups: signal.groupSizes.length,
    bytes: signal.segments.reduce((sum, { size }) => sum + size, 0),
  };
}

/** Frames a second; null where it is unknown. */
export function rateOf({ numerator, denominator }) {
  return numerator === 0 ? null : numerator / denominator;
}

function isCount(value) {
  return Number.isSafeInteger(value) && value >= 0;
}
