import assert from "node:assert/strict";
import { test } from "node:test";
import { Pinch } from "./pinch.js";

const WIDTH = 500;
const N = 1000;

/** Two fingers at 100 and 300 of a window of all frames: frames 200 and 600. */
function pinch() {
  const one = new Pinch();
  const frameAt = (x) => (x / WIDTH) * N;
  one.press(1, 100, frameAt);
  assert.equal(one.move(1, 100, WIDTH, N), null); // one finger zooms nothing
  one.press(2, 300, frameAt);
  return one;
}

const frameIn = ({ from, to }, x) => from + (x / WIDTH) * (to - from);

test("each finger stays on its frame", () => {
  const one = pinch();
  one.move(1, 50, WIDTH, N);
  const window = one.move(2, 450, WIDTH, N);
  assert.ok(Math.abs(frameIn(window, 50) - 200) < 1e-9);
  assert.ok(Math.abs(frameIn(window, 450) - 600) < 1e-9);
});

test("nearer fingers show more, and never more than there is", () => {
  const one = pinch();
  const window = one.move(2, 150, WIDTH, N);
  assert.deepEqual(window, { from: 0, to: N });
});

test("fingers that meet or cross do not turn time around", () => {
  const one = pinch();
  for (const x of [100, 60, 20]) {
    const { from, to } = one.move(2, x, WIDTH, N);
    assert.ok(from >= 0 && to > from && to <= N);
  }
});

test("a finger that goes ends it; a third one pauses it", () => {
  const one = pinch();
  one.press(3, 10, () => 0);
  assert.equal(one.move(1, 0, WIDTH, N), null);
  one.release(3);
  assert.equal(one.move(1, 0, WIDTH, N), null);
  one.release(2);
  assert.ok(one.has(1) && !one.has(2)); // the one that stays does not click
});
