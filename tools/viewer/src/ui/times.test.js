import assert from "node:assert/strict";
import { test } from "node:test";
import { frameNumber } from "./text.js";
import { clockFacts, frameAtTime, isGapAfter, nearestFrame, runsBetweenGaps, timeOf } from "./times.js";

const gap = { rate: 100, ...clockFacts(Float64Array.of(1.23, 1.24, 1.25, 1.29, 1.3, 1.31), 100) };
const even = { rate: 100, ...clockFacts(Float64Array.of(1.0, 1.01, 1.02), 100) };

test("even times are a first time and a rate", () => {
  assert.equal(even.times, null);
  assert.equal(timeOf(even, 0), 1);
  assert.equal(timeOf(even, 2), 1.02);
  assert.equal(frameAtTime(even, 1.015), 1.4999999999999902);
  assert.equal(timeOf({ rate: null, ...clockFacts(null, null) }, 3), null);
  assert.equal(timeOf({ rate: 50 }, 3), 0.06);
});

test("frames are missing where a step is longer than usual", () => {
  assert.deepEqual([...gap.times.keys()].filter((f) => isGapAfter(gap, f)), [2]);
  assert.deepEqual(runsBetweenGaps(gap, 0, 6), [[0, 3], [3, 6]]);
  assert.deepEqual(runsBetweenGaps(gap, 1.5, 2.5), [[1, 3]]);
  assert.deepEqual(runsBetweenGaps(even, 0, 3), [[0, 3]]);
});

test("a time lies between frames, at one, beyond them, or in a gap", () => {
  assert.equal(timeOf(gap, 3), 1.29);
  assert.equal(timeOf(gap, 2.9), 1.25);
  assert.equal(frameAtTime(gap, 1.29), 3);
  assert.ok(Math.abs(frameAtTime(gap, 1.245) - 1.5) < 1e-9);
  assert.equal(frameAtTime(gap, 1.27), null);
  assert.equal(Math.round(frameAtTime(gap, 1.33)), 7);
  assert.equal(Math.round(frameAtTime(gap, 1.2)), -3);
});

test("an event is at the nearest frame", () => {
  assert.equal(nearestFrame(gap, 1.26), 2);
  assert.equal(nearestFrame(gap, 1.28), 3);
  assert.equal(nearestFrame(gap, 1.302), 4);
  assert.equal(nearestFrame(even, 1.011), 1);
});

test("frames have the numbers of the file, also behind a gap", () => {
  const numbers = [{ frame: 0, number: 124 }, { frame: 3, number: 130 }];
  assert.deepEqual([0, 2, 3, 5].map((f) => frameNumber({ firstFrame: 124, numbers }, f)), [124, 126, 130, 132]);
  assert.equal(frameNumber({ firstFrame: 101, numbers: null }, 4), 105);
});
