// What is drawn of a skeleton: its points by name and side, and the bones between them.

import { pointSet } from "../../../js/kinematics.js";
import { markerLines } from "./marker-lines.js";
import { sideOf } from "./sides.js";

/**
 * @param {import("../../../js/skel.js").Skeleton} skeleton that has kinematics
 * @returns {{points: {name: string, joint: number, side: string}[], bones: number[][],
 *   isMarkers: boolean}} points in the order of the point set; bones as pairs of points
 */
export function figureOf(skeleton) {
  const set = pointSet(skeleton);
  const points = [];
  const ofJoint = skeleton.joints.map(({ name, tails }, joint) => {
    const first = points.length;
    const side = sideOf(name);
    if (set !== "acclaim" || tails.length === 0) points.push({ name, joint, side });
    tails.forEach((_, k) => points.push({ name: tailName(name, k, set), joint, side }));
    return { first, hasOrigin: set !== "acclaim" || tails.length === 0 };
  });
  if (set === "markers") return { points, bones: markerLines(points), isMarkers: true };
  return { points, bones: bonesOf(skeleton, ofJoint), isMarkers: false };
}

/** As SPEC.md, "Positions", names markers that were computed from tails. */
function tailName(name, k, set) {
  if (set === "acclaim") return k === 0 ? name : `${name} end ${k + 1}`;
  return k === 0 ? `${name} end` : `${name} end ${k + 1}`;
}

function bonesOf({ joints }, ofJoint) {
  const bones = [];
  joints.forEach((joint, j) => {
    const { first, hasOrigin } = ofJoint[j];
    const base = joint.parent < 0 ? null : startOf(joints, ofJoint, joint);
    if (hasOrigin) {
      if (base !== null) bones.push([base, first]);
      joint.tails.forEach((_, k) => bones.push([first, first + 1 + k]));
    } else if (base !== null) {
      joint.tails.forEach((_, k) => bones.push([base, first + k]));
    }
  });
  return bones;
}

/** The point of the parent that a joint is fastened to: the nearest of those that it has. */
function startOf(joints, ofJoint, { parent, offset }) {
  const { first, hasOrigin } = ofJoint[parent];
  if (hasOrigin) return first;
  const distances = joints[parent].tails.map((tail) =>
    Math.hypot(...tail.map((x, k) => x - offset[k])),
  );
  return first + distances.indexOf(Math.min(...distances));
}
