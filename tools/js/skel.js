// SPEC.md, "SKEL": skeletons, joints and channels.

import { ByteReader, EXTENDED, hex, joined } from "./bytes.js";
import { within } from "./limits.js";
import { checkSourceFormat } from "./registry.js";
import { inflateAfterWords } from "./words.js";

const FLAG_INTRINSIC = 1;
const FLAG_PACKED = 2;
const FLAG_ADDS = 1;
const FLAG_OFFSET = 2;
const FLAG_AXIS = 4;
const FLAG_NAME = 1;
const FLAG_UNIT = 2;
const MAX_ANGLE_UNIT = 2;
const MAX_AXIS = 6;
const MAX_HANDEDNESS = 2;
const MAX_AXIS_ORDER = 5;
const ID_SIZE = 16;

/**
 * @typedef {object} Channel
 * @property {number} kind of the registry; 0 or unknown: plain scalar
 * @property {string} name
 * @property {string} unit
 * @property {number} joint index of its joint; -1 where a signal has channels of its own
 */

/**
 * @typedef {object} Joint
 * @property {string} name
 * @property {number} parent index; -1 for a root
 * @property {boolean} positionsAdd position channels add to the offset, and do not replace it
 * @property {number[]} offset x, y, z
 * @property {number[]} axis Euler angles about x, y, z
 * @property {number} axisOrder 0 XYZ to 5 ZYX
 * @property {number[][]} tails
 * @property {Channel[]} channels
 * @property {number} firstColumn of its first channel, among those of the skeleton
 */

/**
 * @typedef {object} Skeleton
 * @property {Uint8Array} id of the chunk
 * @property {string} name
 * @property {boolean} intrinsic rotations apply about the turned axes
 * @property {number | null} unitCm one length unit in cm
 * @property {number} angleUnit 0 unknown, 1 degrees, 2 radians
 * @property {number} upAxis 0 unknown, 1 +x, 2 +y, 3 +z, 4 -x, 5 -y, 6 -z
 * @property {number} forwardAxis likewise
 * @property {number} handedness 0 unknown, 1 right, 2 left
 * @property {string | null} base id of the SKEL that it was derived from
 * @property {object | null} source how to restore its file: template, format, size, sha256
 * @property {Joint[]} joints parents before children
 * @property {Channel[]} channels of all joints, in column order
 */

/**
 * @param {Uint8Array} payload of SKEL, not packed
 * @param {Uint8Array} id of the chunk
 * @param {{limits: object, skeletons: Map, templates: Map}} file what comes before it in the file
 * @returns {Skeleton}
 * @throws {Refused}
 */
export function readSkeleton(payload, id, file) {
  const reader = new ByteReader(payload, "SKEL");
  const name = reader.text();
  const intrinsic = (reader.flags(FLAG_INTRINSIC) & FLAG_INTRINSIC) !== 0;
  const unitCm = reader.optional(() => reader.f64());
  if (unitCm !== null && !(unitCm > 0 && unitCm < Infinity)) reader.refuse(`unit_cm is ${unitCm}, not a length above 0`);
  const angleUnit = upTo(MAX_ANGLE_UNIT, reader, "angle_unit");
  const axes = readAxes(reader);
  const base = reader.optional(() => hex(reader.take(ID_SIZE)));
  if (base !== null && !file.skeletons.has(base)) {
    reader.refuse(`its base ${base} does not come before it`);
  }
  const source = reader.optional(() => readSkeletonSource(reader, file));
  const joints = readJoints(reader, file.limits);
  reader.rest();
  const channels = joints.flatMap((joint) => joint.channels);
  return { id, name, intrinsic, unitCm, angleUnit, ...axes, base, source, joints, channels };
}

function readAxes(reader) {
  const upAxis = upTo(MAX_AXIS, reader, "up_axis");
  const forwardAxis = upTo(MAX_AXIS, reader, "forward_axis");
  const handedness = upTo(MAX_HANDEDNESS, reader, "handedness");
  if (upAxis && forwardAxis && upAxis % 3 === forwardAxis % 3) {
    reader.refuse("its forward axis is parallel to its up axis"); // SKEL-10
  }
  return { upAxis, forwardAxis, handedness };
}

/**
 * @param {Uint8Array} payload of SKEL
 * @param {object} limits of the profile
 * @returns {Uint8Array} the payload that says the same and is not packed
 * @throws {Refused}
 */
export function plainSkeleton(payload, limits) {
  const reader = new ByteReader(payload, "SKEL");
  reader.text();
  const { at } = reader;
  const flags = reader.flags(FLAG_INTRINSIC | FLAG_PACKED);
  if ((flags & FLAG_PACKED) === 0) return payload;
  const size = reader.varint();
  within(size, limits.templateBytes, "bytes of a skeleton"); // SKEL-09
  const head = payload.slice(0, at + 1);
  head[at] = flags & ~FLAG_PACKED;
  return joined(head, inflateAfterWords(reader.rest(), size, "SKEL"));
}

function upTo(greatest, reader, field) {
  const value = reader.u8();
  if (value > greatest) reader.refuse(`${field} is ${value}`);
  return value;
}

function readSkeletonSource(reader, file) {
  const template = file.templates.get(hex(reader.take(ID_SIZE)));
  if (!template) reader.refuse("the SRCE of its source does not come before it");
  const format = reader.u8();
  const size = reader.varint();
  const sha256 = reader.take(32);
  checkSourceFormat(format, template, "skeleton", "SKEL");
  return { template, format, size, sha256 };
}

function readJoints(reader, limits) {
  const nJoints = reader.varint();
  within(nJoints, limits.joints, "joints of a skeleton");
  const joints = [];
  let firstColumn = 0;
  for (let index = 0; index < nJoints; index++) {
    const joint = readJoint(reader, index, firstColumn);
    joints.push(joint);
    firstColumn += joint.channels.length;
    within(firstColumn, limits.channels, "channels of a skeleton");
  }
  return joints;
}

function readJoint(reader, index, firstColumn) {
  const name = reader.text();
  const parent = reader.varint() - 1;
  if (parent >= index) reader.refuse(`joint ${index} comes before its parent ${parent}`);
  const flags = reader.flags(FLAG_ADDS | FLAG_OFFSET | FLAG_AXIS | EXTENDED);
  const offset = flags & FLAG_OFFSET ? readPoint(reader) : [0, 0, 0];
  const axis = flags & FLAG_AXIS ? readPoint(reader) : [0, 0, 0];
  const axisOrder = flags & FLAG_AXIS ? upTo(MAX_AXIS_ORDER, reader, "axis_order") : 0;
  const tails = reader.counted(readPoint);
  const channels = reader.counted(() => readChannel(reader, index));
  reader.extension(flags);
  const positionsAdd = (flags & FLAG_ADDS) !== 0;
  return { name, parent, positionsAdd, offset, axis, axisOrder, tails, channels, firstColumn };
}

function readPoint(reader) {
  const point = [reader.f64(), reader.f64(), reader.f64()];
  if (!point.every(Number.isFinite)) reader.refuse("a coordinate is not finite");
  return point;
}

/**
 * @param {ByteReader} reader at a CHANNEL
 * @param {number} joint index of its joint, or -1
 * @returns {Channel}
 */
export function readChannel(reader, joint) {
  const flags = reader.flags(FLAG_NAME | FLAG_UNIT | EXTENDED);
  const kind = reader.u8();
  const name = flags & FLAG_NAME ? reader.text() : "";
  const unit = flags & FLAG_UNIT ? reader.text() : "";
  reader.extension(flags);
  return { kind, name, unit, joint };
}
