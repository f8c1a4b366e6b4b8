import assert from "node:assert/strict";
import { test } from "node:test";
import { nearOf, neighborsOf, spanning, steadyDistance } from "./neighbors.js";

/** Two rods of three markers each, that turn about their common joint, and a marker far off. */
function sample(angle) {
  const [x, y] = [Math.cos(angle), Math.sin(angle)];
  const rod = [-3, -2, -1].flatMap((s) => [s, 0, 0]);
  const other = [1, 2, 3].flatMap((s) => [s * x, s * y, 0]);
  return Float32Array.from([...rod, ...other, 40 * angle, 12, 0]);
}

const clipOf = (samples) => ({
  facts: { points: Array.from({ length: samples[0].length / 3 }) },
  nFrames: samples.length,
  positions: async (from) => samples[from],
});
const pairsOf = (lines) =>
  Array.from({ length: lines.length / 2 }, (_, k) => [lines[2 * k], lines[2 * k + 1]]);

test("lines within what is rigid, and none across what bends", async () => {
  const samples = Array.from({ length: 50 }, (_, k) => sample(0.04 * k));
  const { lines, why } = await neighborsOf(clipOf(samples));
  assert.deepEqual(pairsOf(lines), [
    [0, 1],
    [1, 2],
    [3, 4],
    [4, 5],
  ]);
  assert.equal(why, "");
});

test("what stands still has no lines across it", async () => {
  const { lines } = await neighborsOf(clipOf(Array.from({ length: 9 }, () => sample(0))));
  const ofRods = pairsOf(lines).filter((pair) => !pair.includes(6));
  assert.deepEqual(ofRods, [
    [0, 1],
    [1, 2],
    [2, 3],
    [3, 4],
    [4, 5],
  ]);
});

test("a few frames in which markers were mixed up do not count; gaps do not either", () => {
  const samples = Array.from({ length: 50 }, () => Float32Array.from([0, 0, 0, 1, 0, 0]));
  samples[7][3] = 9;
  samples[8].fill(NaN);
  assert.equal(steadyDistance(samples, 0, 1), 1);
  for (let k = 0; k < 10; k++) samples[k][3] = 1.1;
  assert.ok(Number.isNaN(steadyDistance(samples, 0, 1)));
});

test("nothing that stays is said", async () => {
  const moving = [1, 2, 4, 8, 16].map((x) => Float32Array.from([0, 0, 0, x, 0, 0]));
  const { lines, why } = await neighborsOf(clipOf(moving));
  assert.equal(lines.length, 0);
  assert.match(why, /keep their distance/);
  assert.deepEqual(nearOf(Float64Array.from([NaN, 1, 1, NaN]), 2), [[0, 1]]);
});

test("a long line beside a chain of short ones is left out, the only way is kept", () => {
  const n = 4; // 0 - 1 - 2 in a bow, 3 far off
  const steady = new Float64Array(n * n).fill(NaN);
  const pairs = [
    [0, 1, 1],
    [1, 2, 1],
    [0, 2, 1.4],
    [2, 3, 9],
  ];
  for (const [a, b, length] of pairs) steady[a * n + b] = steady[b * n + a] = length;
  const found = spanning(
    pairs.map(([a, b]) => [a, b]),
    steady,
    n,
  );
  assert.deepEqual(found, [
    [0, 1],
    [1, 2],
    [2, 3],
  ]);
});
