// The fast places are those of kinematics.js of the decoder, which is written to be read.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Kinematics } from "../../../js/kinematics.js";
import { Places } from "./places.js";

const [TX, RX, SX, LENGTH, QW, VX] = [1, 4, 7, 10, 11, 15];

/** Numbers that are the same every time: a linear congruence. */
function numbers(seed) {
  let state = seed;
  return () => (state = (state * 1103515245 + 12345) % 2 ** 31) / 2 ** 31;
}

/** A skeleton with all that kinematics knows. */
function skeletonOf(seed, { intrinsic, angleUnit }) {
  const next = numbers(seed);
  const vector = () => [next() - 0.5, next() - 0.5, next() - 0.5];
  const kinds = [
    [TX, TX + 1, TX + 2],
    [RX + 2, RX, RX + 1],
    [SX, SX + 2],
    [LENGTH],
    [QW, QW + 1, QW + 2, QW + 3],
    [VX, VX + 1, VX + 2],
    [0],
  ];
  let firstColumn = 0;
  const joints = Array.from({ length: 9 }, (_, j) => {
    const chosen = kinds.filter(() => next() < 0.45).flat();
    const channels = chosen.map((kind) => ({ kind, joint: j }));
    const joint = {
      name: `j${j}`,
      parent: j === 0 || next() < 0.1 ? -1 : Math.floor(next() * j),
      positionsAdd: next() < 0.5,
      offset: vector(),
      axis: next() < 0.5 ? [0, 0, 0] : vector().map((x) => 90 * x),
      axisOrder: Math.floor(next() * 6),
      tails: Array.from({ length: Math.floor(next() * 3) }, vector),
      channels,
      firstColumn,
    };
    firstColumn += channels.length;
    return joint;
  });
  return { joints, channels: joints.flatMap(({ channels }) => channels), intrinsic, angleUnit };
}

function expected(skeleton, values, mask, nFrames) {
  const slow = new Kinematics(skeleton);
  const n = skeleton.channels.length;
  return Array.from({ length: nFrames }, (_, f) => {
    const row = Array.from({ length: n }, (_, c) =>
      mask && !mask[f * n + c] ? NaN : values[f * n + c],
    );
    return slow.pose(row).points.flat();
  }).flat();
}

for (const intrinsic of [true, false]) {
  for (const angleUnit of [1, 2]) {
    test(`places of skeletons, ${intrinsic ? "turned" : "fixed"} axes, angle unit ${angleUnit}`, () => {
      for (let seed = 1; seed <= 40; seed++) {
        const skeleton = skeletonOf(seed, { intrinsic, angleUnit });
        const next = numbers(seed + 1000);
        const nFrames = 3;
        const rowSize = skeleton.channels.length;
        const values = Float64Array.from({ length: nFrames * rowSize }, () => 4 * next() - 2);
        const mask = Uint8Array.from(values, () => (next() < 0.02 ? 0 : 1));
        const places = new Places(skeleton);
        const out = new Float32Array(nFrames * places.nPoints * 3);
        places.fill(values, seed % 2 ? mask : null, { nFrames, rowSize }, out);
        const right = expected(skeleton, values, seed % 2 ? mask : null, nFrames);
        assert.equal(out.length, right.length);
        right.forEach((x, i) =>
          assert.ok(
            Object.is(out[i], Math.fround(x)) || Math.abs(out[i] - x) < 1e-6,
            `${out[i]} ${x}`,
          ),
        );
      }
    });
  }
}
