// The public interface: what an MCZ file holds, as arrays and as the source files it was made of.

import { codecLabel } from "./codecs.js";
import { Refused, Unsupported } from "./errors.js";
import { bytesFrom } from "./from-bytes.js";
import { Room, decodedLimit } from "./limits.js";
import { guarded } from "./memory.js";
import { canFilter, postFilter } from "./post-filter.js";
import { readFile } from "./read.js";
import { sourceFormatLabel } from "./registry.js";
import { ALIAS_OF } from "./shared.js";
import { decodeSignal, takeColumns } from "./signals.js";
import { restoreClip, restoreSkeleton } from "./sources.js";

export { setAnnex } from "./annex.js";
export { annexFrom } from "./annex-url.js";
export { AccessError, LimitExceeded, MczError, Refused, Unsupported } from "./errors.js";
export { fromBlob, fromBytes } from "./from-bytes.js";
export { fromUrl } from "./from-url.js";
export { open } from "./open.js";
export { analogValues } from "./recording.js";

/**
 * @typedef {object} Options
 * @property {string} [clip] this clip alone
 * @property {[number, number]} [frames] frames a <= f < b
 * @property {number[]} [joints] the columns of these joints in this order, and signals alone that
 *   have the channels of the skeleton
 * @property {number} [resolution] without so many of the finest details of the motion; of other
 *   signals as many of these as they can spare
 * @property {boolean} [postFilter] the motion filtered (SPEC.md, "Post filter")
 * @property {number} [decodedLimit] bytes that one signal or file may be decoded to, in place of
 *   the limit of SPEC.md
 */

/**
 * @typedef {object} SignalArrays
 * @property {string} name
 * @property {number} nRows
 * @property {number} nChannels
 * @property {Float64Array | BigInt64Array} values rows x channels, row after row
 * @property {Uint8Array | null} mask 1 valid, 0 invalid; null: all are valid
 */

/**
 * What the clips of a file are, without decoding them. The container is checked as a whole.
 *
 * @param {Uint8Array | ArrayBuffer} bytes the whole file
 * @param {{decodedLimit?: number}} [options]
 * @returns {{name: string, nFrames: number,
 *   frameRate: {numerator: number, denominator: number},
 *   skeleton: import("./skel.js").Skeleton, metadata: Map<string, string>,
 *   source: {path: string, format: string} | null,
 *   quality: {key: string, value: string}[] | null,
 *   signals: {name: string, codec: string, nChannels: number, samplesPerFrame: number,
 *     nResolutions: number, ownChannels: boolean, bytes: number}[]}[]} the clips in file order
 * @throws {MczError} {@link Refused} or {@link Unsupported}, and nothing else
 */
export function list(bytes, options = {}) {
  const data = bytesFrom(bytes);
  return guarded(() => Array.from(readFile(data, options).clips.values(), factsOf));
}

function factsOf({ name, nFrames, frameRate, skeleton, metadata, source, quality, signals }) {
  return {
    name,
    nFrames,
    frameRate,
    skeleton,
    metadata,
    source: source && { path: source.path, format: sourceFormatLabel(source.format) },
    quality,
    signals: signals.map((signal) => ({
      name: signal.name,
      codec: codecLabel(signal),
      nChannels: signal.channels.length,
      samplesPerFrame: signal.samplesPerFrame,
      nResolutions: signal.nResolutions,
      ownChannels: signal.ownChannels,
      bytes: signal.segments.reduce((sum, { payload }) => sum + payload.length, 0),
    })),
  };
}

/**
 * Decodes a file, or the part of it that is asked for. The container is checked as a whole.
 *
 * @param {Uint8Array | ArrayBuffer} bytes the whole file
 * @param {Options} [options]
 * @returns {{name: string, frameRate: {numerator: number, denominator: number},
 *   nFrames: number, signals: SignalArrays[]}[]} the clips in file order
 * @throws {MczError} {@link Refused} or {@link Unsupported}, and nothing else
 */
export function decode(bytes, options = {}) {
  const data = bytesFrom(bytes);
  return guarded(() => {
    const file = readFile(data, options);
    const room = new Room(limitOf(file, options));
    return each(wantedClips(file, options), (clip) => decodeClip(clip, options, room));
  });
}

/**
 * Restores the source files that a file holds.
 *
 * @param {Uint8Array | ArrayBuffer} bytes the whole file
 * @param {{decodedLimit?: number}} [options]
 * @returns {{path: string, bytes: Uint8Array}[]} those of clips, then attachments, then aliases,
 *   each in file order
 * @throws {MczError} {@link Refused} or {@link Unsupported}, and nothing else
 */
export function sources(bytes, options = {}) {
  const data = bytesFrom(bytes);
  return guarded(() => {
    const file = readFile(data, options);
    const room = new Room(limitOf(file, options));
    const contents = new Map(); // of clips and attachments, as far as they could be restored
    const keep = (item, path, content) => {
      contents.set(item, content);
      return { path, bytes: content };
    };
    const ofClip = (clip) => {
      const signals = decodeSignals(clip, options, new Room(room.limit));
      return clip.source ? keep(clip, clip.source.path, sourceOf(clip, signals, room)) : null;
    };
    const ofAttachment = (attachment) => {
      room.take(attachment.size);
      return keep(attachment, attachment.name, attachment.content());
    };
    const ofAlias = (alias) => ({ path: alias.name, bytes: contentOf(alias, contents, room) });
    const files = [
      ...Array.from(file.clips.values(), (clip) => () => ofClip(clip)),
      ...Array.from(file.attachments.values(), (attachment) => () => ofAttachment(attachment)),
      ...Array.from(file.aliases.values(), (alias) => () => ofAlias(alias)),
    ];
    return each(files, (restore) => restore()).filter((restored) => restored !== null);
  });
}

function sourceOf(clip, signals, room) {
  const { numbers, end } = clip;
  const { sourceSha256 } = end;
  const content = restoreClip({ clip, signals, numbers, sourceSha256, maxBytes: room.limit });
  room.take(content.length);
  return content;
}

/** The file that an alias is a copy of. */
function contentOf({ of, target }, contents, room) {
  if (of === ALIAS_OF.SKELETON) return restoreSkeleton(target, room.limit);
  if (!contents.has(target)) throw new Unsupported("a copy of what could not be restored");
  return contents.get(target);
}

function limitOf(file, options) {
  return options.decodedLimit ?? decodedLimit(file.size);
}

function wantedClips(file, { clip: name }) {
  if (name === undefined) return [...file.clips.values()];
  if (!file.clips.has(name)) throw new Refused(`no clip ${name}`);
  return [file.clips.get(name)];
}

/**
 * Does something with each clip, or signal. One that is unsupported does not hide what is invalid
 * in those behind it.
 */
function each(list, work) {
  let unsupported = null;
  const results = [];
  for (const item of list) {
    try {
      results.push(work(item));
    } catch (error) {
      if (!(error instanceof Unsupported)) throw error;
      unsupported ??= error;
    }
  }
  if (unsupported) throw unsupported;
  return results;
}

/**
 * The signals of a clip that are asked for, decoded; of the frames and at the resolution that are
 * asked for, but the motion whole where it is to be filtered.
 */
function decodeSignals(clip, { frames, resolution = 0, joints, postFilter: filters }, room) {
  const [from, to] = frames ?? [0, clip.nFrames];
  if (!(isCount(from) && isCount(to) && from <= to && to <= clip.nFrames)) {
    throw new Refused(`frames ${from} to ${to} of ${clip.nFrames} of clip ${clip.name}`);
  }
  if (!isCount(resolution)) throw new Refused(`resolution ${resolution}`);
  const wanted = clip.signals.filter(({ ownChannels }) => !(joints && ownChannels));
  return each(wanted, (signal) => {
    const isMotion = signal.index === 0;
    const dropped = isMotion ? resolution : Math.min(resolution, signal.nResolutions - 1);
    const part = isMotion && filters ? { from: 0, to: clip.nFrames } : { from, to };
    return decodeSignal(clip, signal, { ...part, dropped, room });
  });
}

function isCount(value) {
  return Number.isSafeInteger(value) && value >= 0;
}

function decodeClip(clip, options, room) {
  const signals = options.postFilter
    ? filteredSignals(clip, options, room)
    : decodeSignals(clip, options, room);
  const { name, frameRate, nFrames } = clip;
  if (!options.joints) return { name, frameRate, nFrames, signals: signals.map(arraysOf) };
  const columns = columnsOf(clip.skeleton, options.joints);
  const ofJoints = signals.map((decoded) => arraysOf(takeColumns(decoded, columns)));
  return { name, frameRate, nFrames, signals: ofJoints };
}

/** The whole motion filtered, then the frames that are asked for. */
function filteredSignals(clip, options, room) {
  const { frameRate, skeleton } = clip;
  if (clip.signals[0].ownChannels || !canFilter(skeleton, frameRate)) {
    throw new Refused(`clip ${clip.name} cannot be filtered`);
  }
  const [motion, ...others] = decodeSignals(clip, options, room);
  const { samplesPerFrame } = motion.signal;
  const rows = { frameRate, samplesPerFrame, unitCm: skeleton.unitCm, nChannels: motion.nChannels };
  motion.values = postFilter(rows, motion.values, motion.mask);
  return [options.frames ? takeRows(motion, options.frames) : motion, ...others];
}

function takeRows(decoded, [from, to]) {
  const { signal, nChannels, values, mask } = decoded;
  const start = from * signal.samplesPerFrame * nChannels;
  const end = to * signal.samplesPerFrame * nChannels;
  return {
    ...decoded,
    nRows: (to - from) * signal.samplesPerFrame,
    values: values.subarray(start, end),
    mask: mask && mask.subarray(start, end),
  };
}

/** The columns of some joints. */
function columnsOf(skeleton, joints) {
  return joints.flatMap((index) => {
    const joint = skeleton.joints[index];
    if (!joint) throw new Refused(`no joint ${index} of ${skeleton.joints.length}`);
    return joint.channels.map((_, i) => joint.firstColumn + i);
  });
}

function arraysOf({ signal, nRows, nChannels, values, mask }) {
  const anyInvalid = mask !== null && mask.includes(0);
  return { name: signal.name, nRows, nChannels, values, mask: anyInvalid ? mask : null };
}
