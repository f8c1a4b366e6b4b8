import assert from "node:assert/strict";
import { test } from "node:test";
import { clipOf, skeletonOf } from "../inputs/lines.js";
import { Clips } from "./clips.js";

const channels = [4, 5, 6].map((kind) => ({ kind }));
const skeleton = skeletonOf({
  intrinsic: true,
  joints: [{ name: "a", parent: -1, offset: [0, 0, 0], tails: [[1, 0, 0]], channels }],
});

/** A file of many clips, which counts how often one is read. */
function fileOfMany() {
  const file = { nRead: 0 };
  file.clip = async (index) => {
    file.nRead++;
    const values = new Float64Array(3 * 1500).fill(index);
    return clipOf({ name: `${index}`, skeleton, values, rate: 30, format: "bvh", path: "a" });
  };
  return file;
}

test("of many clips few are held, and the others are there again when they are wanted", async () => {
  const file = fileOfMany();
  const clips = new Clips(new Map([[1, file]]));
  const keys = [];
  for (let i = 0; i < 50; i++) keys.push((await clips.open(1, i)).key);
  assert.equal(new Set(keys).size, 50);
  assert.equal(clips.size, 4);
  assert.equal(file.nRead, 50);
  assert.equal((await clips.get(keys[46])).facts.name, "46");
  assert.equal(file.nRead, 50);
  const [again, twice] = await Promise.all([clips.get(keys[3]), clips.get(keys[3])]);
  assert.equal(again, twice);
  assert.deepEqual([again.key, again.facts.key, again.facts.name, file.nRead], [keys[3], keys[3], "3", 51]);
  assert.equal(await clips.get(keys[46]), await clips.get(keys[46])); // it was used, so it stayed
  assert.deepEqual([clips.size, file.nRead], [4, 51]);
});

test("clips of a closed file are closed, also those that are being opened", async () => {
  const files = new Map([[1, fileOfMany()]]);
  const clips = new Clips(files);
  const { key } = await clips.open(1, 0);
  const late = clips.open(1, 1);
  files.delete(1);
  clips.close(1);
  await late;
  assert.equal(clips.size, 0);
  await assert.rejects(clips.get(key), /this clip is closed/);
});

test("a block does not hold the whole that it is a part of", async () => {
  const clips = new Clips(new Map([[1, fileOfMany()]]));
  const clip = await clips.open(1, 7);
  const sizes = [];
  await clip.overBlocks(0, 0, 1500, ({ values }) => sizes.push([values.byteLength, values.buffer.byteLength]));
  assert.deepEqual(sizes, [512, 512, 476].map((n) => [24 * n, 24 * n]));
});
