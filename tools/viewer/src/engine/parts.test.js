import assert from "node:assert/strict";
import { test } from "node:test";
import { Lru } from "./lru.js";
import { markerLines } from "./marker-lines.js";
import { gapsIn } from "./mcz-file.js";
import { Poses } from "./poses.js";
import { guessedUp } from "./up.js";

test("what was used last stays", () => {
  const lru = new Lru(10);
  lru.set("a", 1, 4);
  lru.set("b", 2, 4);
  assert.equal(lru.get("a"), 1);
  lru.set("c", 3, 4);
  assert.equal(lru.get("b"), undefined);
  assert.equal(lru.get("a"), 1);
  lru.set("large", 4, 100);
  assert.equal(lru.get("large"), 4);
  assert.equal(lru.get("a"), undefined);
  assert.equal(lru.bytes, 100);
});

test("frames that no segment has", () => {
  assert.deepEqual(
    gapsIn(
      [
        [0, 10],
        [20, 30],
      ],
      40,
    ),
    [
      [10, 20],
      [30, 40],
    ],
  );
  assert.deepEqual(gapsIn([], 5), [[0, 5]]);
  assert.deepEqual(gapsIn([[0, 5]], 5), []);
});

test("lines of markers, of each subject alone", () => {
  const names = ["Kim:LASI", "Kim:RASI", "Kim:LPSI", "Kim:RPSI", "Lee:LASI", "Lee:RASI"];
  const lines = markerLines(names.map((name) => ({ name })));
  assert.deepEqual(lines.map(String).sort(), ["0,1", "0,2", "1,3", "2,3"]);
  assert.deepEqual(markerLines([{ name: "M1" }, { name: "M2" }]), []);
});

test("up is from feet to head", () => {
  const points = [{ name: "Head" }, { name: "LeftFoot" }];
  assert.equal(guessedUp(points, Float32Array.of(1, 2, 17, 0, 0, 0), false), 2);
  assert.equal(guessedUp(points, Float32Array.of(-9, 2, 1, 0, 0, 0), false), 0);
  assert.equal(guessedUp([{ name: "x" }], Float32Array.of(0, 0, 0), false), 1);
  assert.equal(guessedUp([{ name: "x" }], Float32Array.of(0, 0, 0), true), 2);
});

test("blocks come as they are wanted, few at a time, and what is wanted may change", async () => {
  const asked = [];
  const engine = {
    positions: (_, from, to) =>
      new Promise((resolve) =>
        asked.push({
          from,
          to,
          answer: () => resolve(new Float32Array((to - from) * 3).fill(from)),
        }),
      ),
  };
  let arrivals = 0;
  const clip = { points: [{}], nFrames: 2000 };
  const poses = new Poses(engine, clip, () => arrivals++);
  assert.equal(poses.at(0, 3), null);
  assert.deepEqual(
    asked.map(({ from }) => from),
    [0, 256],
  );
  assert.equal(poses.at(1999, 1), null); // the blocks after 256 are not wanted any more
  asked[0].answer();
  await new Promise(setImmediate);
  assert.deepEqual(
    asked.map(({ from, to }) => [from, to]),
    [
      [0, 256],
      [256, 512],
      [1792, 2000],
    ],
  );
  asked[1].answer();
  asked[2].answer();
  await new Promise(setImmediate);
  assert.equal(arrivals, 3);
  assert.deepEqual([...poses.held(1999)], [1792, 1792, 1792]);
  assert.equal(asked.length, 3);
});
