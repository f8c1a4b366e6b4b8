import assert from "node:assert/strict";
import { test } from "node:test";
import { Axes, between } from "./axes.js";
import { roundUp, scaleColor } from "./colors.js";
import { facing, gridOf, measured } from "./framing.js";

test("whatever points up becomes y, and left stays left", () => {
  for (const up of [0, 1, 2]) {
    const axes = new Axes(up, 2);
    const unit = (axis) => [
      ...axes.apply(Float32Array.of(axis === 0, axis === 1, axis === 2), new Float32Array(3)),
    ];
    assert.deepEqual(unit(up), [0, 2, 0]);
    const [x, y, z] = [0, 1, 2].map(unit);
    const cross = x.map(
      (_, k) => x[(k + 1) % 3] * y[(k + 2) % 3] - x[(k + 2) % 3] * y[(k + 1) % 3],
    );
    assert.deepEqual(
      cross.map((c) => c / 2),
      z,
    );
  }
});

test("between frames; where the next is missing, the one before", () => {
  const out = new Float32Array(3);
  assert.deepEqual([...between([0, 0, 1], [4, NaN, 1], 0.25, out)], [1, 0, 1]);
});

test("the floor is where feet are mostly, and 0 where it is nearly there", () => {
  const frame = (low) => Float32Array.of(0, low, 0, 0, low + 170, 0);
  const frames = (lows) => lows.map(frame);
  assert.deepEqual(measured(frames([50, 50, 50, 51, 50, 90, 50, 50, 50, 50, 50]), 1), {
    size: 170,
    floor: 50,
  });
  assert.equal(measured(frames([3, 4, 3]), 1).floor, 0);
  assert.deepEqual(measured([Float32Array.of(NaN, NaN, NaN)], 1), { size: 0, floor: 0 });
});

test("a figure whose left is at +x looks to +z", () => {
  const points = [{ side: "left" }, { side: "right" }];
  assert.equal(facing(points, Float32Array.of(1, 0, 0, -1, 0, 0)), 0);
  assert.ok(Math.abs(facing(points, Float32Array.of(0, 0, -1, 0, 0, 1)) - Math.PI / 2) < 1e-9); // to +x
  assert.equal(facing([{ side: "center" }], Float32Array.of(1, 0, 0)), 0);
});

test("lines of the floor are round lengths", () => {
  assert.deepEqual(gridOf(1700, 0.1), { minor: 100, major: 1000, text: "10 cm · 1 m" });
  assert.deepEqual(gridOf(20, 1), { minor: 1, major: 10, text: "1 cm · 10 cm" });
  assert.equal(gridOf(17, null).text, "1 unit · 10 units");
});

test("ends of scales", () => {
  assert.deepEqual([0.7, 1, 1.2, 30, 0, NaN].map(roundUp), [1, 1, 2, 50, 1, 1]);
  assert.deepEqual(scaleColor(-1), scaleColor(0));
  assert.deepEqual(scaleColor(2), scaleColor(1));
});
