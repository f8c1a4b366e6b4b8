// In which frames a foot stands: the rule of docs/guides/contacts.md, as mcz/kinematics/contacts.py has it.

import { runsBetweenGaps } from "../ui/times.js";
import { nextTurn } from "./turns.js";

const MOST = 2 ** 18; // frames times feet that are looked at together; of more, a window
const PIECE = 1024; // frames between two looks for other messages
const USUAL_RATE = 120; // frames a second where nobody says
const FAST = { surely: 15, perhaps: 30 }; // cm/s
const HIGH = { surely: 6, perhaps: 8 }; // cm above the floor
const FLOOR = 0.05; // of all heights of the foot
const [WINDOW, GAP, LEAST] = [1 / 30, 0.025, 0.1]; // seconds

const SIDE = "(?:left|right|l|r)";
const PART = "(?:foot|fore ?foot|ankle|heel|hee|ball|toe ?base|toes?|toe0)";
const FOOT = new RegExp(`^(?:[^]*[^a-z])?(?:${SIDE} ?${PART}|${PART} ?${SIDE})$`);

/** Whether a joint of this name is a part of a foot. */
export function isFoot(name) {
  const words = name.replace(/([a-z])(?=[A-Z])/g, "$1 ").replace(/[\s_.-]+/g, " ");
  return FOOT.test(words.trim().toLowerCase());
}

/** The first points of the joints that are parts of feet. */
function feetOf({ joints, points }) {
  const firsts = new Map();
  points.forEach(({ joint }, point) => firsts.has(joint) || firsts.set(joint, point));
  return joints.flatMap(({ name }, joint) =>
    isFoot(name) && firsts.has(joint) ? [firsts.get(joint)] : [],
  );
}

/**
 * The contacts of a clip: of all its frames, of a long one only within some.
 *
 * @param {object} clip see clip.js
 * @param {{from: number, to: number, up?: number | null}} wanted `up` 0 x, 1 y, 2 z; null: as the
 *   file says, else the axis along which the body is farthest from its feet
 * @returns {Promise<{from: number, to: number, why: string, feet: {point: number, name: string,
 *   side: string, runs: number[][]}[]}>} the frames that were looked at, and pairs of frames
 *   a <= f < b in which each foot stands. Where nothing can be said there are no feet, and `why`.
 */
export function contactsOf(clip, wanted) {
  if (clip.facts.nFrames * feetOf(clip.facts).length > MOST) return found(clip, wanted);
  const up = wanted.up ?? null;
  if (held.get(clip)?.up !== up) held.set(clip, { up, contacts: found(clip, wanted) });
  return held.get(clip).contacts;
}

const held = new WeakMap(); // contacts of all frames of a clip, as they were wanted last

async function found(clip, { from, to, up = null }) {
  const { facts } = clip;
  const feet = feetOf(facts);
  const none = (why) => ({ from, to, why, feet: [] });
  if (feet.length === 0) return none("no joint is named like a foot");
  if (!(facts.unitCm > 0)) return none("the length unit is unknown, but contacts are detected by speed in cm/s");
  let range = [0, facts.nFrames];
  if (facts.nFrames * feet.length > MOST) range = [Math.max(0, from), Math.min(facts.nFrames, to)];
  const nFrames = range[1] - range[0];
  if (nFrames * feet.length > MOST) return none("too many frames to look at together");
  const known = up ?? facts.upAxis;
  const looked = new Feet(feet, nFrames, facts.points.length, known === null);
  for (let start = 0; start < nFrames; start += PIECE) {
    const end = Math.min(nFrames, start + PIECE);
    looked.add(start, await clip.positions(range[0] + start, range[0] + end));
    await nextTurn();
  }
  const axis = known ?? looked.guessedUp();
  const parts = runsBetweenGaps(facts, ...range).map((run) => run.map((f) => f - range[0]));
  const runs = looked.tracks.map((track) =>
    contactsIn(track.map((x) => x * facts.unitCm), facts.rate ?? USUAL_RATE, axis, parts),
  );
  return {
    from: range[0],
    to: range[1],
    why: "",
    feet: feet.map((point, k) => ({
      point,
      name: facts.points[point].name,
      side: facts.points[point].side,
      runs: runs[k].map(([a, b]) => [range[0] + a, range[0] + b]),
    })),
  };
}

/** Where feet are in all frames, and, where up has to be guessed, how far the body is from them. */
class Feet {
  #apart = [0, 0, 0]; // sums over frames and feet in which both are known

  constructor(points, nFrames, nPoints, guesses) {
    Object.assign(this, { points, nPoints, guesses });
    this.tracks = points.map(() => new Float64Array(3 * nFrames));
  }

  add(start, places) {
    const size = 3 * this.nPoints;
    for (let at = 0, frame = start; at < places.length; at += size, frame++) {
      const row = places.subarray(at, at + size);
      this.points.forEach((point, k) =>
        this.tracks[k].set(row.subarray(3 * point, 3 * point + 3), 3 * frame),
      );
      if (this.guesses) this.#measure(row);
    }
  }

  #measure(row) {
    const body = middle(row);
    if (body === null) return;
    for (const point of this.points) {
      const foot = row.subarray(3 * point, 3 * point + 3);
      if (foot.every(Number.isFinite)) body.forEach((x, k) => (this.#apart[k] += x - foot[k]));
    }
  }

  guessedUp() {
    const sizes = this.#apart.map(Math.abs);
    const most = Math.max(...sizes);
    return most > 0 ? sizes.indexOf(most) : 1;
  }
}

/** The mean of the points that are known, or null. */
function middle(row) {
  const sum = [0, 0, 0];
  let n = 0;
  for (let k = 0; k < row.length; k += 3) {
    if (!Number.isFinite(row[k] + row[k + 1] + row[k + 2])) continue;
    for (let i = 0; i < 3; i++) sum[i] += row[k + i];
    n++;
  }
  return n === 0 ? null : sum.map((x) => x / n);
}

/** The contacts of one foot, in each part between two gaps by itself, with the floor of the whole. */
export function contactsIn(track, rate, up, parts) {
  const floor = floorOf(track, up);
  return parts.flatMap(([start, end]) =>
    runsOf(track.subarray(3 * start, 3 * end), rate, up, floor).map((run) => run.map((f) => f + start)),
  );
}

/**
 * The contacts of one foot in frames without a gap.
 *
 * @param {Float64Array} track x, y, z of each frame in cm, not finite where unknown
 * @param {number} rate frames a second
 * @param {number} up 0 x, 1 y, 2 z
 * @returns {number[][]} pairs of frames a <= f < b
 */
export function runsOf(track, rate, up, floor = floorOf(track, up)) {
  const nFrames = track.length / 3;
  const isKnown = isKnownIn(track);
  const half = Math.max(1, framesIn(WINDOW / 2, rate));
  const below = (f, limit) => {
    const [a, b] = [Math.max(0, f - half), Math.min(nFrames - 1, f + half)];
    const way = [0, 1, 2].map((k) => track[3 * b + k] - track[3 * a + k]);
    const speed = (Math.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2) * rate) / (b - a);
    return speed < FAST[limit] && track[3 * f + up] - floor < HIGH[limit]; // NaN is never below
  };
  const all = [];
  for (let f = 0; f < nFrames; f++) {
    if (!below(f, "perhaps")) continue;
    const last = all.at(-1);
    if (last?.[1] === f) last[1]++;
    else all.push([f, f + 1]);
  }
  const least = Math.max(2, framesIn(LEAST, rate));
  return joined(all, isKnown, framesIn(GAP, rate)).filter(
    ([a, b]) => b - a >= least && some(a, b, (f) => below(f, "surely")),
  );
}

const isKnownIn = (track) => (f) =>
  Number.isFinite(track[3 * f] + track[3 * f + 1] + track[3 * f + 2]);

const framesIn = (seconds, rate) => Math.floor(seconds * rate + 0.5);

/** The height below which are 5 % of the known ones, on a line between two of them. */
function floorOf(track, up) {
  const isKnown = isKnownIn(track);
  const heights = [];
  for (let f = 0; 3 * f < track.length; f++) if (isKnown(f)) heights.push(track[3 * f + up]);
  const sorted = Float64Array.from(heights).sort();
  const at = (sorted.length - 1) * FLOOR;
  const low = Math.floor(at);
  const high = Math.min(low + 1, sorted.length - 1);
  return sorted[low] + (at - low) * (sorted[high] - sorted[low]);
}

/** Runs with at most `gap` frames between them, all of them known, as one. */
function joined(runs, isKnown, gap) {
  const out = [];
  for (const [a, b] of runs) {
    const last = out.at(-1);
    if (last && a - last[1] <= gap && !some(last[1], a, (f) => !isKnown(f))) last[1] = b;
    else out.push([a, b]);
  }
  return out;
}

function some(from, to, is) {
  for (let f = from; f < to; f++) if (is(f)) return true;
  return false;
}
