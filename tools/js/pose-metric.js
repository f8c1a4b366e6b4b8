// SPEC.md, "Pose metric": how far points move for a small change of the channels of a pose, and
// the factor by which rows of coefficients become changes of channels. All bits count here.

import { AXIS_ORDERS, pointSet } from "./kinematics.js";

const UNKNOWN_UNIT = 0;
const TX = 1;
const RX = 4;
const SX = 7;
const QW = 11;
const VX = 15;
const MAX_PATH = 96;

/** The code of a joint whose three angles are coded as a rotation vector. */
export const VECTOR = 7;

const BEYOND = 2 ** 40;
const [LEAST_REG, GREATEST_REG] = [2 ** -100, 2 ** 100];
const GREATEST = 2 ** 120;
const GREATEST_VALUE = 2 ** 100;
const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];

/** A quarter turn and a unit in radians, of each angle unit; where it is unknown nothing turns. */
export const RULES = [
  { quarters: 0, high: 0, low: 0, radians: 0 },
  { quarters: 1 / 90, high: 90, low: 0, radians: 0.017453292519943295 },
  {
    quarters: 0.6366197723675814,
    high: 1.5707963267341256,
    low: 6.077100506506192e-11,
    radians: 1,
  },
];

const isPosition = ({ kind }) => kind >= TX && kind < RX;
const isRotation = ({ kind }) => kind >= RX && kind < SX;
const isVector = ({ kind }) => kind >= VX && kind < VX + 3;
const clamp = (v, least, greatest) => (v < least ? least : v > greatest ? greatest : v);

/** v, or 0 where it is not below 2^40 in magnitude, or not a number. */
export const limited = (v) => (Math.abs(v) < BEYOND ? v : 0);

/** The factors of a Taylor series. */
const factors = (...ks) => ks.map((k) => 1 / (k * (k + 1)));
const SINE = factors(12, 10, 8, 6, 4, 2);
const COSINE = factors(13, 11, 9, 7, 5, 3, 1);

/**
 * Sine and cosine of an angle.
 *
 * @param {number} angle in the unit of the rule
 * @param {{quarters: number, high: number, low: number, radians: number}} rule
 * @returns {[number, number]}
 */
export function turn(angle, { quarters, high, low, radians }) {
  const a = limited(angle);
  const n = Math.floor(a * quarters + 0.5);
  const r = (a - n * high - n * low) * radians;
  const q = r * r;
  let s = 1;
  let c = 1;
  for (const factor of SINE) s = 1 - q * s * factor;
  for (const factor of COSINE) c = 1 - q * c * factor;
  s = r * s;
  switch (n - 4 * Math.floor(n / 4)) {
    case 0:
      return [s, c];
    case 1:
      return [c, -s];
    case 2:
      return [-s, -c];
    default:
      return [-c, s];
  }
}

/** Factors of sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3. */
const SERIES = [2, 3, 4].map((last) =>
  factors(...[14, 12, 10, 8, 6, 4, 2, 0].map((more) => last + more)),
);

/** sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3 of s = t^2, below 256. */
function exponential(s) {
  let q = s * 2 ** -8;
  let [a, b, c] = SERIES.map((series) => series.reduce((sum, factor) => 1 - q * sum * factor, 1));
  b *= 0.5;
  c *= 0.16666666666666666;
  for (let i = 0; i < 4; i++) {
    [a, b, c] = [a * (1 - q * b), a * a * 0.5, (c + a * b) * 0.25];
    q *= 4;
  }
  return [a, b, c];
}

// Matrices are 9 numbers, row after row.

/** What a change of each part of a rotation vector turns about, and the rotation. */
export function vectorTurn(parts, radians) {
  let [x, y, z] = parts.map((part) => part * radians);
  let s = x * x + y * y + z * z;
  if (!(s < 256)) x = y = z = s = 0;
  const [a, b, c] = exponential(s);
  const spins = [
    [a + c * (x * x), c * (x * y) + b * z, c * (x * z) - b * y],
    [c * (x * y) - b * z, a + c * (y * y), c * (y * z) + b * x],
    [c * (x * z) + b * y, c * (y * z) - b * x, a + c * (z * z)],
  ].map((spin) => spin.map((part) => part * radians));
  // prettier-ignore
  const R = [
    1 - b * (y * y + z * z), b * (x * y) - a * z, b * (x * z) + a * y,
    b * (x * y) + a * z, 1 - b * (x * x + z * z), b * (y * z) - a * x,
    b * (x * z) - a * y, b * (y * z) + a * x, 1 - b * (x * x + y * y),
  ];
  return { spins, R };
}

/** The same of a quaternion. */
function quaternionTurn([p, q, r, t]) {
  const s = p * p + q * q + r * r + t * t;
  const [w, x, y, z] = s >= 2 ** -100 ? [p, q, r, t] : [1, 0, 0, 0];
  const two = s >= 2 ** -100 ? 2 / s : 2;
  const [a, i, j, k] = [w * two, x * two, y * two, z * two];
  // prettier-ignore
  const R = [
    1 - (j * y + k * z), i * y - k * w, i * z + j * w,
    i * y + k * w, 1 - (i * x + k * z), j * z - i * w,
    i * z - j * w, j * z + i * w, 1 - (i * x + j * y),
  ];
  return { spins: [[-i, -j, -k], [a, k, -j], [-k, a, i], [j, -i, a]], R };
}

/** Turns the columns of M, which begins at `at`, about one of them, in place. */
export function rotate(M, axis, [s, c], at = 0) {
  const j = (axis + 1) % 3;
  const k = (axis + 2) % 3;
  for (let row = at; row < at + 9; row += 3) {
    const one = M[row + j];
    const other = M[row + k];
    M[row + j] = one * c + other * s;
    M[row + k] = other * c - one * s;
  }
}

/** The transpose of M times v. */
const back = (M, v) => [0, 1, 2].map((k) => M[k] * v[0] + M[k + 3] * v[1] + M[k + 6] * v[2]);

/** The matrix that begins at `at` times a vector. */
function timesAt(M, at, v, out) {
  const [x, y, z] = [v[0], v[1], v[2]];
  for (let i = 0, row = at; i < 3; i++, row += 3) {
    out[i] = M[row] * x + M[row + 1] * y + M[row + 2] * z;
  }
}

const column = (M, k) => [M[k], M[k + 3], M[k + 6]];

function inverseRoot(value) {
  let v = value * 2 ** 102;
  let q = 2 ** 51;
  for (let k = 128; k >= 2; k /= 2) {
    if (v >= 2 ** k) {
      v *= 2 ** -k;
      q *= 2 ** (-k / 2);
    }
  }
  if (v >= 2) {
    v *= 0.5;
    q *= 0.7071067811865476;
  }
  let y = 1.2796 - 0.2929 * v;
  for (let i = 0; i < 4; i++) y *= 1.5 - 0.5 * v * y * y;
  return y * q;
}

/** The metric of the poses of one skeleton, and its factors. */
export class PoseMetric {
  /**
   * @param {import("./skel.js").Skeleton} skeleton
   * @param {number[]} kept the columns of its kept channels, ascending
   * @param {ArrayLike<number>} reg of each kept channel what is added to the diagonal
   * @param {{radius: number, kappa: number, spread: number, weights?: number[],
   *   orders?: ArrayLike<number>, whole?: boolean}} shell its radius, its share, that of the
   *   spread, the weights and axis orders of joints, and whether whole turns are in the metric
   */
  constructor(skeleton, kept, reg, { radius, kappa, spread, weights, orders = [], whole = false }) {
    const { joints, channels, angleUnit, intrinsic } = skeleton;
    this.nKept = kept.length;
    this.whole = whole;
    this.rule = RULES[angleUnit];
    const hasAxis = ({ axis }) => axis.some((angle) => angle !== 0);
    this.isPlain =
      angleUnit === UNKNOWN_UNIT &&
      (channels.some(isRotation) || (whole && channels.some(isVector)) || joints.some(hasAxis));
    this.usualReg = reg;
    this.stiffen(1);
    this.spread = spread;
    this.numbers = new Map(kept.map((of, number) => [of, number]));
    const points = joints.map((joint) => pointsOf(joint, pointSet(skeleton)));
    const nPoints = points.reduce((sum, own) => sum + own.length, 0);
    const C = joints.map(({ axis, axisOrder }) => {
      const M = [...IDENTITY];
      for (const k of [...AXIS_ORDERS[axisOrder]].reverse()) rotate(M, k, turn(axis[k], this.rule));
      return M;
    });
    this.frames = C;
    this.joints = joints.map((joint, j) => {
      const above = joint.parent < 0 ? IDENTITY : C[joint.parent];
      const weight = limited(weights ? weights[j] : 1);
      const heavy = ((1 - kappa) / nPoints) * weight;
      const light = (kappa / (3 * joints.length)) * weight;
      return {
        parent: joint.parent,
        change: [0, 1, 2].map((k) => back(above, column(C[j], k))),
        arm: back(above, armOf(joint)),
        moves: this.movesOf(joint, above),
        turns: this.turnsOf(joint, intrinsic, orders[j]),
        ...massOf(points[j], C[j], heavy, light, limited(radius)),
      };
    });
    this.makePaths(joints);
    // Of the pose of the moment: origin, axes, inertia (N S K) of each joint, all about the origin
    // of the root above it; motion (w v) of each kept channel.
    this.origins = new Float64Array(3 * joints.length);
    this.axes = new Float64Array(9 * joints.length);
    this.inertia = new Float64Array(10 * joints.length);
    this.motions = new Float64Array(6 * this.nKept);
  }

  /** Takes so many times what is added to the diagonal. */
  stiffen(factor) {
    this.reg = Float64Array.from(this.usualReg, (r) =>
      clamp(r * factor, LEAST_REG, GREATEST_REG),
    );
  }

  movesOf({ channels, firstColumn }, above) {
    return channels.flatMap((channel, i) => {
      if (!isPosition(channel)) return [];
      const k = channel.kind - TX;
      const from = firstColumn + i;
      const direction = above.slice(3 * k, 3 * k + 3);
      return [{ column: from, number: this.numbers.get(from), direction }];
    });
  }

  /** The rotations of a joint from the outermost to the innermost. */
  turnsOf({ channels, firstColumn }, intrinsic, order) {
    if (this.isPlain) return [];
    const wholes = this.whole ? wholesOf(channels, firstColumn) : [];
    const turns = channels.flatMap((channel, i) => {
      const from = firstColumn + i;
      const found = wholes.find(({ parts }) => Math.min(...parts) === from);
      if (found) return [{ ...found, numbers: found.parts.map((part) => this.numbers.get(part)) }];
      if (!isRotation(channel)) return [];
      return [{ axis: channel.kind - RX, column: from, number: this.numbers.get(from) }];
    });
    if (order) {
      const byAxis = [0, 1, 2].map((axis) => turns.find((one) => one.axis === axis));
      if (order !== VECTOR) return AXIS_ORDERS[order - 1].map((axis) => byAxis[axis]);
      const parts = byAxis.map((one) => one.column);
      return [{ kind: VX, parts, numbers: byAxis.map((one) => one.number) }];
    }
    return intrinsic ? turns : turns.reverse();
  }

  /** Of each kept channel its joint, -1 for a plain one, and its path; rows are one after another. */
  makePaths(joints) {
    this.jointOf = new Array(this.nKept).fill(-1);
    this.paths = Array.from(this.jointOf, (_, number) => [number]);
    const ends = [];
    joints.forEach(({ parent, channels, firstColumn }, j) => {
      let path = parent < 0 ? [] : ends[parent];
      const found = this.whole ? wholesOf(channels, firstColumn) : [];
      const wholes = new Set(found.flatMap(({ parts }) => parts));
      const own = channels.flatMap((channel, i) => {
        const number = this.numbers.get(firstColumn + i);
        const counts = isPosition(channel) || isRotation(channel) || wholes.has(firstColumn + i);
        return counts && !this.isPlain && number !== undefined ? [number] : [];
      });
      if (path.length + own.length > MAX_PATH) path = [];
      for (const number of own) {
        path = path.length === MAX_PATH ? [number] : [...path, number];
        this.paths[number] = path;
        this.jointOf[number] = j;
      }
      ends.push(path);
    });
    this.path = Int32Array.from(this.paths.flat());
    this.starts = new Int32Array(this.nKept + 1);
    this.paths.forEach(({ length }, c) => (this.starts[c + 1] = this.starts[c] + length));
  }

  /**
   * The factor at a pose: of each kept channel the entries of L on its path, and last 1 / root(D).
   *
   * @param {ArrayLike<number>} values of all channels of the skeleton
   * @returns {Float64Array}
   */
  factor(values) {
    const { joints, inertia, motions, path, starts } = this;
    this.placeAll(values);
    joints.forEach((joint, j) => this.gather(joint, j));
    for (let j = joints.length - 1; j >= 0; j--) {
      const { parent } = joints[j];
      if (parent < 0) continue;
      for (let i = 0; i < 10; i++) inertia[10 * parent + i] += inertia[10 * j + i];
    }
    const entries = new Float64Array(path.length);
    const f = new Float64Array(6);
    for (let c = 0; c < this.nKept; c++) {
      if (this.jointOf[c] < 0) continue;
      force(inertia, 10 * this.jointOf[c], motions, 6 * c, f);
      for (let at = starts[c]; at < starts[c + 1]; at++) {
        const m = 6 * path[at];
        entries[at] =
          motions[m] * f[0] +
          motions[m + 1] * f[1] +
          motions[m + 2] * f[2] +
          motions[m + 3] * f[3] +
          motions[m + 4] * f[4] +
          motions[m + 5] * f[5];
      }
      if (this.spread > 0) entries[starts[c + 1] - 1] += this.spreadOf(c);
    }
    this.eliminate(entries);
    return entries;
  }

  /** What is added to the diagonal of a channel, by what its joint moves. */
  spreadOf(c) {
    const { inertia, motions, origins, spread } = this;
    const [k, o, m] = [10 * this.jointOf[c], 3 * this.jointOf[c], 6 * c];
    const [x, y, z] = [origins[o], origins[o + 1], origins[o + 2]];
    const q = x * x + y * y + z * z;
    const u = x * inertia[k + 1] + y * inertia[k + 2] + z * inertia[k + 3];
    const sum = inertia[k + 4] + inertia[k + 5] + inertia[k + 6];
    const t = Math.max(sum + 2 * (inertia[k] * q) - 4 * u, 0);
    const [u0, u1, u2] = [motions[m], motions[m + 1], motions[m + 2]];
    return spread * (u0 * u0 + u1 * u1 + u2 * u2) * t;
  }

  /** The place of a joint's origin, 0, or of one of its tails, from 1, along its B. */
  tailOf({ tails }, j, tail) {
    return tail === 0 ? [0, 0, 0] : back(this.frames[j], tails[tail - 1].map(limited));
  }

  /** Makes a pose that of the moment. */
  placeAll(values) {
    this.joints.forEach((joint, j) => this.place(joint, j, values));
  }

  /** Origin and axes of joint j, and what its kept channels do. */
  place({ parent, change, arm, moves, turns }, j, values) {
    const { origins, axes, motions, rule } = this;
    const [above, at] = parent < 0 ? [IDENTITY, 0] : [axes, 9 * parent];
    const [o, B] = [3 * j, 9 * j];
    const v = [0, 0, 0];
    timesAt(above, at, arm, v);
    for (let k = 0; k < 3; k++) origins[o + k] = (parent < 0 ? 0 : origins[3 * parent + k]) + v[k];
    for (const { direction, column: from, number } of moves) {
      timesAt(above, at, direction, v);
      const value = limited(values[from]);
      for (let k = 0; k < 3; k++) {
        if (parent >= 0) origins[o + k] += value * v[k];
        if (number !== undefined) motions[6 * number + 3 + k] = v[k];
      }
    }
    for (let k = 0; k < 3; k++) {
      timesAt(above, at, change[k], v);
      for (let i = 0; i < 3; i++) axes[B + 3 * i + k] = v[i];
    }
    for (const { axis, column: from, number, kind, parts, numbers } of turns) {
      if (parts) {
        this.turnWhole(j, kind, parts.map((part) => limited(values[part])), numbers);
        continue;
      }
      if (number !== undefined) {
        const x = axes[B + axis] * rule.radians;
        const y = axes[B + axis + 3] * rule.radians;
        const z = axes[B + axis + 6] * rule.radians;
        this.noteTurn(number, j, x, y, z);
      }
      rotate(axes, axis, turn(values[from], rule), B);
    }
  }

  /** Notes what a kept channel does that turns joint j about the axis (x, y, z). */
  noteTurn(number, j, x, y, z) {
    const { motions, origins } = this;
    const [m, o] = [6 * number, 3 * j];
    motions[m] = x;
    motions[m + 1] = y;
    motions[m + 2] = z;
    motions[m + 3] = origins[o + 1] * z - origins[o + 2] * y;
    motions[m + 4] = origins[o + 2] * x - origins[o] * z;
    motions[m + 5] = origins[o] * y - origins[o + 1] * x;
  }

  /** Turns joint j by a quaternion or a rotation vector, and notes what its kept parts do. */
  turnWhole(j, kind, parts, numbers) {
    const { axes, rule } = this;
    const B = 9 * j;
    const { spins, R } = kind === QW ? quaternionTurn(parts) : vectorTurn(parts, rule.radians);
    const v = [0, 0, 0];
    numbers.forEach((number, part) => {
      if (number === undefined) return;
      timesAt(axes, B, spins[part], v);
      this.noteTurn(number, j, ...v);
    });
    for (let row = B; row < B + 9; row += 3) axes.set(back(R, axes.slice(row, row + 3)), row);
  }

  /** What is fastened to joint j, about the origin of its root: N, S, K. */
  gather({ mass, moment, inertia: [xx, yy, zz, xy, xz, yz] }, j) {
    const { origins, axes: B, inertia: out } = this;
    const at = 9 * j;
    const [o0, o1, o2] = [origins[3 * j], origins[3 * j + 1], origins[3 * j + 2]];
    const u = [0, 0, 0];
    timesAt(B, at, moment, u);
    const s0 = mass * o0 + u[0];
    const s1 = mass * o1 + u[1];
    const s2 = mass * o2 + u[2];
    const x = o0 * s0 + u[0] * o0;
    const y = o1 * s1 + u[1] * o1;
    const z = o2 * s2 + u[2] * o2;
    const k = 10 * j;
    out[k] = mass;
    out[k + 1] = s0;
    out[k + 2] = s1;
    out[k + 3] = s2;
    // Row i of T is the inertia along the axes times row i of B; D(i, k) is T[i] times row k of B.
    for (let i = 0; i < 3; i++) {
      const [a, b, c] = [B[at + 3 * i], B[at + 3 * i + 1], B[at + 3 * i + 2]];
      const t0 = xx * a + xy * b + xz * c;
      const t1 = xy * a + yy * b + yz * c;
      const t2 = xz * a + yz * b + zz * c;
      out[k + 4 + i] = t0 * a + t1 * b + t2 * c;
      for (let n = i + 1; n < 3; n++) {
        const row = at + 3 * n;
        out[k + 6 + i + n] = t0 * B[row] + t1 * B[row + 1] + t2 * B[row + 2];
      }
    }
    out[k + 4] += y + z;
    out[k + 5] += x + z;
    out[k + 6] += x + y;
    out[k + 7] -= o0 * s1 + u[0] * o1;
    out[k + 8] -= o0 * s2 + u[0] * o2;
    out[k + 9] -= o1 * s2 + u[1] * o2;
  }

  /** Entries of G to those of the factor, in place. */
  eliminate(entries) {
    const { path, starts } = this;
    const g = new Float64Array(MAX_PATH);
    for (let c = this.nKept - 1; c >= 0; c--) {
      const start = starts[c];
      const above = starts[c + 1] - start - 1;
      const reg = this.reg[c];
      const pivot = clamp(entries[start + above] + reg, 0.5 * reg, GREATEST);
      const h = 1 / pivot;
      for (let i = 0; i < above; i++) g[i] = clamp(entries[start + i], -GREATEST, GREATEST);
      for (let i = 0; i < above; i++) {
        const share = g[i] * h;
        const top = starts[path[start + i]];
        entries[start + i] = share;
        for (let k = 0; k <= i; k++) entries[top + k] -= share * g[k];
      }
      entries[start + above] = inverseRoot(pivot);
    }
  }

  /**
   * What a row of coefficients says of the kept channels.
   *
   * @param {Float64Array} entries a factor
   * @param {ArrayLike<number>} y of each kept channel
   * @returns {Float64Array} x, so that y = R x
   */
  fromMetric(entries, y) {
    const { path, starts } = this;
    const x = new Float64Array(this.nKept);
    for (let c = 0; c < x.length; c++) {
      const last = starts[c + 1] - 1;
      let t = y[c] * entries[last];
      for (let at = starts[c]; at < last; at++) t -= entries[at] * x[path[at]];
      x[c] = clamp(t, -GREATEST_VALUE, GREATEST_VALUE);
    }
    return x;
  }
}

/** The columns of a joint's quaternion and of its rotation vector, where it has all of one. */
function wholesOf(channels, firstColumn) {
  return [
    [QW, 4],
    [VX, 3],
  ].flatMap(([kind, nParts]) => {
    const found = Array.from({ length: nParts }, (_, part) =>
      channels.findIndex((channel) => channel.kind === kind + part),
    );
    if (found.includes(-1)) return [];
    return [{ kind, parts: found.map((i) => firstColumn + i) }];
  });
}

/** The points of a joint, as seen from its origin. */
function pointsOf({ tails }, set) {
  const origin = [0, 0, 0];
  return set === "acclaim" && tails.length > 0 ? tails : [origin, ...tails];
}

/** What of the way from the parent's origin no channel says; nothing of a root's. */
function armOf({ parent, offset, positionsAdd, channels }) {
  const replaced = (k) => !positionsAdd && channels.some(({ kind }) => kind === TX + k);
  return offset.map((x, k) => (parent < 0 || replaced(k) ? 0 : limited(x)));
}

/** What is fastened to a joint, along its axes. */
function massOf(points, C, heavy, light, radius) {
  let mass = 0;
  const moment = [0, 0, 0];
  const inertia = [0, 0, 0, 0, 0, 0];
  for (const point of points) {
    const place = back(C, point.map(limited));
    const [x, y, z] = place;
    mass += heavy;
    place.forEach((coordinate, k) => (moment[k] += heavy * coordinate));
    const added = [
      ...[heavy * (y * y + z * z), heavy * (x * x + z * z), heavy * (x * x + y * y)],
      ...[-(heavy * (x * y)), -(heavy * (x * z)), -(heavy * (y * z))],
    ];
    added.forEach((value, i) => (inertia[i] += value));
  }
  mass += 3 * light;
  back(C, [1, 1, 1]).forEach((u, k) => (moment[k] += light * radius * u));
  for (let i = 0; i < 3; i++) inertia[i] += 2 * (light * (radius * radius));
  return { mass, moment, inertia };
}

/** The moment and the force that the motion at `m` takes, of what has the inertia at `k`. */
function force(inertia, k, motions, m, f) {
  const [N, s0, s1, s2] = [inertia[k], inertia[k + 1], inertia[k + 2], inertia[k + 3]];
  const [xx, yy, zz] = [inertia[k + 4], inertia[k + 5], inertia[k + 6]];
  const [xy, xz, yz] = [inertia[k + 7], inertia[k + 8], inertia[k + 9]];
  const [w0, w1, w2] = [motions[m], motions[m + 1], motions[m + 2]];
  const [v0, v1, v2] = [motions[m + 3], motions[m + 4], motions[m + 5]];
  f[0] = xx * w0 + xy * w1 + xz * w2 + (s1 * v2 - s2 * v1);
  f[1] = xy * w0 + yy * w1 + yz * w2 + (s2 * v0 - s0 * v2);
  f[2] = xz * w0 + yz * w1 + zz * w2 + (s0 * v1 - s1 * v0);
  f[3] = N * v0 + (w1 * s2 - w2 * s1);
  f[4] = N * v1 + (w2 * s0 - w0 * s2);
  f[5] = N * v2 + (w0 * s1 - w1 * s0);
}
