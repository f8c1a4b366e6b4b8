import assert from "node:assert/strict";
import { test } from "node:test";
import { errorsBetween, matched } from "./distances.js";

/** A clip whose points are where `at(frame, point)` says. */
function clipOf(names, nFrames, at, { rate = 100, unitCm = 1 } = {}) {
  const points = names.map((name) => ({ name }));
  return {
    nFrames,
    facts: { points, nFrames, rate, unitCm },
    async positions(from, to) {
      const out = [];
      for (let f = from; f < to; f++) names.forEach((_, p) => out.push(...at(f, p)));
      return Float32Array.from(out);
    },
  };
}

test("points are matched by name, repeated names in order", () => {
  const named = (text) => text.split("").map((name) => ({ name }));
  assert.deepEqual(matched(named("abca"), named("xaba")), [
    [0, 1],
    [1, 2],
    [3, 3],
  ]);
});

test("distances by frame and by point, in cm", async () => {
  const a = clipOf(["hip", "toe"], 600, (f, p) => [f, p, 0], { unitCm: 2 });
  const b = clipOf(
    ["toe", "hip"],
    600,
    (f, p) => [2 * f, 2 * (1 - p), p === 0 && f === 77 ? 8 : 1],
    { unitCm: 1 },
  );
  const done = [];
  const found = await errorsBetween(a, b, (part) => done.push(part));
  assert.equal(found.unit, "cm");
  assert.equal(found.mean[0], 1);
  assert.equal(found.max[77], 8);
  assert.equal(found.mean[77], 4.5);
  assert.equal(found.worst[77], 1);
  assert.deepEqual(found.total, { mean: (1199 + 8) / 1200, max: 8, frame: 77, point: 1 });
  assert.deepEqual(found.byPoint[0], { point: 0, name: "hip", mean: 1, max: 1, frame: 599 });
  assert.equal(done.at(-1), 1);
});

test("other rates are compared at the same times; missing points do not count", async () => {
  const a = clipOf(["a", "b"], 100, (f, p) => (p === 1 && f < 50 ? [NaN, NaN, NaN] : [f, 0, 0]), {
    rate: 100,
  });
  const b = clipOf(["a", "b"], 50, (f) => [2 * f, 3, 0], { rate: 50 });
  const found = await errorsBetween(a, b);
  assert.equal(found.mean.length, 100);
  assert.equal(found.mean[10], 3);
  assert.equal(found.mean[60], 3);
});

test("clips without a name in common are not compared", async () => {
  const a = clipOf(["a"], 1, () => [0, 0, 0]);
  const b = clipOf(["b"], 1, () => [0, 0, 0]);
  await assert.rejects(errorsBetween(a, b), /no points of the same names/);
});
