// How far the points of one clip are from those of the same names of another.

import { nextTurn } from "./turns.js";

const PIECE = 256; // frames between two looks for other messages

/**
 * @param {object} a see clip.js: the one that is right
 * @param {object} b the one that is asked about
 * @param {(done: number) => void} progress from 0 to 1
 * @returns {Promise<object>} `mean`, `max` and `worst` by frame of `a`: mean and greatest distance,
 *   and the point of `a` that has it (-1 where there is none); `byPoint` `{ point, name, mean, max,
 *   frame }`, `pairs` of points of a and b; `total` `{ mean, max, frame, point }`; `unit` "cm", or
 *   null where the unit is unknown and distances are in it
 */
export async function errorsBetween(a, b, progress = () => {}) {
  const pairs = matched(a.facts.points, b.facts.points);
  if (pairs.length === 0) throw new Error("the clips have no points of the same names");
  const nFrames = sharedFrames(a.facts, b.facts);
  if (nFrames === 0) throw new Error("the clips have no frames in common");
  const out = new Distances(pairs, nFrames, scalesOf(a.facts, b.facts));
  const step = stepOf(a.facts, b.facts);
  for (let from = 0; from < nFrames; from += PIECE) {
    const to = Math.min(nFrames, from + PIECE);
    const first = Math.floor(from * step);
    const last = Math.min(b.nFrames, Math.round((to - 1) * step) + 1);
    const ofA = await a.positions(from, to);
    const ofB = await b.positions(first, last);
    out.add(
      from,
      to,
      ofA,
      a.facts.points.length,
      (f) => Math.round(f * step) - first,
      ofB,
      b.facts.points.length,
    );
    progress(to / nFrames);
    await nextTurn();
  }
  return out.result(a.facts);
}

/**
 * Pairs of points of the same names; where names repeat, in order.
 *
 * @returns {number[][]}
 */
export function matched(points, others) {
  const waiting = new Map();
  others.forEach(({ name }, index) => {
    if (!waiting.has(name)) waiting.set(name, []);
    waiting.get(name).push(index);
  });
  return points.flatMap(({ name }, index) => {
    const other = waiting.get(name)?.shift();
    return other === undefined ? [] : [[index, other]];
  });
}

/** Frames of `b` for one of `a`: 1 where a rate is unknown. */
export function stepOf(a, b) {
  return a.rate && b.rate ? b.rate / a.rate : 1;
}

function sharedFrames(a, b) {
  if (b.nFrames === 0) return 0;
  const step = stepOf(a, b);
  return Math.min(a.nFrames, Math.floor((b.nFrames - 0.5) / step) + 1);
}

/** Factors to cm; 1 and 1 where a unit is unknown. */
function scalesOf(a, b) {
  if (a.unitCm === null || b.unitCm === null) return { ofA: 1, ofB: 1, unit: null };
  return { ofA: a.unitCm, ofB: b.unitCm, unit: "cm" };
}

class Distances {
  constructor(pairs, nFrames, scales) {
    Object.assign(this, { pairs, scales });
    this.mean = new Float32Array(nFrames).fill(NaN);
    this.max = new Float32Array(nFrames).fill(NaN);
    this.worst = new Int32Array(nFrames).fill(-1);
    this.sums = new Float64Array(pairs.length);
    this.counts = new Float64Array(pairs.length);
    this.greatest = new Float64Array(pairs.length);
    this.frames = new Int32Array(pairs.length);
  }

  add(from, to, ofA, nA, frameOfB, ofB, nB) {
    for (let f = from; f < to; f++) {
      const rowA = (f - from) * nA;
      const rowB = frameOfB(f) * nB;
      let sum = 0;
      let count = 0;
      for (let p = 0; p < this.pairs.length; p++) {
        const [i, j] = this.pairs[p];
        const distance = this.distance(ofA, 3 * (rowA + i), ofB, 3 * (rowB + j));
        if (Number.isNaN(distance)) continue;
        sum += distance;
        count++;
        this.keep(p, f, distance);
        if (!(this.max[f] >= distance)) {
          this.max[f] = distance;
          this.worst[f] = i;
        }
      }
      if (count > 0) this.mean[f] = sum / count;
    }
  }

  distance(ofA, a, ofB, b) {
    const { ofA: s, ofB: t } = this.scales;
    const x = ofA[a] * s - ofB[b] * t;
    const y = ofA[a + 1] * s - ofB[b + 1] * t;
    const z = ofA[a + 2] * s - ofB[b + 2] * t;
    return Math.sqrt(x * x + y * y + z * z);
  }

  keep(p, frame, distance) {
    this.sums[p] += distance;
    this.counts[p]++;
    if (distance < this.greatest[p] || (distance === 0 && this.greatest[p] === 0)) return;
    this.greatest[p] = distance;
    this.frames[p] = frame;
  }

  result({ points }) {
    const byPoint = this.pairs.map(([point], p) => ({
      point,
      name: points[point].name,
      mean: this.counts[p] > 0 ? this.sums[p] / this.counts[p] : NaN,
      max: this.counts[p] > 0 ? this.greatest[p] : NaN,
      frame: this.frames[p],
    }));
    const sum = this.sums.reduce((total, x) => total + x, 0);
    const count = this.counts.reduce((total, x) => total + x, 0);
    const top = byPoint.reduce((best, one) => (one.max > best.max ? one : best), { max: -1 });
    const total = {
      mean: count > 0 ? sum / count : NaN,
      max: top.max,
      frame: top.frame,
      point: top.point,
    };
    const { mean, max, worst, pairs } = this;
    return { mean, max, worst, byPoint, pairs, total, unit: this.scales.unit };
  }
}
