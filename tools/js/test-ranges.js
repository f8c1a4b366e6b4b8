// Files read by ranges, compared with the whole decoded at once: node --test.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { readAnnex } from "./annex-node.js";
import { MczError, Refused, decode, fromBytes, list, open, setAnnex } from "./mcz.js";

setAnnex(readAnnex);
const VECTORS = new URL("../../conformance/vectors/", import.meta.url);

function vectors(folder) {
  const names = readdirSync(new URL(folder, VECTORS), { recursive: true });
  return names.filter((name) => name.endsWith(".mcz")).sort().map((name) => `${folder}/${name}`);
}

/** One of four, since all take long; MCZ_EVERY=1 asks for all. */
const EVERY = Number(process.env.MCZ_EVERY ?? 4);
const some = (names) => names.filter((_, i) => i % EVERY === 0);

const bytesOf = (name) => new Uint8Array(readFileSync(new URL(name, VECTORS)));

function attempt(work) {
  try {
    return work();
  } catch (error) {
    assert.ok(error instanceof MczError, error.stack);
    return null;
  }
}

/** The rows of some frames of a signal that was decoded whole. */
function cut({ nChannels, values, mask }, nFrames, [from, to]) {
  const perFrame = nFrames === 0 ? 0 : values.length / nFrames;
  const part = mask?.subarray(from * perFrame, to * perFrame);
  return {
    nChannels,
    values: values.subarray(from * perFrame, to * perFrame),
    mask: part?.includes(0) ? part : null,
  };
}

function same(found, expected, what) {
  assert.equal(found.nChannels, expected.nChannels, what);
  assert.equal(found.values.constructor, expected.values.constructor, what);
  const bytes = ({ buffer, byteOffset, byteLength }) => Buffer.from(buffer, byteOffset, byteLength);
  assert.ok(bytes(found.values).equals(bytes(expected.values)), what);
  assert.deepEqual(found.mask, expected.mask, what);
}

async function compare(name) {
  const bytes = bytesOf(name);
  const file = await open(fromBytes(bytes));
  const clips = list(bytes);
  assert.equal(file.clips.length, clips.length);
  for (const [index, facts] of clips.entries()) {
    const [whole] = decode(bytes, { clip: facts.name });
    const clip = await file.clip(index);
    assert.equal(file.clips[index].name, facts.name);
    assert.deepEqual({ ...clip.skeleton, source: 0 }, { ...facts.skeleton, source: 0 });
    assert.deepEqual(await file.metadata(index), facts.metadata);
    assert.deepEqual(await clip.quality(), facts.quality);
    const n = facts.nFrames;
    const parts = [[0, n], [n >> 1, n], [Math.floor(n / 3), Math.ceil((2 * n) / 3)], [0, n && 1]];
    for (const [s, expected] of whole.signals.entries()) {
      for (const frames of parts) {
        const found = await clip.read({ signal: s, frames });
        same(found, cut(expected, n, frames), `${name} ${facts.name} ${s} ${frames}`);
      }
    }
  }
}

test("valid vectors by ranges", async () => {
  const names = some([...vectors("valid"), ...vectors("uncommon")]);
  for (const name of names) {
    if (attempt(() => decode(bytesOf(name))) === null) continue;
    try {
      await compare(name);
    } catch (error) {
      error.message = `${name}: ${error.message}`;
      throw error;
    }
  }
});

/** Everything that a file says, read; MczError alone may be thrown. */
async function use(bytes, salvage) {
  try {
    const file = await open(fromBytes(bytes), { salvage });
    for (const { index } of file.clips) {
      const clip = await file.clip(index);
      await file.metadata(index);
      await clip.quality();
      for (const signal of clip.signals.keys()) {
        await clip.streamSizes({ signal });
        await clip.read({ signal });
      }
    }
    return file;
  } catch (error) {
    assert.ok(error instanceof MczError, error.stack);
    return null;
  }
}

test("invalid vectors are refused, or what is wrong lies where nobody looked", async () => {
  const names = some(vectors("invalid"));
  let refused = 0;
  for (const name of names) {
    if ((await use(bytesOf(name), false)) === null) refused++;
    await use(bytesOf(name), true);
  }
  assert.ok(refused > names.length / 2, `${refused} of ${names.length}`);
});

test("cut off anywhere: strictly refused, salvaged up to there", async () => {
  const bytes = bytesOf("valid/online/repeat-each.mcz");
  const [whole] = decode(bytes)[0].signals;
  let most = 0;
  for (let size = 8; size < bytes.length; size += 7) {
    const part = bytes.subarray(0, size);
    await assert.rejects(open(fromBytes(part)), Refused);
    const file = await open(fromBytes(part), { salvage: true }).catch(() => null);
    if (file === null || file.clips.length === 0) continue;
    const clip = await file.clip(0);
    const { values, lost } = await clip.read();
    assert.deepEqual(lost, []);
    assert.deepEqual(values, whole.values.subarray(0, values.length));
    assert.ok(clip.nFrames >= most);
    assert.ok(file.damage.length > 0);
    most = clip.nFrames;
  }
  assert.equal(most * whole.nChannels, whole.values.length);
});

test("a lost segment is told with its frames", async () => {
  const bytes = bytesOf("valid/pca/appended.mcz").slice();
  const whole = await open(fromBytes(bytes));
  const [, segment] = (await whole.clip(0)).segments();
  bytes[segment.offset + 9] ^= 1;
  const file = await open(fromBytes(bytes), { salvage: true });
  const clip = await file.clip(0);
  const frames = [segment.firstFrame, segment.firstFrame + segment.nFrames];
  assert.deepEqual(file.damage.find((loss) => loss.frames).frames, frames);
  const { values, mask, lost, nChannels } = await clip.read();
  assert.deepEqual(lost, [frames]);
  assert.equal(mask[frames[0] * nChannels], 0);
  assert.ok(Number.isNaN(values[frames[0] * nChannels]));
  assert.equal(mask[frames[1] * nChannels], 1);
  await assert.rejects((await (await open(fromBytes(bytes))).clip(0)).read(), Refused);
});

test("a list of clips is looked at without making them", async () => {
  const file = await open(fromBytes(bytesOf("valid/pca/appended.mcz")));
  assert.deepEqual([...file.clips].map(({ name }) => name), ["common", "second"]);
  assert.equal(file.clips.at(-1).name, "second");
  assert.equal(file.clips[2], undefined);
  assert.equal(file.clips.indexOf("second"), 1);
  assert.equal(file.clips.slice(1)[0].index, 1);
});
