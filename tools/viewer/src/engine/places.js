// Where the points of a skeleton are in many frames: the numbers of kinematics.js of the decoder,
// which is written to be read, without an array for each matrix.

import { Kinematics } from "../../../js/kinematics.js";

const NONE = -1;

/** The positions of one skeleton's points, frame after frame. */
export class Places {
  #W; // the rotation of each joint, row after row
  #origins;
  #M = new Float64Array(9);
  #R = new Float64Array(9);
  #T = new Float64Array(9);
  #v = new Float64Array(3);

  /** @param {import("../../../js/skel.js").Skeleton} skeleton that has kinematics */
  constructor(skeleton) {
    const { joints, radians, pointSet } = new Kinematics(skeleton);
    this.intrinsic = skeleton.intrinsic;
    this.radians = radians;
    this.joints = joints.map((joint) => prepared(joint, pointSet));
    this.nPoints = this.joints.reduce((sum, { nPoints }) => sum + nPoints, 0);
    this.#W = new Float64Array(9 * joints.length);
    this.#origins = new Float64Array(3 * joints.length);
  }

  /**
   * @param {ArrayLike<number>} values of all channels, row after row
   * @param {Uint8Array | null} mask 1 valid, 0 invalid; null: all are valid
   * @param {{nFrames: number, rowSize: number}} shape `rowSize` numbers from frame to frame
   * @param {Float32Array} out x, y, z of each point of each frame; NaN where it is nowhere
   */
  fill(values, mask, { nFrames, rowSize }, out) {
    const row = new Float64Array(rowSize);
    for (let frame = 0; frame < nFrames; frame++) {
      const first = frame * rowSize;
      for (let c = 0; c < rowSize; c++) {
        const value = Number(values[first + c]);
        const isThere = (mask === null || mask[first + c] === 1) && Number.isFinite(value);
        row[c] = isThere ? value : NaN;
      }
      this.#frame(row, out, frame * this.nPoints * 3);
    }
  }

  #frame(row, out, start) {
    let at = start;
    for (let j = 0; j < this.joints.length; j++) {
      const joint = this.joints[j];
      this.#turnAndPlace(joint, j, row);
      if (joint.hasOrigin) at = this.#put(out, at, this.#origins, 3 * j);
      for (const tail of joint.tails) {
        this.#arm(joint, tail[0], tail[1], tail[2], row);
        const v = this.#v;
        this.#fasten(j, v);
        at = this.#put(out, at, v, 0);
      }
    }
  }

  /** A point that is not whole is nowhere. */
  #put(out, at, from, k) {
    const x = from[k];
    const y = from[k + 1];
    const z = from[k + 2];
    const isWhole = Number.isFinite(x) && Number.isFinite(y) && Number.isFinite(z);
    out[at] = isWhole ? x : NaN;
    out[at + 1] = isWhole ? y : NaN;
    out[at + 2] = isWhole ? z : NaN;
    return at + 3;
  }

  /** v becomes origin[j] + W[j] v. */
  #fasten(j, v) {
    const W = this.#W;
    const w = 9 * j;
    const o = 3 * j;
    const origins = this.#origins;
    const [x, y, z] = v;
    v[0] = origins[o] + (W[w] * x + W[w + 1] * y + W[w + 2] * z);
    v[1] = origins[o + 1] + (W[w + 3] * x + W[w + 4] * y + W[w + 5] * z);
    v[2] = origins[o + 2] + (W[w + 6] * x + W[w + 7] * y + W[w + 8] * z);
  }

  /** W and the origin of a joint. */
  #turnAndPlace(joint, j, row) {
    const { parent, offset, positions } = joint;
    const v = this.#v;
    for (let k = 0; k < 3; k++) {
      v[k] = offset[k];
      for (const column of positions[k]) v[k] += row[column];
    }
    if (parent >= 0) {
      this.#arm(this.joints[parent], v[0], v[1], v[2], row);
      this.#fasten(parent, v);
    }
    this.#origins.set(v, 3 * j);

    const M = this.#M;
    this.#turn(joint, row);
    if (joint.turned) {
      multiply(joint.C, M, this.#T);
      multiply(this.#T, joint.inverse, M);
    }
    const W = this.#W;
    if (parent < 0) W.set(M, 9 * j);
    else (multiply(W, M, this.#T, 9 * parent), W.set(this.#T, 9 * j));
  }

  /** The product of a joint's rotations, in M. */
  #turn({ rotations }, row) {
    const M = this.#M;
    const R = this.#R;
    const T = this.#T;
    M.fill(0);
    M[0] = M[4] = M[8] = 1;
    let isFirst = true;
    for (const { axis, column, quaternion, vector } of rotations) {
      if (quaternion) quaternionRotation(quaternion, row, R);
      else if (vector) vectorRotation(vector, row, this.radians, R);
      else rotation(axis, row[column] * this.radians, R);
      if (isFirst) M.set(R);
      else if (this.intrinsic) (multiply(M, R, T), M.set(T));
      else (multiply(R, M, T), M.set(T));
      isFirst = false;
    }
  }

  /** v becomes arm(j, (x, y, z)). */
  #arm(joint, x, y, z, row) {
    const v = this.#v;
    v[0] = x;
    v[1] = y;
    v[2] = z;
    const { lengths, direction, scales, turned } = joint;
    if (lengths.length > 0) {
      let more = 0;
      for (const column of lengths) more += row[column];
      for (let k = 0; k < 3; k++) v[k] += more * direction[k];
    }
    if (scales === null) return;
    if (turned) apply(joint.inverse, v);
    for (let k = 0; k < 3; k++) if (scales[k] !== NONE) v[k] *= row[scales[k]];
    if (scales.some((column) => column !== NONE && Number.isNaN(row[column]))) v.fill(NaN);
    if (turned) apply(joint.C, v);
  }
}

function prepared(joint, pointSet) {
  const { offset, positions, positionsAdd, tails, scales } = joint;
  const replaced = (k) => positions[k].length > 0 && !positionsAdd;
  const hasOrigin = pointSet !== "acclaim" || tails.length === 0;
  const hasScales = scales.some((column) => column !== undefined);
  return {
    ...joint,
    C: Float64Array.from(joint.C),
    inverse: Float64Array.from(joint.inverse),
    offset: offset.map((x, k) => (replaced(k) ? 0 : x)),
    scales: hasScales ? scales.map((column) => column ?? NONE) : null,
    hasOrigin,
    nPoints: (hasOrigin ? 1 : 0) + tails.length,
  };
}

/** out = a b, where a begins at `first` of an array. */
function multiply(a, b, out, first = 0) {
  for (let i = 0; i < 9; i += 3) {
    const x = a[first + i];
    const y = a[first + i + 1];
    const z = a[first + i + 2];
    out[i] = x * b[0] + y * b[3] + z * b[6];
    out[i + 1] = x * b[1] + y * b[4] + z * b[7];
    out[i + 2] = x * b[2] + y * b[5] + z * b[8];
  }
}

function apply(m, v) {
  const [x, y, z] = v;
  v[0] = m[0] * x + m[1] * y + m[2] * z;
  v[1] = m[3] * x + m[4] * y + m[5] * z;
  v[2] = m[6] * x + m[7] * y + m[8] * z;
}

/** The rotation about an axis; of an angle that is not finite, NaN throughout. */
function rotation(axis, radians, R) {
  if (!Number.isFinite(radians)) {
    R.fill(NaN);
    return;
  }
  const c = Math.cos(radians);
  const s = Math.sin(radians);
  const a = (axis + 1) % 3;
  const b = (axis + 2) % 3;
  R.fill(0);
  R[4 * axis] = 1;
  R[4 * a] = R[4 * b] = c;
  R[3 * a + b] = -s;
  R[3 * b + a] = s;
}

function quaternionRotation([qw, qx, qy, qz], row, R) {
  const size = Math.hypot(row[qw], row[qx], row[qy], row[qz]);
  if (!(size > 0 && size < Infinity)) {
    R.fill(NaN);
    return;
  }
  unitQuaternionRotation(row[qw] / size, row[qx] / size, row[qy] / size, row[qz] / size, R);
}

function vectorRotation([vx, vy, vz], row, radians, R) {
  const [x, y, z] = [row[vx] * radians, row[vy] * radians, row[vz] * radians];
  const angle = Math.hypot(x, y, z);
  if (!(angle < Infinity)) {
    R.fill(NaN);
    return;
  }
  const ratio = angle < 1e-9 ? 0.5 : Math.sin(angle / 2) / angle;
  unitQuaternionRotation(Math.cos(angle / 2), x * ratio, y * ratio, z * ratio, R);
}

function unitQuaternionRotation(w, x, y, z, R) {
  R[0] = 1 - 2 * (y * y + z * z);
  R[1] = 2 * (x * y - w * z);
  R[2] = 2 * (x * z + w * y);
  R[3] = 2 * (x * y + w * z);
  R[4] = 1 - 2 * (x * x + z * z);
  R[5] = 2 * (y * z - w * x);
  R[6] = 2 * (x * z - w * y);
  R[7] = 2 * (y * z + w * x);
  R[8] = 1 - 2 * (x * x + y * y);
}
