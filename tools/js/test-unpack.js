// Tests of unpack.js: files that are whole or not there, and nothing overwritten unasked.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import {
  existsSync,
  mkdirSync,
  mkdtempSync,
  readFileSync,
  readdirSync,
  rmSync,
  symlinkSync,
  writeFileSync,
} from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { beforeEach, afterEach, test } from "node:test";
import { fileURLToPath } from "node:url";

import { readAnnex } from "./annex-node.js";
import { setAnnex, sources } from "./mcz.js";

const VECTORS = fileURLToPath(new URL("../../conformance/vectors/valid/", import.meta.url));
const SCRIPT = fileURLToPath(new URL("unpack.js", import.meta.url));
const ARCHIVE = join(VECTORS, "sources/bvh-shared-template.mcz"); // one of its files is in a folder

setAnnex(readAnnex);
const files = sources(new Uint8Array(readFileSync(ARCHIVE))).filter(({ path }) => path !== "");
let folder, out;

beforeEach(() => {
  folder = mkdtempSync(join(tmpdir(), "mcz-"));
  out = join(folder, "out");
});
afterEach(() => rmSync(folder, { recursive: true }));

function unpack(...words) {
  return spawnSync(process.execPath, [SCRIPT, ...words, ARCHIVE, out], { encoding: "utf8" });
}

/** Names of all files below the folder, and those of temporary ones. */
function names() {
  return readdirSync(out, { recursive: true, withFileTypes: true })
    .filter((entry) => !entry.isDirectory())
    .map((entry) => entry.name);
}

test("every file is restored, and no temporary one stays", () => {
  const { status, stdout } = unpack();
  assert.equal(status, 0);
  assert.ok(files.length > 0);
  for (const { path, bytes } of files) {
    assert.deepEqual(new Uint8Array(readFileSync(join(out, path))), bytes);
    assert.ok(stdout.includes(JSON.stringify(path)));
  }
  assert.equal(names().length, files.length);
});

test("what exists stays, others are written, and --force replaces", () => {
  const [first, ...others] = files;
  const target = join(out, first.path);
  mkdirSync(dirname(target), { recursive: true });
  writeFileSync(target, "mine");
  const { status, stderr } = unpack();
  assert.equal(status, 1);
  assert.match(stderr, /exists; use --force/);
  assert.equal(readFileSync(target, "utf8"), "mine");
  for (const { path } of others) assert.ok(existsSync(join(out, path)));
  assert.equal(unpack("--force").status, 0);
  assert.deepEqual(new Uint8Array(readFileSync(target)), first.bytes);
  assert.equal(names().length, files.length);
});

test("--force replaces a link, not what it points to", () => {
  const target = join(out, files[0].path);
  mkdirSync(dirname(target), { recursive: true });
  const elsewhere = join(folder, "elsewhere");
  writeFileSync(elsewhere, "mine");
  symlinkSync(elsewhere, target);
  assert.equal(unpack("--force").status, 0);
  assert.equal(readFileSync(elsewhere, "utf8"), "mine");
  assert.deepEqual(new Uint8Array(readFileSync(target)), files[0].bytes);
});

test("a file that cannot be written whole is not there", { skip: process.platform === "win32" }, () => {
  const limited = `trap '' XFSZ; ulimit -f 0; exec "$@" > /dev/null`;
  const words = ["-c", limited, "sh", process.execPath, SCRIPT, ARCHIVE, out];
  const { status } = spawnSync("sh", words, { encoding: "utf8" });
  assert.equal(status, 1);
  assert.deepEqual(names(), []);
});

test("wrong words", () => {
  assert.equal(spawnSync(process.execPath, [SCRIPT, ARCHIVE]).status, 2);
});
