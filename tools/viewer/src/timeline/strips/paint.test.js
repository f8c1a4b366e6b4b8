import assert from "node:assert/strict";
import { test } from "node:test";
import { rulerMarks } from "./paint.js";

const texts = (window, clip) => rulerMarks({ width: 900, ...window }, clip).map(({ text }) => text);

test("the ruler has round seconds, with the frame where one begins there", () => {
  assert.deepEqual(texts({ from: 0, to: 240 }, { rate: 120, firstFrame: 1 }).slice(0, 4), [
    "0 s · 1",
    "0.2 s · 25",
    "0.4 s · 49",
    "0.6 s · 73",
  ]);
  assert.deepEqual(texts({ from: 100, to: 200 }, { rate: 29.97, firstFrame: 1 }).slice(0, 2), ["3.5 s", "4 s"]);
});

test("without a rate the ruler has round frames", () => {
  assert.deepEqual(texts({ from: 0, to: 1000 }, { rate: null, firstFrame: 101 }).slice(0, 2), ["200", "300"]);
});

test("the ruler shows the times of frames, and none where frames are missing", () => {
  const times = Float64Array.from([...Array(10).keys(), ...Array(10).keys()], (k, at) => (at < 10 ? 1 : 3) + k / 100);
  const clip = { rate: 100, firstFrame: 101, nFrames: 20, times, step: 0.01, firstTime: 1 };
  const marks = rulerMarks({ from: 0, to: 20, width: 900 }, clip);
  assert.deepEqual(marks.map(({ frame }) => Math.round(frame)), [0, 2, 4, 6, 8, 10, 12, 14, 16, 18]);
  assert.deepEqual([marks[0].text, marks[5].text.split(" · ")[0]], ["1 s · 101", "3 s"]);
});
