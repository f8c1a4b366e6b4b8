// SPEC.md, "Codec 3: posewave": the levels of a segment, from rows in the metric to frames.

import { clamp } from "./entropy.js";
import { halvings, join } from "./lifting.js";
import { PoseMetric } from "./pose-metric.js";

const ROOT_2 = 1.4142135623730951;
const N_KINDS = 6;

// How fast the share is forgotten by which an approximation goes on; what is known at first.
const MEMORY = 0.97;
const PRIOR = 0.25;

/** "Levels of a segment": 0 has approximations, 1 to N details, the finest last. */
export class Pyramid {
  /**
   * @param {number} nFrames
   * @param {{levels: number, borrowing: number, step: number}} header
   */
  constructor(nFrames, { levels, borrowing, step }) {
    this.lengths = halvings(nFrames, levels);
    /** N */
    this.nDetails = this.lengths.length - 1;
    this.borrowing = Math.min(borrowing, this.nDetails - 1);
    this.greatest = step;
  }

  /** How often what a level is about was halved. */
  depth(level) {
    return level === 0 ? this.nDetails : this.nDetails - level + 1;
  }

  /** What a level is to the model of its rows. */
  kind(level) {
    return level === 0 ? 0 : Math.max(1, N_KINDS - this.depth(level));
  }

  nRows(level) {
    const { lengths, nDetails } = this;
    return level === 0 ? lengths[nDetails] : Math.floor(lengths[nDetails - level] / 2);
  }

  /** The root of how many frames a coefficient of a level bears on. */
  root(level) {
    const k = level === 0 ? this.nDetails : this.depth(level) - 1;
    return 2 ** (k >> 1) * (k % 2 === 0 ? 1 : ROOT_2);
  }

  /** The step of a level: that of its rows whose exponent is 0. */
  step(level) {
    return this.greatest / this.root(level);
  }
}

/** The way from the coarsest level to the frames. */
export class Walk {
  /**
   * @param {object} header its fields
   * @param {import("./skel.js").Skeleton} skeleton
   * @param {Pyramid} pyramid
   * @param {Int32Array} kept columns of the kept channels, at least one
   * @param {Float64Array} first the first pose, of all channels
   */
  constructor(header, skeleton, pyramid, kept, first) {
    this.pyramid = pyramid;
    this.kept = kept;
    this.greatest = Float64Array.from(kept, (c) => header.greatest[c]);
    /** All channels of a pose. Those that are not kept stand still. */
    this.pose = first;
    const reg = this.greatest.map((step) => (header.step / step) * (header.step / step));
    this.metric = new PoseMetric(skeleton, [...kept], reg, header);
    /** The signal of kept channels so far, and the poses that details are in the metric of. */
    this.signal = null;
    this.poses = null;
    this.posesLevel = 0;
    /** How approximations go on: how many there were, the next one, the last difference. */
    this.nRows = 0;
    this.expected = Float64Array.from(kept, (c) => first[c]);
    this.moved = new Float64Array(kept.length);
    this.below = this.greatest.map((greatest) => {
      const t = PRIOR * greatest;
      return 4 * t * t;
    });
    this.above = this.below.map((x) => 0.5 * x);
  }

  /**
   * "Approximations": the first rows of level 0, or those that go on after these.
   *
   * @param {Float64Array} rows in steps of the level
   */
  approximations(rows) {
    const { kept, pose, metric, expected, moved, below, above } = this;
    const n = kept.length;
    const step = this.pyramid.step(0);
    this.stiffen(0);
    const y = new Float64Array(n);
    const signal = new Float64Array(rows.length);
    for (let at = 0; at < rows.length; this.nRows++) {
      inSteps(rows, at, step, y);
      const x = metric.fromMetric(metric.factor(pose), y);
      for (let c = 0; c < n; c++, at++) {
        const v = expected[c] + x[c];
        const u = v - pose[kept[c]];
        if (this.nRows >= 2) {
          above[c] = above[c] * MEMORY + u * moved[c];
          below[c] = below[c] * MEMORY + moved[c] * moved[c];
        }
        const share = clamp(above[c] / below[c], 0, 1);
        signal[at] = v;
        pose[kept[c]] = v;
        expected[c] = this.nRows === 0 ? v : v + share * u;
        moved[c] = this.nRows === 0 ? 0 : u;
      }
    }
    this.signal = signal;
  }

  /**
   * "Details".
   *
   * @param {number} level
   * @param {Float64Array | null} rows in steps of the level; null: they are left out, as are those of all finer levels
   */
  details(level, rows) {
    const nRows = this.pyramid.nRows(level);
    const detail = new Float64Array(nRows * this.kept.length);
    if (rows !== null) {
      if (this.pyramid.depth(level) > this.pyramid.borrowing) this.setPoses(level, nRows);
      this.fromMetric(level, rows, detail);
    }
    this.signal = join(this.signal, detail, this.kept.length);
  }

  /** Makes the metric that of a level. */
  stiffen(level) {
    if (this.metric.spread > 0) this.metric.stiffen(this.pyramid.root(level));
  }

  /** Poses halfway from each approximation to the next. */
  setPoses(level, nRows) {
    const { signal } = this;
    const n = this.kept.length;
    const last = signal.length - n;
    this.poses = new Float64Array(nRows * n);
    this.posesLevel = level;
    for (let at = 0; at < this.poses.length; at++) {
      const next = at < last ? at + n : at;
      this.poses[at] = (signal[at] + signal[next]) * 0.5;
    }
  }

  /** Each row at its pose, which that of the row before may be, too. */
  fromMetric(level, rows, detail) {
    const { kept, pose, poses, metric, posesLevel } = this;
    const n = kept.length;
    const step = this.pyramid.step(level);
    this.stiffen(level);
    const lastPose = poses.length / n - 1;
    const y = new Float64Array(n);
    let factor = null;
    let at = -1;
    for (let m = 0; m * n < rows.length; m++) {
      inSteps(rows, m * n, step, y);
      if (y.every((x) => x === 0)) continue;
      const g = Math.min(m >> (level - posesLevel), lastPose);
      if (g !== at) {
        for (let c = 0; c < n; c++) pose[kept[c]] = poses[g * n + c];
        factor = metric.factor(pose);
        at = g;
      }
      detail.set(metric.fromMetric(factor, y), m * n);
    }
  }
}

/** A row, which begins at `at`, in units of the metric. */
function inSteps(rows, at, step, y) {
  for (let c = 0; c < y.length; c++) y[c] = rows[at + c] * step;
}
