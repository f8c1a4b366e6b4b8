// Files read by ranges, compared with the whole decoded at once: node --test.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";

import { readAnnex } from "./annex-node.js";
import { MczError, Refused, Unsupported } from "./errors.js";
import { analogValues, decode, fromBytes, list, open, setAnnex, sources } from "./mcz.js";
import { c3dRecording } from "./recording.js";
import { ANALOG, OUTPUTS } from "./registry.js";

setAnnex(readAnnex);
const VECTORS = new URL("../../conformance/vectors/", import.meta.url);

function vectors(folder) {
  const names = readdirSync(new URL(folder, VECTORS), { recursive: true });
  const files = names.filter((name) => name.endsWith(".mcz")).sort();
  return files.map((name) => `${folder}/${name}`);
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

test("a clip of format 0.9 is no clip of this one", async () => {
  const bytes = bytesOf("uncommon/container/format-0-9.mcz").slice();
  for (const salvage of [false, true]) {
    await assert.rejects(open(fromBytes(bytes), { salvage }), Unsupported);
  }
  bytes[24] ^= 1; // HEAD
  const file = await open(fromBytes(bytes), { salvage: true });
  assert.equal(file.clips.length, 0);
  assert.ok(file.damage.some(({ text }) => text.includes("needs version 1.97")));
});

test("no clip gets frames of the next one, where bytes between them are lost", async () => {
  const bytes = bytesOf("valid/fast/appended.mcz").slice();
  const whole = await open(fromBytes(bytes));
  const [[first], [, second]] = await Promise.all(
    [0, 1].map(async (index) => (await whole.clip(index)).segments()),
  );
  bytes.fill(0, first.offset - 16, second.offset - 16);
  for (const part of [bytes, bytes.subarray(0, bytes.length - 40)]) {
    const file = await open(fromBytes(part), { salvage: true });
    const found = [...file.clips].find(({ name }) => name === "common");
    const { values } = await (await file.clip(found.index)).read();
    assert.ok(values.every(Number.isNaN), `${values}`);
  }
});

/** Where the first chunk of a type begins. */
const chunkAt = (bytes, type) => Buffer.from(bytes).indexOf(type, 0, "latin1");

/** Salvages a file, and compares its values with those of the sound one. */
async function salvagedLike(bytes, whole) {
  const file = await open(fromBytes(bytes), { salvage: true });
  const clips = decode(whole);
  assert.deepEqual([...file.clips].map(({ name }) => name), clips.map(({ name }) => name));
  for (const [index, { nFrames, signals }] of clips.entries()) {
    const clip = await file.clip(index);
    assert.equal(clip.nFrames, nFrames);
    for (const [signal, expected] of signals.entries()) {
      const found = await clip.read({ signal });
      assert.deepEqual(found.lost, []);
      same(found, expected, `signal ${signal}`);
    }
  }
  return file;
}

test("a header with one wrong bit is put right, and no more", async () => {
  const types = ["HEAD", "SKEL", "CLIP", "DATA", "CEND"];
  for (const name of ["valid/fast/appended.mcz", "valid/online/repeat-each.mcz"]) {
    const whole = bytesOf(name);
    for (const type of types) {
      const at = chunkAt(whole, type);
      for (const bit of [0, 13, 37, 44, 50, 63, 64, 90, 127]) {
        const bytes = whole.slice();
        bytes[at + (bit >> 3)] ^= 1 << (bit & 7);
        const { damage } = await salvagedLike(bytes, whole);
        const text = `a header at ${at} has one wrong bit, which is put right`;
        assert.deepEqual(damage.map((loss) => loss.text), [text], `${name} ${type} ${bit}`);
      }
    }
    const bytes = whole.slice();
    bytes[chunkAt(bytes, "DATA") + 8] ^= 3;
    const { damage } = await open(fromBytes(bytes), { salvage: true });
    assert.ok(!damage.some(({ text }) => text.includes("put right")));
  }
});

test("copies are found where bytes were put in or cut out before them", async () => {
  const whole = bytesOf("valid/container/copies.mcz");
  const put = (at, n) => [...whole.subarray(0, at), ...new Uint8Array(n), ...whole.subarray(at)];
  for (const type of ["SKEL", "CLIP", "CEND"]) {
    const at = chunkAt(whole, type);
    const bytes = Uint8Array.from(put(8, 7));
    bytes[at + 7 + 20] ^= 1;
    const { damage } = await salvagedLike(bytes, whole);
    const text = `the copy of ${type} at ${at + 7} is used in place of what is damaged`;
    assert.ok(damage.some((loss) => loss.text === text), type);
  }
  const at = chunkAt(whole, "SKEL");
  const cut = Uint8Array.from([...whole.subarray(0, 8), ...whole.subarray(9)]);
  cut[at - 1 + 20] ^= 1;
  await salvagedLike(cut, whole);
  const unclear = Uint8Array.from(put(at, 7));
  unclear[at + 7 + 20] ^= 1;
  const { clips, damage } = await open(fromBytes(unclear), { salvage: true });
  const text = `the copy of SKEL at ${at + 7} is not used: where it belongs is not clear`;
  assert.ok(damage.some((loss) => loss.text === text));
  assert.ok(clips.length < decode(whole).length);
});

test("HEAD and aliases that are lost are those of the index", async () => {
  const whole = bytesOf("valid/sources/amc.mcz");
  const { aliases, limits } = await open(fromBytes(whole));
  assert.ok(aliases.length > 0);
  const bytes = whole.slice();
  bytes[chunkAt(bytes, "HEAD") + 16] ^= 1;
  bytes[chunkAt(bytes, "ALIA") + 16] ^= 1;
  const file = await salvagedLike(bytes, whole);
  assert.deepEqual(file.aliases, aliases);
  assert.deepEqual(file.limits, limits);
  const texts = file.damage.map(({ text }) => text);
  assert.ok(texts.includes("the file has no HEAD; it is taken from the index"));
  assert.ok(texts.includes(`the alias ${aliases[0].name} is lost; it is taken from the index`));
});

test("sources, and what a C3D says beside its numbers", async () => {
  let n = 0;
  for (const name of vectors("valid/sources")) {
    const bytes = bytesOf(name);
    const held = attempt(() => sources(bytes));
    if (held === null) continue;
    const file = await open(fromBytes(bytes));
    for (const { index } of file.clips) {
      const clip = await file.clip(index);
      const expected = held.find(({ path }) => path === clip.origin?.path);
      assert.deepEqual((await clip.source()) ?? undefined, expected?.bytes, name);
      const recording = await clip.recording();
      assert.equal(recording !== null, clip.origin?.format.startsWith("c3d") ?? false, name);
      if (recording === null) continue;
      const [motion, ...others] = clip.signals;
      const nOf = (role) => others.find((other) => other.role === role)?.nChannels ?? 0;
      assert.equal(3 * recording.points.length, motion.nChannels + nOf(OUTPUTS), name);
      assert.equal(recording.analog.length, nOf(ANALOG), name);
      n++;
    }
  }
  assert.ok(n > 0);
});

/** The source of a C3D of no frames, whose parameters are [group, name, type, dims, bytes]. */
function c3dSource(header, parameters) {
  const head = new Uint8Array(2048);
  head.set([2, 0x50]);
  header(new DataView(head.buffer));
  const ascii = (text) => [...text].map((c) => c.charCodeAt(0));
  const groups = [...new Set(parameters.map(([group]) => group))];
  const entries = groups.map((group, i) => [group.length, 255 - i, ...ascii(group), 3, 0, 0]);
  for (const [group, name, type, dims, bytes] of parameters) {
    const content = [type & 255, dims.length, ...dims, ...bytes, 0];
    const size = content.length + 2;
    const id = groups.indexOf(group) + 1;
    entries.push([name.length, id, ...ascii(name), size & 255, size >> 8, ...content]);
  }
  head.set([1, 80, 3, 84, ...entries.flat()], 512);
  const sized = (bytes) => [(bytes.length & 127) | 128, bytes.length >> 7, ...bytes];
  const template = [84, 4, 1, 0, 1, 0, 0, 1, ...sized(head), 0, 0, 0];
  const detail = Uint8Array.of(0, 1, 0, 0, 0);
  return { format: 4, template: { data: Uint8Array.from(template) }, detail };
}

test("events of a C3D: those of the group EVENT, else those of its header", () => {
  const header = (view) => {
    view.setUint16(298, 12345, true);
    view.setUint16(300, 1, true);
    view.setFloat32(304, 1.5, true);
    for (let i = 0; i < 4; i++) view.setUint8(396 + i, "RFO ".charCodeAt(i));
  };
  const none = { context: "", subject: "", description: "" };
  const units = ["POINT", "UNITS", -1, [2], [0x6d, 0x6d]];
  const found = c3dRecording(c3dSource(header, [units]));
  assert.deepEqual(found.events, [{ label: "RFO", time: 1.5, ...none }]);
  assert.equal(found.unit, "mm");
  const floats = (...numbers) => [...new Uint8Array(Float32Array.from(numbers).buffer)];
  const texts = (text) => [...text].map((c) => c.charCodeAt(0));
  const listed = c3dRecording(
    c3dSource(header, [
      ["EVENT", "USED", 2, [], [2, 0]],
      ["EVENT", "TIMES", 4, [2, 3], floats(0, 0.5, 1, 2, 0, 9)],
      ["EVENT", "LABELS", -1, [4, 2], texts("Off Down")],
      ["EVENT", "CONTEXTS", -1, [5, 2], texts("Left Right")],
    ]),
  );
  assert.deepEqual(listed.events, [
    { ...none, label: "Off", time: 0.5, context: "Left" },
    { ...none, label: "Down", time: 62, context: "Right" },
  ]);
});

test("what analog words mean", () => {
  const analog = [
    { offset: 2048, scale: 0.5 },
    { offset: 0, scale: 2 },
  ];
  const values = analogValues({ analog, generalScale: 3 }, BigInt64Array.of(2050n, 1n, 2048n, -1n));
  assert.deepEqual([...values], [3, 6, 0, -6]);
});

test("attached files, and those of aliases", async () => {
  let n = 0;
  for (const name of vectors("valid/container")) {
    const bytes = bytesOf(name);
    const file = await open(fromBytes(bytes));
    const held = new Map(attempt(() => sources(bytes))?.map((of) => [of.path, of.bytes]));
    for (const { name: path, size } of file.attachments) {
      const content = await file.attachment(path);
      assert.equal(content.length, size);
      assert.deepEqual(content, held.get(path));
      n++;
    }
  }
  assert.ok(n > 0);
});

test("a list of clips is looked at without making them", async () => {
  const file = await open(fromBytes(bytesOf("valid/pca/appended.mcz")));
  assert.deepEqual([...file.clips].map(({ name }) => name), ["common", "second"]);
  assert.equal(file.clips.at(-1).name, "second");
  assert.equal(file.clips[2], undefined);
  assert.equal(file.clips.indexOf("second"), 1);
  assert.equal(file.clips.slice(1)[0].index, 1);
});

test("a file is an array of bytes or an ArrayBuffer, and nothing else", async () => {
  const bytes = bytesOf("valid/container/attachments.mcz");
  const { buffer } = new Uint8Array(bytes);
  assert.deepEqual(list(buffer), list(bytes));
  assert.deepEqual(decode(buffer), decode(bytes));
  assert.deepEqual(sources(buffer), sources(bytes));
  assert.equal((await open(fromBytes(buffer))).clips.length, list(bytes).length);
  for (const wrong of [null, "walk.mcz", [1, 2]])
    for (const read of [list, decode, sources, fromBytes])
      assert.throws(() => read(wrong), /Uint8Array or an ArrayBuffer/);
});
