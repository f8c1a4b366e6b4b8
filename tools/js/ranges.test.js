// Files read by ranges, compared with the whole decoded at once: node --test.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { readAnnex } from "./annex-node.js";
import { MczError, decode, fromBytes, list, open, setAnnex } from "./mcz.js";

setAnnex(readAnnex);
const VECTORS = new URL("../../conformance/vectors/", import.meta.url);

function vectors(folder) {
  const names = readdirSync(new URL(folder, VECTORS), { recursive: true });
  return names.filter((name) => name.endsWith(".mcz")).sort().map((name) => `${folder}/${name}`);
}

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
  let n = 0;
  for (const name of [...vectors("valid"), ...vectors("uncommon")]) {
    if (attempt(() => decode(bytesOf(name))) === null) continue;
    try {
      await compare(name);
    } catch (error) {
      error.message = `${name}: ${error.message}`;
      throw error;
    }
    n++;
  }
  console.log(n);
});
