// A clip on the stage: where its points are at any time, and what is drawn of it.

import { anatomyOf } from "../engine/anatomy.js";
import { Poses } from "../engine/poses.js";
import { Standing } from "../engine/standing.js";
import { rateOf } from "../timeline/clock.js";
import { isGapAfter } from "../ui/times.js";
import { Axes, between } from "./axes.js";
import { Body } from "./body.js";
import { boundsOf, facing, measured, quantile, scaleOf } from "./framing.js";

const SMALL = 3000; // frames of a clip that is looked at as a whole before it is shown
const SAMPLES = 24;
const PIECE = 256; // frames that are asked for at a time
const FIRST_SAMPLES = 16; // of the first frames

export class Actor {
  #raw;
  #back = 0; // frames that missing points were looked for

  constructor(engine, clip, onArrival) {
    this.engine = engine;
    this.clip = clip;
    this.poses = new Poses(engine, clip, onArrival);
    this.standing = new Standing(engine, clip, onArrival);
    this.samples = [];
    this.neighbors = null; // lines that were guessed, where they are wanted
    this.body = null;
    this.axes = null;
    this.hasFigure = clip.points.length > 0 && clip.nFrames > 0;
    this.#raw = new Float32Array(clip.points.length * 3);
    this.places = new Float32Array(clip.points.length * 3);
  }

  /** Gets what is needed before the first picture. */
  async prepare() {
    if (!this.hasFigure) return;
    const { nFrames } = this.clip;
    await this.poses.get(0);
    if (this.poses.fault !== null) throw this.poses.fault;
    const there = Math.min(nFrames, this.poses.blockFrames);
    this.samples = this.#held(there, FIRST_SAMPLES);
    const isNowhere = this.samples.every((places) => places.every(Number.isNaN));
    if (nFrames > there && (nFrames <= SMALL || isNowhere)) await this.lookFurther();
  }

  #held(count, most) {
    const step = Math.max(1, Math.floor(count / most));
    const frames = [];
    for (let frame = 0; frame < count; frame += step) frames.push(this.poses.held(frame));
    return frames.filter((places) => places?.length > 0);
  }

  /** Samples frames of the whole clip. */
  async lookFurther() {
    const { nFrames } = this.clip;
    for (let i = 1; i <= SAMPLES; i++) {
      const frame = Math.floor((i * (nFrames - 1)) / SAMPLES);
      try {
        this.samples.push(await this.engine.positions(this.clip, frame, frame + 1));
      } catch {
        return; // what is wrong is told when the frame is to be shown
      }
    }
  }

  /**
   * The first frame in which a point is seen.
   *
   * @param {() => boolean} isOver ends the search
   * @returns {Promise<number>} 0 where there is none
   */
  async firstSeen(isOver) {
    const { nFrames } = this.clip;
    const size = 3 * this.clip.points.length;
    for (let from = 0; from < nFrames && !isOver(); from += PIECE) {
      const places = await this.engine.positions(this.clip, from, Math.min(nFrames, from + PIECE));
      const at = places.findIndex((x) => !Number.isNaN(x));
      if (at >= 0) return from + Math.floor(at / size);
    }
    return 0;
  }

  /** Decides about axes and size; `scale` of another clip that this one is compared with. */
  place(up, scale = null) {
    this.anatomy = anatomyOf(this.clip, this.samples);
    const { size, floor } = measured(this.samples, up, this.anatomy.loose);
    this.size = size;
    this.axes = new Axes(up, scale ?? scaleOf(size));
    this.floor = floor * this.axes.scale;
    this.facing = 0;
    const seen = this.samples.find((places) => !places.every(Number.isNaN));
    if (seen) {
      const first = this.axes.apply(seen, new Float32Array(this.places.length));
      this.facing = facing(this.clip.points, first);
    }
  }

  build(look) {
    this.body?.dispose();
    const bones = this.neighbors ?? this.anatomy.bones;
    this.body = new Body(this.clip, { ...this.anatomy, bones }, this.#fullest(), look);
    return this.body;
  }

  /** Whether its lines can only be guessed: it has markers whose names say nothing. */
  get hasNoLines() {
    return this.clip.isMarkers && this.clip.bones.length === 0;
  }

  /**
   * Lines between markers that stay as far apart as they are; without `isWanted` none.
   *
   * @returns {Promise<string>} why there are none, where they are wanted
   */
  async guessLines(isWanted) {
    if (!isWanted || !this.hasNoLines) {
      this.neighbors = null;
      return "";
    }
    this.guess ??= this.engine.neighbors(this.clip);
    const { lines, why } = await this.guess;
    this.neighbors = Array.from({ length: lines.length / 2 }, (_, k) => [lines[2 * k], lines[2 * k + 1]]);
    return why;
  }

  /** The sample with the most points. */
  #fullest() {
    const out = new Float32Array(this.places.length).fill(NaN);
    for (const sample of this.samples) {
      for (let k = 0; k < out.length; k++) if (Number.isNaN(out[k])) out[k] = sample[k];
      if (!out.includes(NaN)) break;
    }
    return this.axes.apply(out, new Float32Array(out.length));
  }

  /** The box of the samples, in units of the picture. */
  extent() {
    const out = new Float32Array(this.places.length);
    const boxes = this.samples.map((sample) => this.bounds(this.axes.apply(sample, out)));
    const ends = (name, choose) =>
      [0, 1, 2].map((k) => choose(...boxes.map((box) => box[name][k])));
    return { least: ends("least", Math.min), most: ends("most", Math.max) };
  }

  /** The box of the figure where it is in a frame. */
  bounds(places) {
    return boundsOf(places, this.anatomy.loose);
  }

  /**
   * The places at a time, also between frames.
   *
   * @param {number} frame
   * @param {number} ahead blocks that are wanted after it
   * @returns {Float32Array | null} of the picture; null where they are not there yet
   */
  at(frame, ahead) {
    const last = this.clip.nFrames - 1;
    const low = Math.max(0, Math.min(last, Math.floor(frame)));
    const part = frame - low;
    const first = this.poses.at(low, ahead);
    if (first === null) return null;
    const second = part > 0.001 && low < last ? this.poses.held(low + 1) : null;
    const raw = second === null ? first : between(first, second, part, this.#raw);
    this.axes.apply(raw, this.places);
    return this.places;
  }

  /** Where points that are missing in a frame were seen last, into `last` of the body. */
  findLast(frame) {
    const { last } = this.body;
    if (!this.places.includes(NaN)) return;
    last.fill(NaN);
    const out = new Float32Array(last.length);
    for (let back = 1; back <= this.poses.blockFrames && frame - back >= 0; back++) {
      const raw = this.poses.held(Math.floor(frame) - back);
      if (raw === null) return;
      this.axes.apply(raw, out);
      let missing = 0;
      for (let k = 0; k < last.length; k++) {
        if (!Number.isNaN(this.places[k]) || !Number.isNaN(last[k])) continue;
        last[k] = out[k];
        if (Number.isNaN(out[k])) missing++;
      }
      if (missing === 0) return;
    }
  }

  /**
   * Speeds of the points around a frame.
   *
   * @param {Float32Array} out of each point, in m/s; in units of the file a second where its unit is
   *   unknown
   */
  speeds(frame, out) {
    const { clip } = this;
    const row = Math.floor(frame);
    const low = row === 0 || isGapAfter(clip, row - 1) ? row : row - 1;
    const high = row === clip.nFrames - 1 || isGapAfter(clip, row) ? row : row + 1;
    const before = this.poses.held(low);
    const after = this.poses.held(high);
    if (before === null || after === null || high === low) return out.fill(0);
    const factor = (rateOf(this.clip) / (high - low)) * ((this.clip.unitCm ?? 100) / 100);
    for (let point = 0; point < out.length; point++) {
      const k = 3 * point;
      out[point] =
        factor *
        Math.hypot(
          after[k] - before[k],
          after[k + 1] - before[k + 1],
          after[k + 2] - before[k + 2],
        );
    }
    return out;
  }

  /** A speed that few points exceed in the first frames. */
  usualSpeed() {
    const count = Math.min(this.clip.nFrames, this.poses.blockFrames);
    const out = new Float32Array(this.clip.points.length);
    const all = [];
    for (let frame = 1; frame < count - 1; frame += 8) all.push(...this.speeds(frame, out));
    return quantile(all.filter(Number.isFinite), 0.98);
  }

  close() {
    this.poses.close();
    this.body?.dispose();
  }
}
