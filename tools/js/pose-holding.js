// SPEC.md, "Held contacts": where points are, and the least change of a pose that puts them where
// they should be.

import { clamp } from "./entropy.js";
import { LEANS, STANDS } from "./pose-contacts.js";

const DAMPING = 2 ** -14;
const LEAST_DAMPING = 2 ** -100;
const GREATEST_PULL = 2 ** 100;
const MOST_STEPS = 4;
const BEYOND = 2 ** 40;

/** The points of contacts in one segment. */
export class Holder {
  /**
   * @param {{rounds: number, points: object[]}} contacts of the header
   * @param {import("./skel.js").Skeleton} skeleton
   * @param {import("./pose-metric.js").PoseMetric} metric of the kept channels
   * @param {ArrayLike<number>} kept columns of the kept channels
   * @param {Float64Array} greatest their greatest steps
   */
  constructor({ rounds, points }, { joints }, metric, kept, greatest) {
    Object.assign(this, { rounds, metric, kept });
    metric.stiffen(1);
    this.limits = greatest.map((step) => MOST_STEPS * step);
    this.points = points.map(({ joint, tail }) => {
      const path = [];
      for (let j = joint; j >= 0; j = joints[j].parent) path.unshift(j);
      const chain = metric.jointOf.flatMap((j, number) => (path.includes(j) ? [number] : []));
      return { joint, root: path[0], chain, tail: metric.tailOf(joints[joint], joint, tail) };
    });
    this.rows = Array.from({ length: 3 * points.length }, () => new Float64Array(kept.length));
    this.square = new Float64Array(9 * points.length ** 2);
    this.pivots = new Float64Array(3 * points.length);
    this.g = new Float64Array(3 * points.length);
  }

  /** Where the points are in all frames, three numbers a frame. */
  places(values, nChannels) {
    const nFrames = values.length / nChannels;
    const found = this.points.map(() => new Float64Array(3 * nFrames));
    for (let f = 0; f < nFrames; f++) {
      const pose = values.subarray(f * nChannels, (f + 1) * nChannels);
      this.metric.placeAll(pose);
      this.points.forEach((point, k) => found[k].set(this.place(point, pose), 3 * f));
    }
    return found;
  }

  /** Where a point is, as seen from the root above it, in the pose of the moment. */
  seen({ joint, tail }) {
    const { axes, origins } = this.metric;
    return [0, 1, 2].map((i) => {
      const row = 9 * joint + 3 * i;
      const way = axes[row] * tail[0] + axes[row + 1] * tail[1] + axes[row + 2] * tail[2];
      return origins[3 * joint + i] + way;
    });
  }

  place(point, pose) {
    const place = this.seen(point);
    for (const { direction, column } of this.metric.joints[point.root].moves) {
      const value = Math.abs(pose[column]) < BEYOND ? pose[column] : 0;
      for (let i = 0; i < 3; i++) place[i] += value * direction[i];
    }
    return place;
  }

  /**
   * Corrects a frame, in place.
   *
   * @param {Float64Array} values of all channels
   * @param {number} frame
   * @param {{shifts: Float64Array, active: Uint8Array}[]} tracks of the points
   */
  correct(values, frame, tracks) {
    const { metric, kept, limits, points } = this;
    const those = (least) =>
      [...points.keys()].filter((k) => tracks[k].active[frame] >= least);
    let which = those(LEANS);
    if (which.length === 0) return;
    const factor = metric.factor(values);
    const pose = values.slice();
    const total = new Float64Array(kept.length);
    const goals = [];
    for (let round = 0; round < this.rounds && which.length > 0; round++) {
      metric.placeAll(pose);
      which.forEach((k, a) => {
        const place = this.place(points[k], pose);
        const { shifts } = tracks[k];
        if (round === 0) goals[k] = place.map((x, i) => x + shifts[3 * frame + i]);
        for (let i = 0; i < 3; i++) this.g[3 * a + i] = goals[k][i] - place[i];
        this.pull(points[k], factor, 3 * a);
      });
      const n = 3 * which.length;
      this.solve(n);
      const x = metric.fromMetric(factor, this.sum(n));
      for (let d = 0; d < kept.length; d++) {
        total[d] = clamp(total[d] + x[d], -limits[d], limits[d]);
        pose[kept[d]] = values[kept[d]] + total[d];
      }
      which = those(STANDS);
    }
    for (const column of kept) values[column] = pose[column];
  }

  /** The rows of a point, from the one of number `at` on. */
  pull(point, factor, at) {
    const { path, starts, motions } = this.metric;
    const [a, b, c] = this.seen(point);
    const [x, y, z] = this.rows.slice(at, at + 3);
    for (const row of [x, y, z]) row.fill(0);
    for (const d of point.chain) {
      const m = 6 * d;
      const [u, v, w] = [motions[m], motions[m + 1], motions[m + 2]];
      x[d] = motions[m + 3] + (v * c - w * b);
      y[d] = motions[m + 4] + (w * a - u * c);
      z[d] = motions[m + 5] + (u * b - v * a);
    }
    for (const row of [x, y, z]) {
      for (let back = point.chain.length - 1; back >= 0; back--) {
        const d = point.chain[back];
        const last = starts[d + 1] - 1;
        const pulled = clamp(row[d], -GREATEST_PULL, GREATEST_PULL);
        for (let e = starts[d]; e < last; e++) row[path[e]] -= factor[e] * pulled;
        row[d] = clamp(pulled * factor[last], -GREATEST_PULL, GREATEST_PULL);
      }
    }
  }

  /** Solves the damped normal equations of the first n rows; `g` becomes the solution. */
  solve(n) {
    const { rows, square: A, pivots: D, g } = this;
    let trace = 0;
    for (let a = 0; a < n; a++) {
      for (let b = 0; b <= a; b++) {
        let sum = 0;
        for (let d = 0; d < rows[a].length; d++) sum += rows[a][d] * rows[b][d];
        A[a * n + b] = sum;
      }
      trace += A[a * n + a];
    }
    const damping = DAMPING * trace + LEAST_DAMPING;
    for (let a = 0; a < n; a++) {
      for (let b = 0; b <= a; b++) {
        let t = A[a * n + b];
        if (a === b) t += damping;
        for (let m = 0; m < b; m++) t -= A[a * n + m] * A[b * n + m] * D[m];
        if (a === b) D[a] = Math.max(t, damping);
        else A[a * n + b] = t / D[b];
      }
      for (let m = 0; m < a; m++) g[a] -= A[a * n + m] * g[m];
    }
    for (let a = n - 1; a >= 0; a--) {
      g[a] /= D[a];
      for (let m = a + 1; m < n; m++) g[a] -= A[m * n + a] * g[m];
    }
  }

  /** The first n rows, each times its `g`, summed. */
  sum(n) {
    const y = new Float64Array(this.kept.length);
    for (let a = 0; a < n; a++) {
      const [row, g] = [this.rows[a], this.g[a]];
      for (let d = 0; d < y.length; d++) y[d] += row[d] * g;
    }
    return y;
  }
}
