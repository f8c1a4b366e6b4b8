// What the first frames say of a clip: how large the figure is, where its floor is, where it looks.

import { FIGURE } from "./axes.js";

const FLOOR_QUANTILE = 0.1; // of the lowest points of frames: fewer are mistakes of the recording
const NEAR_ZERO = [-0.015, 0.06]; // of the figure's size: the floor is at 0 then

/**
 * @param {Float32Array[]} frames x, y, z of each point, in units of the file
 * @param {number} up axis
 * @param {Set<number>} loose points that do not count
 * @returns {{size: number, floor: number}} of the figure along its longest side, and height of the
 *   floor, in units of the file; size 0 where there is no figure
 */
export function measured(frames, up, loose = new Set()) {
  const sizes = [];
  const lowest = [];
  for (const places of frames) {
    const { least, most } = boundsOf(places, loose);
    if (least[0] > most[0]) continue;
    sizes.push(Math.max(...most.map((x, k) => x - least[k])));
    lowest.push(least[up]);
  }
  const size = quantile(sizes, 0.5);
  let floor = quantile(lowest, FLOOR_QUANTILE);
  if (floor > NEAR_ZERO[0] * size && floor < NEAR_ZERO[1] * size) floor = 0;
  return { size, floor };
}

/** Least and most of x, y and z, without points that are nowhere or do not count. */
export function boundsOf(places, loose = new Set()) {
  const least = [Infinity, Infinity, Infinity];
  const most = [-Infinity, -Infinity, -Infinity];
  for (let k = 0; k < places.length; k += 3) {
    if (Number.isNaN(places[k]) || loose.has(k / 3)) continue;
    for (let axis = 0; axis < 3; axis++) {
      least[axis] = Math.min(least[axis], places[k + axis]);
      most[axis] = Math.max(most[axis], places[k + axis]);
    }
  }
  return { least, most };
}

export function quantile(numbers, part) {
  if (numbers.length === 0) return 0;
  const sorted = [...numbers].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(part * sorted.length))];
}

/** Units of the picture for one of the file. */
export function scaleOf(size) {
  return size > 0 && Number.isFinite(size) ? FIGURE / size : 1;
}

/**
 * Where the figure looks, as an angle about y (0: to +z), from where left and right are.
 *
 * @param {{side: string}[]} points
 * @param {Float32Array} places of the picture
 */
export function facing(points, places) {
  const left = meanOf(points, places, "left");
  const right = meanOf(points, places, "right");
  if (left === null || right === null) return 0;
  const x = right[0] - left[0];
  const z = right[2] - left[2];
  return Math.hypot(x, z) < 1e-3 ? 0 : Math.atan2(z, -x);
}

function meanOf(points, places, side) {
  const sum = [0, 0, 0];
  let count = 0;
  points.forEach((point, index) => {
    if (point.side !== side || Number.isNaN(places[3 * index])) return;
    for (let k = 0; k < 3; k++) sum[k] += places[3 * index + k];
    count++;
  });
  return count === 0 ? null : sum.map((x) => x / count);
}

const CM_NAMES = {
  0.001: "0.01 mm",
  0.01: "0.1 mm",
  0.1: "1 mm",
  1: "1 cm",
  10: "10 cm",
  100: "1 m",
  1000: "10 m",
};

/**
 * Lines of the floor: a tenth of the figure and ten times that, as round lengths.
 *
 * @param {number} size of the figure, in units of the file
 * @param {number | null} unitCm
 * @returns {{minor: number, major: number, text: string}} lengths in units of the file
 */
export function gridOf(size, unitCm) {
  const length = (size || 1) * (unitCm ?? 1);
  const major = 10 ** Math.floor(Math.log10(length) + 0.15);
  const name = (value) =>
    unitCm === null
      ? `${round(value)} ${round(value) === 1 ? "unit" : "units"}`
      : (CM_NAMES[round(value)] ?? `${round(value)} cm`);
  const lengthOf = (value) => value / (unitCm ?? 1);
  return {
    minor: lengthOf(major / 10),
    major: lengthOf(major),
    text: `${name(major / 10)} · ${name(major)}`,
  };
}

const round = (value) => Number(value.toPrecision(6));
