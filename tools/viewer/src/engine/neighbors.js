// Lines between markers whose names say nothing: between those that stay as far apart as they are, as
// markers on one bone do. A guess from distances alone, and drawn only where somebody asks for it.

import { nextTurn } from "./turns.js";

const SAMPLES = 96; // frames that are looked at
const LEAST = 4; // frames in which both markers are seen
const CHANGE = 0.05; // of the median distance: from the least to the greatest, but for the ends
const END = 0.05; // of the distances at either end, which may be of markers that were mixed up
const DETOUR = 1.6; // of its length: a line is left out where shorter ones lead to its end within that
const LONGEST = 0.4; // of the figure: of a body no bone is longer
const MOST = 400; // points: pairs are as many as their square
const PIECE = 16; // points between two looks for other messages

/**
 * The lines of a clip of markers.
 *
 * @param {object} clip see clip.js
 * @returns {Promise<{lines: Int32Array, why: string}>} pairs of points, one behind the other; `why`
 *   there are none
 */
export async function neighborsOf(clip) {
  const nPoints = clip.facts.points.length;
  if (nPoints > MOST) return { lines: new Int32Array(0), why: `more than ${MOST} markers` };
  const samples = await samplesOf(clip);
  const longest = LONGEST * sizeOf(samples);
  const steady = new Float64Array(nPoints * nPoints).fill(NaN); // median distance of steady pairs
  for (let a = 0; a < nPoints; a++) {
    for (let b = a + 1; b < nPoints; b++) {
      steady[a * nPoints + b] = steady[b * nPoints + a] = steadyDistance(samples, a, b, longest);
    }
    if (a % PIECE === PIECE - 1) await nextTurn();
  }
  const lines = Int32Array.from(spanning(nearOf(steady, nPoints), steady, nPoints).flat());
  return { lines, why: lines.length === 0 ? "no markers keep their distance" : "" };
}

/** Places in frames all over the clip. */
async function samplesOf(clip) {
  const { nFrames } = clip;
  const samples = [];
  const count = Math.min(nFrames, SAMPLES);
  for (let k = 0; k < count; k++) {
    const frame = Math.floor(((k + 0.5) * nFrames) / count);
    samples.push(await clip.positions(frame, frame + 1));
    await nextTurn();
  }
  return samples;
}

/** The longest side of the box around all points, the median of samples. */
function sizeOf(samples) {
  const sizes = samples.map((places) => {
    const least = [Infinity, Infinity, Infinity];
    const most = [-Infinity, -Infinity, -Infinity];
    places.forEach((x, k) => {
      if (x < least[k % 3]) least[k % 3] = x;
      if (x > most[k % 3]) most[k % 3] = x;
    });
    return Math.max(...most.map((x, k) => x - least[k]));
  });
  const known = sizes.filter(Number.isFinite).sort((x, y) => x - y);
  return known[known.length >> 1] ?? 0;
}

/** The median distance of two points if it hardly changes and is not `longest` or more, else NaN. */
export function steadyDistance(samples, a, b, longest = Infinity) {
  const found = [];
  for (const places of samples) {
    const away = Math.hypot(
      places[3 * a] - places[3 * b],
      places[3 * a + 1] - places[3 * b + 1],
      places[3 * a + 2] - places[3 * b + 2],
    );
    if (!Number.isNaN(away)) found.push(away);
  }
  if (found.length < Math.min(LEAST, samples.length)) return NaN;
  found.sort((x, y) => x - y);
  const last = found.length - 1;
  const middle = found[last >> 1];
  const change = found[Math.ceil((1 - END) * last)] - found[Math.floor(END * last)];
  return middle > 0 && middle < longest && change <= CHANGE * middle ? middle : NaN;
}

/**
 * Steady pairs that no third point joins by two shorter ones: of a rigid cluster its net, of a body
 * that stands still no line across it.
 *
 * @param {Float64Array} steady distances, n x n; NaN of what is no pair
 * @returns {number[][]}
 */
export function nearOf(steady, n) {
  const pairs = [];
  for (let a = 0; a < n; a++) {
    for (let b = a + 1; b < n; b++) {
      const own = steady[a * n + b];
      if (Number.isNaN(own)) continue;
      let isJoined = false;
      for (let c = 0; c < n && !isJoined; c++) {
        isJoined = Math.max(steady[a * n + c], steady[b * n + c]) < own;
      }
      if (!isJoined) pairs.push([a, b]);
    }
  }
  return pairs;
}

/** Of some pairs those that it takes: from the shortest on, where no way along the others is as short. */
export function spanning(pairs, steady, n) {
  const lengthOf = ([a, b]) => steady[a * n + b];
  const ways = Array.from({ length: n }, () => []);
  const kept = [];
  for (const pair of [...pairs].sort((p, q) => lengthOf(p) - lengthOf(q))) {
    const [a, b] = pair;
    const own = lengthOf(pair);
    if (wayTo(ways, a, b, DETOUR * own) <= DETOUR * own) continue;
    ways[a].push([b, own]);
    ways[b].push([a, own]);
    kept.push(pair);
  }
  return kept.sort((p, q) => p[0] - q[0] || p[1] - q[1]);
}

/** The length of the shortest way between two points; Infinity where it is longer than `most`. */
function wayTo(ways, from, to, most) {
  const known = new Map([[from, 0]]);
  const open = new Set([from]);
  while (open.size > 0) {
    const at = [...open].reduce((best, point) => (known.get(point) < known.get(best) ? point : best));
    if (at === to) return known.get(at);
    open.delete(at);
    for (const [next, length] of ways[at]) {
      const sum = known.get(at) + length;
      if (sum > most || sum >= (known.get(next) ?? Infinity)) continue;
      known.set(next, sum);
      open.add(next);
    }
  }
  return Infinity;
}
