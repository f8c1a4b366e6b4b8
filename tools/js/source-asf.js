// SPEC.md, "Source reconstruction": the skeleton that an ASF file describes, with which the SKEL
// that the file is the source of has to agree.

import { textOf } from "./bytes.js";
import { Refused } from "./errors.js";
import { latin1 } from "./text.js";

const KINDS = ["tx", "ty", "tz", "rx", "ry", "rz"]; // of the registry, from 1 on
const LENGTH_KIND = 10;
const LAST_KIND = 14; // those beyond are plain scalars
const ANGLE_UNITS = { deg: 1, rad: 2 };
const AXIS_ORDERS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"];
const WORDS = /[^\x00-\x20()]+/g;
const BLANKS = /^[\x00-\x20]+|[\x00-\x20]+$/g;
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/**
 * @param {Uint8Array} text of an ASF file
 * @param {object} skeleton that it is the source of
 * @throws {Refused} where the file describes another skeleton, or none
 */
export function checkAsf(text, skeleton) {
  const described = new AsfReader(textOfAny(text)).skeleton(skeleton.name);
  const found = { ...described, joints: described.joints.map(plain) };
  const { name, intrinsic, angleUnit, upAxis, forwardAxis, handedness, joints } = skeleton;
  const axes = { upAxis, forwardAxis, handedness };
  const stated = { name, intrinsic, angleUnit, ...axes, joints: joints.map(plain) };
  // JSON writes -0 as 0, which is equal to it.
  if (JSON.stringify(found) !== JSON.stringify(stated)) {
    throw new Refused("the source of a skeleton describes another one");
  }
}

function textOfAny(bytes) {
  try {
    return textOf(bytes, "ASF");
  } catch {
    return latin1(bytes);
  }
}

/** What of a joint an ASF file says. */
function plain({ name, parent, positionsAdd, offset, axis, axisOrder, tails, channels }) {
  const listed = channels.map(({ kind, name, unit }) => [kind > LAST_KIND ? 0 : kind, name, unit]);
  return { name, parent, positionsAdd, offset, axis, axisOrder, tails, channels: listed };
}

function refuse(message) {
  throw new Refused(`ASF: ${message}`);
}

class AsfReader {
  constructor(text) {
    this.section = "";
    this.name = "";
    this.angle = "deg";
    this.root = newBone("root");
    this.root.dofs = KINDS;
    this.position = [0, 0, 0];
    this.bones = new Map();
    this.bone = null;
    this.links = [];
    for (const line of text.split(/\r?\n|\r/)) this.line(line);
    if (this.bones.size === 0 && ![":bonedata", ":hierarchy", ":root"].includes(this.section)) {
      refuse("neither root nor bones");
    }
  }

  line(line) {
    const words = line.match(WORDS);
    if (!words || words[0].startsWith("#")) return;
    const key = words[0].toLowerCase();
    if (key.startsWith(":")) {
      this.section = key;
      if (key === ":name") {
        this.name = line.replace(BLANKS, "").slice(key.length).replace(BLANKS, "");
      }
    } else if (this.section === ":units") this.units(key, words);
    else if (this.section === ":root") this.ofRoot(key, words);
    else if (this.section === ":bonedata") this.ofBone(key, words);
    else if (this.section === ":hierarchy" && key !== "begin" && key !== "end") {
      for (const child of words.slice(1)) this.links.push([words[0], child]);
    }
  }

  units(key, words) {
    if (key !== "angle") return;
    this.angle = (words[1] ?? "").toLowerCase().slice(0, 3);
    if (!(this.angle in ANGLE_UNITS)) refuse(`angle unit ${this.angle}`);
  }

  ofRoot(key, words) {
    if (key === "order") this.root.dofs = words.slice(1).map((word) => word.toLowerCase());
    else if (key === "axis") this.root.axisOrder = orderOf(words[1]);
    else if (key === "position") this.position = vectorOf(words);
    else if (key === "orientation") this.root.axis = vectorOf(words);
  }

  ofBone(key, words) {
    if (key === "begin") {
      this.bone = newBone("");
      return;
    }
    const { bone } = this;
    if (bone === null) refuse(`${words[0]} outside of begin and end`);
    if (key === "end") {
      if (bone.name === "" || bone.name === "root" || this.bones.has(bone.name)) {
        refuse(`a bone needs a unique name, not ${bone.name}`);
      }
      this.bones.set(bone.name, bone);
      this.bone = null;
    } else if (key === "name") bone.name = words[1] ?? "";
    else if (key === "direction") bone.direction = vectorOf(words);
    else if (key === "length") bone.length = numberOf(words[1]);
    else if (key === "axis") {
      bone.axis = vectorOf(words);
      bone.axisOrder = orderOf(words[4]);
    } else if (key === "dof") bone.dofs = words.slice(1).map((word) => word.toLowerCase());
  }

  /** The skeleton; `name` is its name where the file gives none. */
  skeleton(name) {
    this.link();
    const { root } = this;
    const joints = [jointOf(root, -1, this.position, [])];
    const indices = new Map([["root", 0]]);
    for (const bone of this.parentsFirst()) {
      const parent = bone.parent === null ? -1 : indices.get(bone.parent);
      const offset = parent > 0 ? joints[parent].tails[0] : [0, 0, 0];
      const tail = bone.direction.map((x) => x * bone.length);
      if (!tail.every(Number.isFinite)) refuse("a tail that is not finite");
      indices.set(bone.name, joints.length);
      joints.push(jointOf(bone, parent, offset, [tail]));
    }
    const angleUnit = ANGLE_UNITS[this.angle];
    const axes = { upAxis: 0, forwardAxis: 0, handedness: 0 };
    return { name: this.name || name, intrinsic: false, angleUnit, ...axes, joints };
  }

  link() {
    for (const [parent, child] of this.links) {
      const bone = this.bones.get(child);
      if (!bone || (parent !== "root" && !this.bones.has(parent))) {
        refuse(`hierarchy: ${parent} ${child}: no such bone`);
      }
      if (bone.parent !== null) refuse(`hierarchy: bone ${child} has two parents`);
      bone.parent = parent;
    }
  }

  /** The bones as they were defined, one whose parent is defined later directly behind it. */
  parentsFirst() {
    const waiting = new Map();
    const placed = new Set(["root", null]);
    const result = [];
    for (const bone of this.bones.values()) {
      if (!placed.has(bone.parent)) {
        waiting.set(bone.parent, [...(waiting.get(bone.parent) ?? []), bone]);
        continue;
      }
      const ready = [bone];
      while (ready.length > 0) {
        const next = ready.pop();
        result.push(next);
        placed.add(next.name);
        ready.push(...(waiting.get(next.name) ?? []).reverse());
        waiting.delete(next.name);
      }
    }
    if (waiting.size > 0) refuse("hierarchy: bones form a cycle");
    return result;
  }
}

function newBone(name) {
  const zero = [0, 0, 0];
  return { name, direction: zero, length: 0, axis: zero, axisOrder: 0, dofs: [], parent: null };
}

function jointOf({ name, axis, axisOrder, dofs }, parent, offset, tails) {
  const channels = dofs.map(channelOf);
  return { name, parent, positionsAdd: true, offset, axis, axisOrder, tails, channels };
}

function channelOf(dof) {
  if (KINDS.includes(dof)) return { kind: KINDS.indexOf(dof) + 1, name: "", unit: "" };
  if (dof === "l") return { kind: LENGTH_KIND, name: "", unit: "" };
  return { kind: 0, name: dof, unit: "" };
}

function numberOf(word) {
  const number = NUMBER.test(word ?? "") ? Number(word) : NaN;
  if (!Number.isFinite(number)) refuse(`expected a number, not ${word}`);
  return number;
}

function vectorOf(words) {
  return [1, 2, 3].map((k) => numberOf(words[k]));
}

function orderOf(word = "XYZ") {
  const order = AXIS_ORDERS.indexOf(word.toUpperCase());
  if (order < 0) refuse(`axis order ${word}`);
  return order;
}
