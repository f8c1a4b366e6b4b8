import assert from "node:assert/strict";
import { test } from "node:test";
import { anatomyOf, leadOf } from "./anatomy.js";

const clip = {
  points: ["root", "hips", "neck", "knee"].map((name, joint) => ({ name, joint })),
  bones: [
    [0, 1],
    [1, 2],
    [1, 3],
  ],
  isMarkers: false,
};
const pose = (height) => [0, 0, 0, 0, height, 0, 0, height + 60, 0, 0, height - 45, 0];

test("a reference on the floor, from which the hips go away a little, is no part of the figure", () => {
  const { bones, loose } = anatomyOf(clip, [pose(50), pose(51), pose(49)]);
  assert.deepEqual(bones, [
    [1, 2],
    [1, 3],
  ]);
  assert.deepEqual([...loose], [0]);
});

test("a first bone that keeps its length is one", () => {
  const { bones, loose } = anatomyOf(clip, [pose(20), pose(20)]);
  assert.equal(bones.length, 3);
  assert.equal(loose.size, 0);
});

test("curves begin with the first point of the figure that moves", () => {
  const still = [0, 0, 0];
  const at = (x, y = 0) => [...still, x, 90 + y, 0, x, 150, 0, x, 50, 0];
  assert.equal(leadOf(clip, [at(0), at(20), at(40)]), 1); // the root is a reference on the floor
  assert.equal(leadOf(clip, [at(0), at(0)]), 0); // nothing moves
  const markers = { ...clip, bones: [], isMarkers: true };
  assert.equal(leadOf(markers, [at(0), at(0, 1)]), 1);
  assert.equal(leadOf(markers, [[NaN, NaN, NaN, ...at(0).slice(3)], at(1)]), 1);
  assert.equal(leadOf({ points: [], bones: [], isMarkers: false }, []), 0);
});
