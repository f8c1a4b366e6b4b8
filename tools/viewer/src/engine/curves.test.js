import assert from "node:assert/strict";
import { test } from "node:test";
import { curvesOf } from "./curves.js";

const N = 5000;
const values = Float64Array.from({ length: 2 * N }, (_, i) => (i % 2 ? Math.sin(i / 50) : i / 2));

/** A clip of two channels, whose second is missing in some frames. */
function clipOf(mask = null) {
  return {
    facts: { signals: [{ samplesPerFrame: 1, nChannels: 2 }], points: [] },
    async overBlocks(_, from, to, visit) {
      for (let first = 0; first < N; first += 700) {
        const last = Math.min(N, first + 700);
        if (last <= from || first >= to) continue;
        const part = (array) => array && array.subarray(2 * first, 2 * last);
        visit({
          values: part(values),
          mask: part(mask),
          rowSize: 2,
          first,
          start: Math.max(first, from),
          end: Math.min(last, to),
        });
      }
    },
  };
}

test("least and most of the frames of each pixel", async () => {
  const { least, most, width } = await curvesOf(clipOf(), {
    columns: [0, 1],
    from: 100,
    to: 4900,
    width: 48,
  });
  assert.equal(width, 48);
  for (let pixel = 0; pixel < 48; pixel++) {
    const frames = Array.from({ length: 100 }, (_, i) => 100 + 100 * pixel + i);
    assert.equal(least[pixel], frames[0]);
    assert.equal(most[pixel], frames.at(-1));
    const second = frames.map((f) => Math.fround(values[2 * f + 1]));
    assert.equal(least[48 + pixel], Math.min(...second));
    assert.equal(most[48 + pixel], Math.max(...second));
  }
});

test("a pixel without a value is NaN, one with a missing value says so", async () => {
  const mask = new Uint8Array(2 * N).fill(1);
  for (let f = 150; f < 400; f++) mask[2 * f + 1] = 0;
  const { least, gaps } = await curvesOf(clipOf(mask), {
    columns: [1],
    from: 0,
    to: 1000,
    width: 10,
  });
  assert.deepEqual([...gaps], [0, 1, 1, 1, 0, 0, 0, 0, 0, 0]);
  assert.deepEqual([...least].map(Number.isNaN), [
    false,
    false,
    true,
    true,
    false,
    false,
    false,
    false,
    false,
    false,
  ]);
});

test("more pixels than frames: those between have nothing", async () => {
  const { least } = await curvesOf(clipOf(), { columns: [0], from: 0, to: 4, width: 8 });
  assert.deepEqual([...least], [0, NaN, 1, NaN, 2, NaN, 3, NaN]);
});
