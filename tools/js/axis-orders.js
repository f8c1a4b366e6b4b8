// SPEC.md, "Axis orders": joints of posewave that are coded as Euler angles in another order of axes
// than the source has, or as rotation vectors. All bits count here.

import { AXIS_ORDERS } from "./kinematics.js";
import { RULES, VECTOR, limited, rotate, turn, vectorTurn } from "./pose-metric.js";

const UNKNOWN_UNIT = 0;
const RX = 4;
const SX = 7;
const QW = 11;
const VZ = 17;
const FULL_TURNS = [0, 360, 6.283185307179586]; // by angle unit
const STEEP = 0.41421356237309503;
const MAX_TURNS = 2 ** 41;
const KINDS = 4; // of notes: a switch, turns about x, y, z

/** The angle of the direction (x, y) in the unit of a rule, at most half a turn. */
function arc(y, x, { high, low, radians }) {
  const up = Math.abs(y);
  const right = Math.abs(x);
  const large = Math.max(up, right);
  const ratio = large > 0 ? Math.min(up, right) / large : 0;
  const rest = ratio > STEEP ? (ratio - 1) / (ratio + 1) : ratio;
  const square = rest * rest;
  let sum = 1 / 41;
  for (let k = 39; k >= 1; k -= 2) sum = 1 / k - square * sum;
  const quarter = high + low;
  let angle = (rest * sum) / radians;
  if (ratio > STEEP) angle += 0.5 * quarter;
  if (up > right) angle = quarter - angle;
  if (x < 0) angle = 2 * quarter - angle;
  return y < 0 ? -angle : angle;
}

/** The rotation by angles of a sequence, or by a rotation vector, where `code` says so. */
function matrixOf(angles, code, rule) {
  if (code === VECTOR) return vectorTurn(angles.map(limited), rule.radians).R;
  const M = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  for (const axis of AXIS_ORDERS[code - 1]) rotate(M, axis, turn(angles[axis], rule));
  return M;
}

/** Angles by axis of a rotation M in a sequence: the solution around 0. */
function changed(M, [i, j, k], rule) {
  const e = j === (i + 1) % 3 ? 1 : -1;
  const first = arc(-e * M[3 * j + k], M[4 * k], rule);
  const [sine, c] = turn(first, rule);
  const s = e * sine;
  const found = [0, 0, 0];
  found[i] = first;
  found[j] = arc(e * M[3 * i + k], c * M[4 * k] - s * M[3 * j + k], rule);
  found[k] = arc(e * (c * M[3 * j + i] + s * M[3 * k + i]), c * M[4 * j] + s * M[3 * k + j], rule);
  return found;
}

/** Of a joint its columns by axis and its sequence in the source; null where it can have no code. */
export function turnsOf({ channels, firstColumn }, { intrinsic, angleUnit }) {
  const columns = [];
  const sequence = [];
  channels.forEach(({ kind }, i) => {
    if (kind < RX || kind >= SX) return;
    columns[kind - RX] = firstColumn + i;
    sequence.push(kind - RX);
  });
  const isWhole = sequence.length === 3 && new Set(sequence).size === 3;
  const hasOthers = channels.some(({ kind }) => kind >= QW && kind <= VZ);
  if (!isWhole || hasOthers || angleUnit === UNKNOWN_UNIT) return null;
  return { columns, own: intrinsic ? sequence : sequence.reverse() };
}

/** The coded joints of a clip. */
export class AxisOrders {
  /**
   * @param {import("./skel.js").Skeleton} skeleton
   * @param {ArrayLike<number>} codes of each joint, or none
   */
  constructor(skeleton, codes) {
    this.rule = RULES[skeleton.angleUnit];
    this.full = FULL_TURNS[skeleton.angleUnit];
    this.joints = Array.from(codes).flatMap((code, j) => {
      return code === 0 ? [] : [{ code, ...turnsOf(skeleton.joints[j], skeleton) }];
    });
  }

  /**
   * The notes of a segment, which begin the stream of its level 0.
   *
   * @param {import("./bytes.js").ByteReader} reader
   * @param {number} nFrames
   * @returns {Map<number, number>} by number of a note: 1 for a switch, or turns
   */
  takeNotes(reader, nFrames) {
    const notes = new Map();
    if (this.joints.length === 0) return notes;
    let number = -1;
    for (let left = reader.varint(); left > 0; left--) {
      number += 1 + reader.varint();
      if (number >= KINDS * this.joints.length * nFrames) reader.refuse("a note beyond the frames");
      if (number % KINDS === 0) {
        notes.set(number, 1);
        continue;
      }
      const turns = reader.zigzag();
      if (turns === 0 || turns >= MAX_TURNS / 2 || turns < -MAX_TURNS / 2) {
        reader.refuse(`${turns} turns`);
      }
      notes.set(number, turns);
    }
    return notes;
  }

  /**
   * Coded values to those of the source.
   *
   * @param {Float64Array} values of all frames of a segment, frame after frame; changed in place
   * @param {number} nChannels
   * @param {Map<number, number>} notes
   */
  restore(values, nChannels, notes) {
    this.joints.forEach((joint, index) => {
      const note = (f, kind) => notes.get(KINDS * (this.joints.length * f + index) + kind) ?? 0;
      this.follow(joint, values, nChannels, note);
    });
  }

  follow({ columns, code, own }, values, nChannels, note) {
    const { full } = this;
    const half = 0.5 * full;
    const other = (v, axis) => (axis === own[1] ? half - v : v + half);
    const off = (d) => Math.abs(d - full * wholeTurns(d, full));
    const turns = [0, 0, 0];
    const last = [0, 0, 0];
    let before = null;
    let isSecond = false;
    for (let f = 0; f * nChannels < values.length; f++) {
      const at = columns.map((column) => f * nChannels + column);
      const coded = at.map((place) => values[place]);
      const found = changed(matrixOf(coded, code, this.rule), own, this.rule);
      if (before !== null) {
        let [one, two] = [0, 0];
        for (const axis of own) {
          one += off(found[axis] - before[axis]);
          two += off(other(found[axis], axis) - before[axis]);
        }
        if (two < one) isSecond = !isSecond;
      }
      if (note(f, 0)) isSecond = !isSecond;
      for (const axis of own) {
        const v = isSecond ? other(found[axis], axis) : found[axis];
        if (before !== null) turns[axis] -= wholeTurns(v - last[axis], full);
        turns[axis] += note(f, 1 + axis);
        last[axis] = v;
        values[at[axis]] = v + full * turns[axis];
      }
      before = found;
    }
  }
}

/** n of SPEC.md, "Unwrapping". */
function wholeTurns(d, full) {
  const q = d / full;
  const m = Math.ceil(Math.abs(q) - 0.5);
  return q >= 0 ? m : -m;
}
