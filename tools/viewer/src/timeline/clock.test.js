import assert from "node:assert/strict";
import { test } from "node:test";
import { frameAt, rateOf } from "./clock.js";

const how = { rate: 100, speed: 1, nFrames: 1000, loop: false };

test("time goes on where pictures are left out", () => {
  assert.deepEqual(frameAt({ frame: 10, time: 5000 }, 5500, how), { frame: 60, ended: false });
  assert.deepEqual(frameAt({ frame: 10, time: 5000 }, 5500, { ...how, speed: 0.25 }), {
    frame: 22.5,
    ended: false,
  });
});

test("at the end it stops, or begins again", () => {
  const begun = { frame: 900, time: 0 };
  assert.deepEqual(frameAt(begun, 2000, how), { frame: 999, ended: true });
  assert.deepEqual(frameAt(begun, 2000, { ...how, loop: true }), { frame: 100, ended: false });
  assert.deepEqual(frameAt({ frame: 0, time: 0 }, 99, { ...how, nFrames: 1, loop: true }), {
    frame: 0,
    ended: true,
  });
});

test("a rate that is unknown is the usual one", () => {
  assert.equal(rateOf({ rate: null }), 120);
  assert.equal(rateOf({ rate: 30 }), 30);
  assert.equal(rateOf({ rate: Infinity }), 120);
});
