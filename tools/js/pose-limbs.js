// SPEC.md, "Held contacts": limbs, where their points are, and how channels give way.

import { clamp } from "./entropy.js";
import { PoseMetric, RULES, back, limited, rotate, timesAt, turn } from "./pose-metric.js";

const MAX_ROUNDS = 16;
const MAX_LIMBS = 16;
const MAX_COLUMNS = 12;
const MAX_JOINTS = 64;
const GREATEST_STEP = 2 ** 60;
const GREATEST_TURN = 0.25; // in radians, of a channel
const DAMPING = 2 ** -14;
const LEAST_PIVOT = 2 ** -100;
const LAST_ROUNDS = 3; // that go on from the round before

const TX = 1;
const RX = 4;
const SX = 7;

/**
 * @param {import("./bytes.js").ByteReader} reader at CONTACTS
 * @param {import("./skel.js").Skeleton} skeleton
 * @param {number[]} orders axis orders of joints, or none
 * @returns {{rounds: number, limbs: Limb[]}}
 * @throws {import("./errors.js").Refused}
 */
export function readContacts(reader, skeleton, orders) {
  const rounds = reader.u8();
  if (rounds < 1 || rounds > MAX_ROUNDS) reader.refuse(`${rounds} rounds`);
  const metric = new PoseMetric(skeleton, [], [], { radius: 0, kappa: 0, orders });
  const limbs = reader.counted(() => new Limb(readLimb(reader, skeleton), skeleton, metric));
  if (limbs.length > MAX_LIMBS) reader.refuse(`${limbs.length} limbs`);
  return { rounds, limbs };
}

function readLimb(reader, { joints, channels }) {
  const joint = reader.varint();
  if (joint >= joints.length) reader.refuse(`joint ${joint} of ${joints.length}`);
  const tail = reader.varint();
  if (tail > joints[joint].tails.length) reader.refuse(`tail ${tail} of joint ${joint}`);
  const step = reader.f32();
  if (!(step >= 1 / GREATEST_STEP && step <= GREATEST_STEP)) reader.refuse(`a step of ${step}`);
  const path = [];
  for (let j = joint; j >= 0; j = joints[j].parent) path.unshift(j);
  if (path.length > MAX_JOINTS) reader.refuse(`joint ${joint} is below ${path.length} joints`);
  const columns = reader.counted(() => reader.varint());
  if (columns.length > MAX_COLUMNS) reader.refuse(`${columns.length} columns`);
  columns.forEach((column, i) => {
    const channel = channels[column];
    const isRotation = channel && channel.kind >= RX && channel.kind < SX;
    if (!isRotation || !path.includes(channel.joint) || (i > 0 && column <= columns[i - 1])) {
      reader.refuse(`column ${column} of a limb`);
    }
  });
  return { joint, tail, step, path, columns };
}

/** A point of a skeleton, and the channels above it that turn until it is where it should be. */
class Limb {
  constructor({ joint, tail, step, path, columns }, skeleton, metric) {
    this.step = step;
    this.columns = columns;
    this.rule = RULES[skeleton.angleUnit];
    const { radians } = this.rule;
    this.most = radians > 0 ? GREATEST_TURN / radians : 0;
    this.path = path.map((j) => metric.joints[j]);
    this.base = baseOf(skeleton.joints[path[0]]);
    const { frame } = metric.joints[joint];
    this.tail = tail > 0 ? back(frame, skeleton.joints[joint].tails[tail - 1].map(limited)) : null;
    this.numbers = new Map(columns.map((column, i) => [column, i]));
    const n = columns.length;
    /** What the corrections of the moment give: the point; of each column its axis and origin. */
    this.p = new Float64Array(3);
    this.w = new Float64Array(3 * n);
    this.s = new Float64Array(3 * n);
    this.J = new Float64Array(3 * n);
    this.none = new Float64Array(n);
    this.B = new Float64Array(9);
    this.next = new Float64Array(9);
    this.v = new Float64Array(3);
  }

  /**
   * "Turned point": sets p, w and s.
   *
   * @param {Float64Array} values
   * @param {number} at where the frame begins in them
   * @param {Float64Array} c what the columns are turned by
   */
  turned(values, at, c) {
    const { p: o, w, s, v, rule } = this;
    let { B, next } = this;
    B.set([1, 0, 0, 0, 1, 0, 0, 0, 1]);
    o.set(this.base);
    for (const { change, arm, moves, turns } of this.path) {
      timesAt(B, 0, arm, v);
      for (let k = 0; k < 3; k++) o[k] += v[k];
      for (const { column, direction } of moves) {
        timesAt(B, 0, direction, v);
        const value = limited(values[at + column]);
        for (let k = 0; k < 3; k++) o[k] += value * v[k];
      }
      for (let k = 0; k < 3; k++) {
        timesAt(B, 0, change[k], v);
        for (let i = 0; i < 3; i++) next[3 * i + k] = v[i];
      }
      [B, next] = [next, B];
      for (const { axis, column } of turns) {
        let angle = values[at + column];
        const i = this.numbers.get(column);
        if (i !== undefined) {
          angle += c[i];
          for (let k = 0; k < 3; k++) {
            w[3 * i + k] = B[3 * k + axis] * rule.radians;
            s[3 * i + k] = o[k];
          }
        }
        rotate(B, axis, turn(angle, rule));
      }
    }
    if (this.tail === null) return;
    timesAt(B, 0, this.tail, v);
    for (let k = 0; k < 3; k++) o[k] += v[k];
  }

  /** Where the point is, of values that begin at `at`. */
  place(values, at) {
    this.turned(values, at, this.none);
    return this.p.slice();
  }

  /**
   * Turns the columns until the point is at a place.
   *
   * @param {Float64Array} values
   * @param {number} at where the frame begins in them
   * @param {Float64Array} c what the columns are turned by, as the frame before has left it
   * @param {Float64Array} target
   * @param {number} rounds
   */
  reach(values, at, c, target, rounds) {
    const { p, J, most } = this;
    const g = new Float64Array(3);
    for (let round = 0; round < rounds; round++) {
      this.turned(values, at, c);
      this.setSlopes();
      const isAnew = round < rounds - LAST_ROUNDS;
      for (let k = 0; k < 3; k++) g[k] = target[k] - p[k];
      for (let i = 0; isAnew && i < c.length; i++) {
        for (let k = 0; k < 3; k++) g[k] += J[3 * i + k] * c[i];
      }
      const [x, y, z] = solved(J, g);
      for (let i = 0; i < c.length; i++) {
        const v = J[3 * i] * x + J[3 * i + 1] * y + J[3 * i + 2] * z;
        c[i] = clamp(isAnew ? v : c[i] + v, -most, most);
      }
    }
  }

  /** J: how the point moves when a column turns. */
  setSlopes() {
    const { p, w, s, J } = this;
    for (let i = 0; i < J.length; i += 3) {
      const [x, y, z] = [p[0] - s[i], p[1] - s[i + 1], p[2] - s[i + 2]];
      J[i] = w[i + 1] * z - w[i + 2] * y;
      J[i + 1] = w[i + 2] * x - w[i] * z;
      J[i + 2] = w[i] * y - w[i + 1] * x;
    }
  }
}

/** Where a root is but for its position channels. */
function baseOf({ offset, positionsAdd, channels }) {
  const replaced = (k) => !positionsAdd && channels.some(({ kind }) => kind === TX + k);
  return offset.map((x, k) => (replaced(k) ? 0 : limited(x)));
}

/** What J J' plus a little makes of a vector that is wanted: its inverse times g. */
function solved(J, g) {
  let [xx, yy, zz, xy, xz, yz] = [0, 0, 0, 0, 0, 0];
  for (let i = 0; i < J.length; i += 3) {
    xx += J[i] * J[i];
    yy += J[i + 1] * J[i + 1];
    zz += J[i + 2] * J[i + 2];
    xy += J[i] * J[i + 1];
    xz += J[i] * J[i + 2];
    yz += J[i + 1] * J[i + 2];
  }
  const least = DAMPING * (xx + yy + zz) + LEAST_PIVOT;
  const d = xx + least;
  const a = xy / d;
  const b = xz / d;
  const e = Math.max(yy + least - a * xy, least);
  const h = yz - a * xz;
  const k = h / e;
  const f = Math.max(zz + least - b * xz - k * h, least);
  let y = g[1] - a * g[0];
  const z = (g[2] - b * g[0] - k * y) / f;
  y = y / e - k * z;
  return [g[0] / d - a * y - b * z, y, z];
}
