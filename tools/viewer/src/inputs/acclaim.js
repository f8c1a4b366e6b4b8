// ASF and AMC, for pages that nobody serves: the skeleton and its motion, as the engine reads a clip.

import { SourceError, clipOf, numberOf, shown, skeletonOf, textOf } from "./lines.js";

const INCH_UNITS = 0.45; // CMU: a length of 0.45 units is one inch
const INCH_UNIT_CM = 2.54 / INCH_UNITS;
const KINDS = { tx: 1, ty: 2, tz: 3, rx: 4, ry: 5, rz: 6, l: 10 };
const ORDERS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"];
const USUAL = ["tx", "ty", "tz", "rx", "ry", "rz"];
const MOST_BONES = 4096;

/**
 * @param {Uint8Array} bytes of the AMC
 * @param {Uint8Array | null} skeletonBytes of its ASF
 * @param {string} name of the AMC
 * @throws {SourceError} with the number of the line
 */
export function readAmc(bytes, skeletonBytes, name) {
  if (skeletonBytes === null)
    throw new SourceError("an AMC needs its ASF: choose or drop both together");
  const skeleton = readAsf(textOf(skeletonBytes));
  const values = readFrames(textOf(bytes), skeleton);
  return clipOf({
    name: name.replace(/\.[^.]*$/, ""),
    skeleton,
    values,
    rate: null,
    format: "amc",
    path: name,
  });
}

/** The words of each line, with its number; comments and empty lines are left out. */
function* linesOf(text) {
  let number = 0;
  for (const line of text.split(/\r\n|\r|\n/)) {
    number++;
    const words = line.match(/[^\s()]+/g);
    if (words !== null && !words[0].startsWith("#")) yield { number, words, line };
  }
}

const refuse = (number, message) => {
  throw new SourceError(`line ${number}: ${message}`);
};

function vector(words, number) {
  return [0, 1, 2].map((k) => {
    const value = numberOf(words[k] ?? "");
    if (Number.isNaN(value))
      refuse(number, `expected a number, not ${shown(words[k] ?? "")}`);
    return value;
  });
}

/** @returns {import("../../../js/skel.js").Skeleton} */
function readAsf(text) {
  const asf = { section: "", name: "", length: "", angle: "deg", bones: new Map(), links: [] };
  asf.root = { name: "root", dofs: USUAL, axis: [0, 0, 0], order: "XYZ", position: [0, 0, 0] };
  for (const { number, words } of linesOf(text)) {
    const key = words[0].toLowerCase();
    if (key.startsWith(":")) {
      asf.section = key;
      if (key === ":name") asf.name = words.slice(1).join(" ");
    } else if (asf.section === ":units") readUnits(asf, key, words, number);
    else if (asf.section === ":root") readRoot(asf.root, key, words, number);
    else if (asf.section === ":bonedata") readBone(asf, key, words, number);
    else if (asf.section === ":hierarchy" && key !== "begin" && key !== "end") {
      for (const child of words.slice(1)) asf.links.push({ parent: words[0], child, number });
    }
  }
  if (asf.bones.size === 0 && asf.section === "")
    refuse(1, "no :root or :bonedata section; not an ASF file");
  return skeletonOf({
    name: asf.name,
    intrinsic: false,
    unitCm: Number(asf.length) === INCH_UNITS ? INCH_UNIT_CM : null,
    angleUnit: asf.angle === "rad" ? 2 : 1,
    joints: jointsOf(asf),
  });
}

function readUnits(asf, key, words, number) {
  if (key === "length") asf.length = words[1] ?? "";
  if (key !== "angle") return;
  asf.angle = (words[1] ?? "").toLowerCase().slice(0, 3);
  if (asf.angle !== "deg" && asf.angle !== "rad")
    refuse(number, `angle unit ${shown(words[1] ?? "")}`);
}

function orderOf(word, number) {
  const order = (word ?? "XYZ").toUpperCase();
  if (!ORDERS.includes(order)) refuse(number, `axis order ${shown(order)}`);
  return order;
}

function readRoot(root, key, words, number) {
  if (key === "order") root.dofs = words.slice(1).map((word) => word.toLowerCase());
  else if (key === "axis") root.order = orderOf(words[1], number);
  else if (key === "position") root.position = vector(words.slice(1), number);
  else if (key === "orientation") root.axis = vector(words.slice(1), number);
}

function readBone(asf, key, words, number) {
  if (key === "begin") {
    asf.bone = {
      name: "",
      direction: [0, 0, 0],
      length: 0,
      axis: [0, 0, 0],
      order: "XYZ",
      dofs: [],
      parent: null,
    };
    return;
  }
  const { bone } = asf;
  if (!bone) refuse(number, `${shown(words[0])} outside of begin and end`);
  if (key === "end") {
    if (bone.name === "" || bone.name === "root" || asf.bones.has(bone.name)) {
      refuse(number, `a bone needs a unique name, not ${shown(bone.name)}`);
    }
    if (asf.bones.size >= MOST_BONES) refuse(number, `more than ${MOST_BONES} bones`);
    asf.bones.set(bone.name, bone);
    asf.bone = null;
  } else if (key === "name") bone.name = words[1] ?? "";
  else if (key === "direction") bone.direction = vector(words.slice(1), number);
  else if (key === "length") [bone.length] = vector([words[1], "0", "0"], number);
  else if (key === "axis") {
    bone.axis = vector(words.slice(1), number);
    bone.order = orderOf(words[4], number);
  } else if (key === "dof") bone.dofs = words.slice(1).map((word) => word.toLowerCase());
}

/** The root, then bones, each behind its parent. */
function jointsOf({ root, bones, links }) {
  const children = new Map();
  for (const { parent, child, number } of links) {
    const bone = bones.get(child);
    if (!bone || (parent !== "root" && !bones.has(parent)))
      refuse(number, `${shown(parent)} ${shown(child)}: no such bone`);
    if (bone.parent !== null) refuse(number, `bone ${shown(child)} has two parents`);
    bone.parent = parent;
    if (!children.has(parent)) children.set(parent, []);
    children.get(parent).push(bone);
  }
  const joints = [jointOf(root, -1, root.position, [])];
  const waiting = [...(children.get("root") ?? [])].reverse().map((bone) => ({ bone, parent: 0 }));
  while (waiting.length > 0) {
    const { bone, parent } = waiting.pop();
    const tail = bone.direction.map((x) => x * bone.length);
    const index =
      joints.push(jointOf(bone, parent, joints[parent].tails[0] ?? [0, 0, 0], [tail])) - 1;
    for (const child of [...(children.get(bone.name) ?? [])].reverse())
      waiting.push({ bone: child, parent: index });
  }
  return joints;
}

function jointOf({ name, dofs, axis, order }, parent, offset, tails) {
  const channels = dofs.map((dof) =>
    Object.hasOwn(KINDS, dof) ? { kind: KINDS[dof] } : { kind: 0, name: dof },
  );
  return { name, parent, offset, tails, axis, axisOrder: ORDERS.indexOf(order), channels };
}

/** Rows of all columns. A bone that a frame leaves out keeps the values of the frame before. */
function readFrames(text, skeleton) {
  const columns = new Map(
    skeleton.joints.map(({ name, firstColumn, channels }) => [
      name,
      { firstColumn, n: channels.length },
    ]),
  );
  const width = skeleton.channels.length;
  const rows = [];
  let row = null;
  for (const { number, words } of linesOf(text)) {
    if (words[0].startsWith(":")) continue;
    if (words.length === 1 && /^\d+$/.test(words[0])) {
      row = row === null ? new Float64Array(width) : row.slice();
      rows.push(row);
      continue;
    }
    if (row === null) refuse(number, `${shown(words[0])} before the first frame`);
    const place = columns.get(words[0]);
    if (place === undefined) refuse(number, `bone ${shown(words[0])}, which the ASF does not have`);
    if (words.length - 1 !== place.n)
      refuse(number, `${words.length - 1} values of ${place.n} of bone ${shown(words[0])}`);
    for (let i = 0; i < place.n; i++) {
      const value = numberOf(words[i + 1]);
      if (Number.isNaN(value))
        refuse(number, `expected a number, not ${shown(words[i + 1])}`);
      row[place.firstColumn + i] = value;
    }
  }
  const values = new Float64Array(rows.length * width);
  rows.forEach((one, i) => values.set(one, i * width));
  return values;
}
