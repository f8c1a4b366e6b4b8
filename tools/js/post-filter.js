// SPEC.md, "Post filter": low-pass filters for the positions of markers.

import { pointSet } from "./kinematics.js";

const REACH = 12; // rows before and after the middle one
const TAP_UNIT = 1073741824;
const GREATEST_KNOWN = 2 ** 40;
const TURN = 6.283185307179586;
const PI = 3.141592653589793;
const CUTOFFS = [1, 3, 5]; // Hz
const LOW_CM = 2;
const HIGH_CM = 12;

/**
 * Whether a motion can be filtered: a clip of markers ("Kinematics", point set `markers`) whose
 * frame rate and length unit are known.
 *
 * @param {import("./skel.js").Skeleton} skeleton whose channels are those of the motion
 * @param {{ numerator: number }} frameRate
 */
export function canFilter(skeleton, frameRate) {
  return pointSet(skeleton) === "markers" && frameRate.numerator > 0 && skeleton.unitCm !== null;
}

/** sin of t turns, t >= 0. */
function sine(t) {
  const u = t - Math.floor(t);
  const h = Math.min(u, 1 - u);
  const x = TURN * Math.min(h, 0.5 - h);
  const q = x * x;
  let s = 1;
  for (let i = 9; i >= 1; i--) s = 1 - (q * s) / (2 * i * (2 * i + 1));
  s = x * s;
  return u <= 0.5 ? s : -s;
}

/**
 * A filter of 25 taps.
 *
 * @param {number} cutoff in Hz
 * @param {number} rate rows a second
 * @returns {Float64Array} h[1] to h[12] of the rows so far before and after the middle one
 */
export function taps(cutoff, rate) {
  const f = Math.min(cutoff / rate, 0.5);
  const g = new Float64Array(REACH + 1);
  let total = 2 * f;
  for (let k = 1; k <= REACH; k++) {
    const w = 0.54 + 0.46 * sine(0.25 + k / 25);
    g[k] = (sine(f * k) / (PI * k)) * w;
  }
  for (let k = 1; k <= REACH; k++) total += 2 * g[k];
  return g.map((x) => Math.floor((x / total) * TAP_UNIT + 0.5) / TAP_UNIT);
}

/**
 * Filters the motion of a clip that {@link canFilter} allows.
 *
 * @param {object} motion
 * @param {{ numerator: number, denominator: number }} motion.frameRate
 * @param {number} motion.samplesPerFrame
 * @param {number} motion.unitCm one length unit in cm
 * @param {number} motion.nChannels
 * @param {Float64Array} values all rows of the clip
 * @param {Uint8Array | null} mask 1 where a value is valid; null: all are
 * @returns {Float64Array} as many values
 */
export function postFilter(motion, values, mask) {
  const { frameRate, samplesPerFrame, unitCm, nChannels } = motion;
  const rate = (frameRate.numerator / frameRate.denominator) * samplesPerFrame;
  const filters = CUTOFFS.map((cutoff) => taps(cutoff, rate));
  const thresholds = { low: LOW_CM / unitCm, high: HIGH_CM / unitCm };
  const out = values.slice();
  const nRows = nChannels === 0 ? 0 : values.length / nChannels;
  const run = new Float64Array(nRows + 2 * REACH);
  const known = (at) =>
    (mask === null || mask[at] === 1) && Math.abs(values[at]) < GREATEST_KNOWN;

  for (let channel = 0; channel < nChannels; channel++) {
    for (let row = 0; row < nRows; ) {
      const first = row;
      for (; row < nRows && known(row * nChannels + channel); row++) {
        run[REACH + row - first] = values[row * nChannels + channel];
      }
      const size = row - first;
      const at = first * nChannels + channel;
      if (size > 0) filterRun(run, size, filters, thresholds, out, at, nChannels);
      else row++;
    }
  }
  return out;
}

/**
 * Filters a run of known values, p[n] = run[REACH + n], of one channel.
 *
 * @param {Float64Array} run with room for 12 values before and 12 behind
 * @param {number} size N
 * @param {Float64Array[]} filters of 1, 3 and 5 Hz
 * @param {{ low: number, high: number }} thresholds in length units
 * @param {Float64Array} out where y[n] goes, at first + n * stride
 */
function filterRun(run, size, filters, { low, high }, out, first, stride) {
  run.fill(run[REACH], 0, REACH);
  run.fill(run[REACH + size - 1], REACH + size, size + 2 * REACH);
  // Y[n - 1], Y[n - 2] and Y[n - 3]
  let y1 = run[REACH];
  let y2 = y1;
  let y3 = y1;
  for (let n = 0; n < size; n++) {
    const at = REACH + n;
    const p = run[at];
    const v = y1 - y2;
    const a = v - (y2 - y3);
    const e = Math.abs(run[at - 1] + v + a / 2 - p);
    const h = filters[e <= low ? 0 : e <= high ? 1 : 2];
    let s = 0;
    for (let k = 1; k <= REACH; k++) s += h[k] * (run[at - k] - p + (run[at + k] - p));
    const y = p + s;
    out[first + n * stride] = y;
    y3 = y2;
    y2 = y1;
    y1 = y;
  }
}
