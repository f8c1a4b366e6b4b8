// Files on a web server: node --test.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";

import { readAnnex } from "./annex-node.js";
import { AccessError, decode, fromUrl, open, setAnnex } from "./mcz.js";

setAnnex(readAnnex);
const ROOT = new URL("../../", import.meta.url);
const MANY = "conformance/vectors/valid/fast/";

/** A server of one file whose manners a test may change. */
const USUAL = { ranges: true, suffix: true, fails: 0, short: 0, tag: "a" };
const manners = { ...USUAL, bytes: new Uint8Array(0) };
const asked = [];
let server;
let address;

before(async () => {
  server = createServer(answer);
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}/file.mcz`;
});
after(() => server.close());

function answer(request, response) {
  const { bytes, ranges, suffix, tag } = manners;
  const { range } = request.headers;
  asked.push(range ?? request.method);
  response.setHeader("ETag", `"${tag}"`);
  response.setHeader("Connection", "close");
  if (manners.fails > 0) {
    manners.fails--;
    response.writeHead(503).end();
  } else if (range === undefined || !ranges) {
    response.setHeader("Content-Length", bytes.length);
    response.end(request.method === "HEAD" ? undefined : bytes);
  } else if (range.startsWith("bytes=-") && !suffix) {
    response.writeHead(416).end();
  } else {
    const [, from, to] = /^bytes=(\d*)-(\d+)$/.exec(range);
    const start = from === "" ? Math.max(0, bytes.length - to) : Number(from);
    const stop = from === "" ? bytes.length : Math.min(bytes.length, Number(to) + 1);
    response.setHeader("Content-Range", `bytes ${start}-${stop - 1}/${bytes.length}`);
    response.setHeader("Content-Length", stop - start);
    response.writeHead(206);
    const part = bytes.subarray(start, stop);
    if (manners.short-- <= 0) response.end(part);
    else response.write(part.subarray(0, part.length >> 1), () => response.destroy());
  }
}

function serve(bytes, changes = {}) {
  Object.assign(manners, USUAL, { bytes }, changes);
  asked.length = 0;
}

function vector() {
  const [name] = readdirSync(new URL(MANY, ROOT)).filter((file) => file.endsWith(".mcz"));
  return new Uint8Array(readFileSync(new URL(MANY + name, ROOT)));
}

async function check(bytes) {
  const file = await open(fromUrl(address));
  const [expected] = decode(bytes);
  const clip = await file.clip(0);
  const found = await clip.read();
  assert.deepEqual(found.values, expected.signals[0].values);
}

test("a server with ranges, one that does not count from the end, one without any", async () => {
  const bytes = vector();
  for (const changes of [{}, { suffix: false }, { ranges: false }]) {
    serve(bytes, changes);
    await check(bytes);
  }
});

test("what passes is asked for again, what does not pass is said", async () => {
  const bytes = vector();
  serve(bytes, { fails: 2 });
  await check(bytes);
  serve(bytes, { short: 1 });
  await check(bytes);
  serve(bytes, { fails: 99 });
  await assert.rejects(fromUrl(address), AccessError);
  serve(bytes, { ranges: false });
  await assert.rejects(fromUrl(address, { limit: bytes.length - 1 }), /bytes at most/);
  await assert.rejects(fromUrl("http://127.0.0.1:1/"), AccessError);
});

test("a file that is replaced while it is read", async () => {
  const bytes = new Uint8Array(300000);
  serve(bytes);
  const source = await fromUrl(address);
  assert.equal((await source.read(0, 9)).length, 9);
  manners.tag = "b";
  await assert.rejects(source.read(0, 9), /replaced/);
  serve(bytes);
  const other = await fromUrl(address);
  manners.bytes = new Uint8Array(300001);
  await assert.rejects(other.read(0, 9), /replaced/);
});

test("headers go with every request", async () => {
  const bytes = new Uint8Array(300000);
  const seen = [];
  const watch = (url, options) => {
    seen.push(options.headers.Authorization);
    return fetch(url, options);
  };
  serve(bytes);
  const source = await fromUrl(address, { headers: { Authorization: "it is me" }, fetch: watch });
  await source.read(0, 9);
  assert.deepEqual(seen, ["it is me", "it is me"]);
});

const ARCHIVE = `
import sys
from dataclasses import replace
from mcz.codecs import codec_by_name
from mcz.container.writer import Writer
from mcz.files.writing.clip_writer import write_clip
from tests.motions import smooth

motions = [smooth(130 + 13 * k) for k in range(17)]
with open(sys.argv[1], "wb") as out:
    writer = Writer(out)
    for k in range(2500):
        name = f"subject-{k // 20:03}/take-{k % 20:02}"
        metadata = {"subject": f"{k // 20:03}", "action": f"walk {k % 7}"}
        motion = replace(motions[k % 17], name=name, metadata=metadata)
        write_clip(writer, motion, codec_by_name("raw"), {})
    writer.finish()
`;

test("an archive of 2,500 clips: few requests, few bytes", async (context) => {
  const folder = mkdtempSync(join(tmpdir(), "mcz-"));
  context.after(() => rmSync(folder, { recursive: true }));
  const path = join(folder, "many.mcz");
  const python = spawnSync("python3", ["-c", ARCHIVE, path], { cwd: fileURLToPath(ROOT) });
  if (python.status !== 0) {
    context.skip("there is no python with this package");
    return;
  }
  serve(new Uint8Array(readFileSync(path)));
  const source = await fromUrl(address);
  const file = await open(source);
  assert.equal(file.clips.length, 2500);
  assert.equal(file.clips[1234].name, "subject-061/take-14");
  const clip = await file.clip("subject-061/take-14");
  const { values, nRows } = await clip.read({ frames: [20, 120] });
  assert.equal(nRows, 100);
  assert.equal(values[0], Math.round(30e4 * Math.sin(20 * 0.05)) / 1e4);
  const payload = clip.segments().reduce((sum, { bytes }) => sum + bytes, 0);
  assert.ok(source.stats.requests <= 4, `${source.stats.requests} requests: ${asked}`);
  assert.ok(source.stats.bytes <= payload + 300000, `${source.stats.bytes} bytes`);
  context.diagnostic(`${source.stats.requests} requests, ${source.stats.bytes} bytes: ${asked}`);
});
