// A clip in the worker: its values in blocks, the places of its points, and what the page is told.

import { hasKinematics } from "../../../js/kinematics.js";
import { leadOf } from "./anatomy.js";
import { figureOf } from "./figure.js";
import { Lru } from "./lru.js";
import { Places } from "./places.js";
import { namedQuality } from "./quality.js";
import { guessedUp } from "./up.js";
import { clockFacts } from "../ui/times.js";

const LEAST_BLOCK = 64; // frames
const MOST_BLOCK = 512; // frames, where a segment has more and its codec can decode a part
const SMALL = 3000; // frames of a clip that is looked at as a whole before it is shown
const SAMPLES = 8; // of it
const APART = 4; // frames between samples of the first ones
const CACHE = 160 * 2 ** 20; // bytes of decoded values, of all clips

const cache = new Lru(CACHE);

/** What the page has of a clip, and reads of it. README.md lists what is in `facts`. */
export class OpenClip {
  #reader;
  #places;
  #cuts;
  #pending = new Map(); // blocks that are being read

  /**
   * @param {object} reader a clip of mcz-file.js, or of a reader of another format
   * @param {{key: string, fileId: number, index: number}} ids `key` is that of no other clip
   */
  constructor(reader, { key, fileId, index }) {
    this.#reader = reader;
    this.key = key;
    const { skeleton, signals } = reader;
    const drawn = signals[0] && !signals[0].ownChannels && hasKinematics(skeleton);
    this.#places = drawn ? new Places(skeleton) : null;
    this.#cuts = signals.map(({ segments }) => blocksOf(segments, reader.nFrames));
    this.facts = factsOf(reader, drawn, { key, fileId, index });
  }

  get nFrames() {
    return this.#reader.nFrames;
  }

  /** Completes the facts by what the first frames show. */
  async prepare() {
    const { upAxis, points, nFrames } = this.facts;
    if (nFrames === 0 || points.length === 0) return;
    const [block] = this.#cuts[0];
    const first = await this.positions(0, Math.min(nFrames, block[1], LEAST_BLOCK));
    this.facts.upGuess = upAxis ?? guessedUp(points, first, this.facts.isMarkers);
    this.facts.lead = leadOf(this.facts, await this.#samples(first));
  }

  /** Places in some of the first frames, and, of a clip that is not long, in some of the others. */
  async #samples(first) {
    const { points, nFrames } = this.facts;
    const samples = [];
    for (let at = 0; at < first.length; at += 3 * points.length * APART) {
      samples.push(first.subarray(at, at + 3 * points.length));
    }
    for (let i = 1; i <= SAMPLES && nFrames <= SMALL; i++) {
      const frame = Math.floor((i * (nFrames - 1)) / SAMPLES);
      try {
        samples.push(await this.positions(frame, frame + 1));
      } catch {
        break; // what is wrong is told when the frame is to be shown
      }
    }
    return samples;
  }

  /**
   * The places of all points in some frames.
   *
   * @returns {Promise<Float32Array>} x, y, z of each point of each frame
   */
  async positions(from, to) {
    const nPoints = this.facts.points.length;
    const out = new Float32Array((to - from) * nPoints * 3);
    if (this.#places === null) return out.fill(NaN);
    await this.#overBlocks(0, from, to, ({ values, mask, rowSize, first, start, end }) => {
      const skipped = (start - first) * rowSize;
      const nFrames = end - start;
      const at = (start - from) * nPoints * 3;
      const part = out.subarray(at, at + nFrames * nPoints * 3);
      const rows = values.subarray(skipped, skipped + nFrames * rowSize);
      const valid = mask && mask.subarray(skipped, skipped + nFrames * rowSize);
      this.#places.fill(rows, valid, { nFrames, rowSize }, part);
    });
    return out;
  }

  /**
   * Calls `visit` with each block of a signal's values that has some of the frames, in order.
   *
   * @param {(block: {values, mask, rowSize: number, first: number, start: number, end: number}) =>
   *   void} visit the block begins at frame `first`; the frames start <= f < end of it are wanted
   */
  async overBlocks(signal, from, to, visit) {
    await this.#overBlocks(signal, from, to, visit);
  }

  async #overBlocks(signal, from, to, visit) {
    const { channels, samplesPerFrame } = this.#reader.signals[signal];
    const rowSize = channels.length * samplesPerFrame;
    for (const [first, last] of this.#cuts[signal]) {
      if (last <= from || first >= to) continue;
      const { values, mask } = await this.#block(signal, first, last);
      const start = Math.max(first, from);
      visit({ values, mask, rowSize, first, start, end: Math.min(last, to) });
    }
  }

  async #block(signal, from, to) {
    const key = `${this.key}:${signal}:${from}`;
    const held = cache.get(key) ?? this.#pending.get(key);
    if (held !== undefined) return held;
    const reading = this.#read(signal, from, to, key).finally(() => this.#pending.delete(key));
    this.#pending.set(key, reading);
    return reading;
  }

  async #read(signal, from, to, key) {
    const block = await this.#reader.read(signal, from, to);
    const kept = { values: alone(numbers(block.values)), mask: block.mask && alone(block.mask) };
    cache.set(key, kept, kept.values.byteLength + (kept.mask?.byteLength ?? 0));
    return kept;
  }

  sourceBytes() {
    return this.#reader.sourceBytes();
  }
}

const numbers = (values) =>
  values instanceof BigInt64Array ? Float64Array.from(values, Number) : values;

/** A part as an array of its own: it would keep the whole. */
const alone = (part) => (part.byteLength < part.buffer.byteLength ? part.slice() : part);

/** Frames that are decoded together: whole segments, small ones several at a time. */
function blocksOf(segments, nFrames) {
  const blocks = [];
  let start = 0;
  for (const [, end] of segments) {
    if (end - start < LEAST_BLOCK && end < nFrames) continue;
    if (end > start) blocks.push([start, end]);
    start = Math.max(start, end);
  }
  if (start < nFrames) blocks.push([start, nFrames]);
  return blocks.flatMap(([from, to]) => (segments.length > 0 ? [[from, to]] : parts(from, to)));
}

function parts(from, to) {
  const out = [];
  for (let at = from; at < to; at += MOST_BLOCK) out.push([at, Math.min(to, at + MOST_BLOCK)]);
  return out;
}

function factsOf(reader, drawn, ids) {
  const { skeleton, signals } = reader;
  const figure = drawn ? figureOf(skeleton) : { points: [], bones: [], isMarkers: false };
  const motion = signals[0];
  return {
    ...ids,
    ...figure,
    name: reader.name,
    aliases: reader.aliases ?? [],
    nFrames: reader.nFrames,
    rate: reader.rate,
    unitCm: skeleton.unitCm,
    upAxis: skeleton.upAxis === 0 ? null : (skeleton.upAxis - 1) % 3,
    isDown: skeleton.upAxis > 3,
    upGuess: null,
    lead: 0,
    skeleton: skeleton.name,
    joints: skeleton.joints.map(({ name, parent }) => ({ name, parent })),
    channels: (motion?.channels ?? []).map(({ name, unit, joint }) => ({ name, unit, joint })),
    signals: signals.map(signalFacts),
    codec: motion?.codec ?? null,
    bytes: signals.reduce((sum, { bytes }) => sum + (bytes ?? 0), 0),
    source: reader.source,
    metadata: reader.metadata,
    quality: namedQuality(reader.quality, { joints: skeleton.joints, points: figure.points }),
    lost: reader.lost,
    firstFrame: reader.firstFrame,
    numbers: reader.numbers?.length > 1 ? reader.numbers : null,
    ...(reader.clock ?? clockFacts(null, reader.rate)),
    events: reader.events,
    segments: motion?.segments ?? [],
  };
}

function signalFacts({ name, codec, channels, samplesPerFrame, nResolutions, bytes, ownChannels }) {
  return {
    name,
    codec,
    nChannels: channels.length,
    channels: channels.map(({ name: channel, unit, joint }) => ({ name: channel, unit, joint })),
    samplesPerFrame,
    nResolutions,
    ownChannels,
    bytes,
  };
}
