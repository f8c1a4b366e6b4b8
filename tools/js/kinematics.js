// SPEC.md, "Kinematics": where the points of a skeleton are.

const DEGREES = 1;
const UNKNOWN_UNIT = 0;

/** Channel kinds of the registry. */
const TX = 1;
const RX = 4;
const SX = 7;
const LENGTH = 10;
const QW = 11;
const QZ = 14;
const VX = 15;
const VZ = 17;

/** Whether a channel's numbers are angles. */
const isAngle = ({ kind }) => (kind >= RX && kind < SX) || (kind >= VX && kind <= VZ);

/** Axes (0 x, 1 y, 2 z) of each axis_order, the first letter first. */
export const AXIS_ORDERS = [
  [0, 1, 2],
  [0, 2, 1],
  [1, 0, 2],
  [1, 2, 0],
  [2, 0, 1],
  [2, 1, 0],
];

// Matrices are 9 numbers, row after row.
const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const NOWHERE = new Array(9).fill(NaN);
const ORIGIN = [0, 0, 0];

function product(a, b) {
  const out = new Array(9);
  for (let i = 0; i < 9; i += 3) {
    for (let k = 0; k < 3; k++) {
      out[i + k] = a[i] * b[k] + a[i + 1] * b[k + 3] + a[i + 2] * b[k + 6];
    }
  }
  return out;
}

function applied(m, [x, y, z]) {
  return [
    m[0] * x + m[1] * y + m[2] * z,
    m[3] * x + m[4] * y + m[5] * z,
    m[6] * x + m[7] * y + m[8] * z,
  ];
}

/** The inverse of a rotation. */
function transposed(m) {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

/** The rotation about an axis, counter-clockwise seen from its positive end. */
function rotation(axis, radians) {
  const c = Math.cos(radians);
  const s = Math.sin(radians);
  if (axis === 0) return [1, 0, 0, 0, c, -s, 0, s, c];
  if (axis === 1) return [c, 0, s, 0, 1, 0, -s, 0, c];
  return [c, -s, 0, s, c, 0, 0, 0, 1];
}

/** The rotation of q / |q|; of a zero quaternion there is none. */
function quaternionRotation(q) {
  const size = Math.hypot(...q);
  if (!(size > 0 && size < Infinity)) return NOWHERE;
  const [w, x, y, z] = q.map((part) => part / size);
  // prettier-ignore
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
}

/** The rotation by |v| about v, v in radians. */
function vectorRotation(v) {
  const angle = Math.hypot(...v);
  if (!(angle < Infinity)) return NOWHERE;
  const half = angle / 2;
  // sin(half) / half is 1 to binary64 long before angle is 0.
  const ratio = half < 1e-9 ? 0.5 : Math.sin(half) / angle;
  return quaternionRotation([Math.cos(half), ...v.map((part) => part * ratio)]);
}

function sum(a, b) {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

/**
 * The point set of a skeleton.
 *
 * @param {import("./skel.js").Skeleton} skeleton
 * @returns {"markers" | "bvh" | "acclaim"}
 */
export function pointSet({ joints, intrinsic }) {
  const isMarker = ({ parent, tails, channels }) => {
    const kinds = channels.map(({ kind }) => kind).sort((a, b) => a - b);
    return parent < 0 && tails.length === 0 && String(kinds) === "1,2,3";
  };
  if (joints.length > 0 && joints.every(isMarker)) return "markers";
  return intrinsic ? "bvh" : "acclaim";
}

/**
 * Whether a skeleton has kinematics at all.
 *
 * @param {import("./skel.js").Skeleton} skeleton
 */
export function hasKinematics({ joints, channels, angleUnit }) {
  const hasAxis = ({ axis }) => axis.some((angle) => angle !== 0);
  if (angleUnit === UNKNOWN_UNIT && (channels.some(isAngle) || joints.some(hasAxis))) return false;
  return channels.length === 0 || channels.some(({ kind }) => kind >= TX && kind <= VZ);
}

/**
 * The positions of the points of a skeleton in one frame, x, y and z of each.
 *
 * @typedef {object} Pose
 * @property {number[][]} origins of each joint
 * @property {number[][][]} tails of each joint
 * @property {number[][]} points of the point set, in joint order
 */

/** Poses of one skeleton, frame after frame. */
export class Kinematics {
  /**
   * @param {import("./skel.js").Skeleton} skeleton one that has kinematics
   */
  constructor(skeleton) {
    this.skeleton = skeleton;
    this.pointSet = pointSet(skeleton);
    this.radians = skeleton.angleUnit === DEGREES ? Math.PI / 180 : 1;
    this.joints = skeleton.joints.map((joint) => this.prepared(joint));
  }

  /** What of a joint is the same in all frames. */
  prepared(joint) {
    const { axis, axisOrder, channels, tails } = joint;
    const [first, second, third] = AXIS_ORDERS[axisOrder].map((k) =>
      rotation(k, axis[k] * this.radians),
    );
    const C = product(product(third, second), first);
    const columns = (kind) =>
      channels.flatMap((channel, i) => (channel.kind === kind ? [joint.firstColumn + i] : []));
    const firstOf = (kind) => columns(kind)[0];
    const quaternion = [0, 1, 2, 3].map((part) => firstOf(QW + part));
    const vector = [0, 1, 2].map((part) => firstOf(VX + part));
    const [tail] = tails;
    const size = tail ? Math.hypot(...tail) : 0;
    return {
      ...joint,
      C,
      inverse: transposed(C),
      turned: axis.some((angle) => angle !== 0),
      positions: [0, 1, 2].map((k) => columns(TX + k)),
      scales: [0, 1, 2].map((k) => firstOf(SX + k)),
      lengths: size > 0 ? columns(LENGTH) : [],
      direction: size > 0 ? tail.map((x) => x / size) : ORIGIN,
      rotations: this.rotations(joint, quaternion, vector),
    };
  }

  /** The rotations of a joint in channel order: an axis and a column, a quaternion, a vector. */
  rotations({ channels, firstColumn }, quaternion, vector) {
    const startOf = (parts) => (parts.includes(undefined) ? undefined : Math.min(...parts));
    const [quaternionStart, vectorStart] = [startOf(quaternion), startOf(vector)];
    return channels.flatMap(({ kind }, i) => {
      const column = firstColumn + i;
      if (column === quaternionStart) return [{ quaternion }];
      if (column === vectorStart) return [{ vector }];
      return kind >= RX && kind < SX ? [{ axis: kind - RX, column }] : [];
    });
  }

  /**
   * @param {ArrayLike<number>} values of all columns of the skeleton in a frame; NaN where a value
   *   is invalid. What depends on a value that is not finite is NaN.
   * @returns {Pose}
   */
  pose(values) {
    const W = [];
    const origins = [];
    const tails = [];
    const value = (column) => (Number.isFinite(values[column]) ? values[column] : NaN);
    this.joints.forEach((joint, j) => {
      const { parent, C, inverse } = joint;
      const isRoot = parent < 0;
      const v = moved(joint, value);
      origins[j] = isRoot
        ? v
        : sum(origins[parent], applied(W[parent], this.arm(this.joints[parent], v, value)));
      let M = IDENTITY;
      for (const turn of joint.rotations) {
        const R = this.matrixOf(turn, value);
        M = this.skeleton.intrinsic ? product(M, R) : product(R, M);
      }
      const own = joint.turned ? product(product(C, M), inverse) : M;
      W[j] = isRoot ? own : product(W[parent], own);
      tails[j] = joint.tails.map((tail) =>
        sum(origins[j], applied(W[j], this.arm(joint, tail, value))),
      );
    });
    const whole = (point) => (point.every(Number.isFinite) ? point : [NaN, NaN, NaN]);
    const pose = { origins: origins.map(whole), tails: tails.map((of) => of.map(whole)) };
    return { ...pose, points: this.joints.flatMap((_, j) => this.pointsOf(pose, j)) };
  }

  pointsOf({ origins, tails }, j) {
    if (this.pointSet === "acclaim" && tails[j].length > 0) return tails[j];
    return [origins[j], ...tails[j]];
  }

  matrixOf({ axis, column, quaternion, vector }, value) {
    if (quaternion) return quaternionRotation(quaternion.map(value));
    if (vector) return vectorRotation(vector.map((part) => value(part) * this.radians));
    const angle = value(column) * this.radians;
    return Number.isFinite(angle) ? rotation(axis, angle) : NOWHERE;
  }

  /** arm(j, v): what is fastened to a joint at v, made longer and scaled. */
  arm({ lengths, direction, scales, turned, C, inverse }, v, value) {
    let out = v;
    if (lengths.length > 0) {
      const more = lengths.reduce((total, column) => total + value(column), 0);
      out = out.map((x, k) => x + more * direction[k]);
    }
    if (scales.every((column) => column === undefined)) return out;
    const S = scales.map((column) => (column === undefined ? 1 : value(column)));
    if (S.some(Number.isNaN)) return [NaN, NaN, NaN];
    const local = (turned ? applied(inverse, out) : out).map((x, k) => x * S[k]);
    return turned ? applied(C, local) : local;
  }
}

/** The offset of a joint with its position channels. */
function moved({ offset, positions, positionsAdd }, value) {
  return offset.map((x, k) => {
    const columns = positions[k];
    const start = columns.length > 0 && !positionsAdd ? 0 : x;
    return columns.reduce((at, column) => at + value(column), start);
  });
}
