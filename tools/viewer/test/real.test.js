// Real clips, where MCZ_DATA names a folder of them: made .mcz by Python, shown here. Part of .ci/full.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { axe, inked, launch, open, shown } from "./helpers/browser.js";
import { environment, fixture, python } from "./helpers/fixtures.js";
import { serve } from "./helpers/server.js";

const { MCZ_DATA } = process.env;
const skip = !MCZ_DATA && "MCZ_DATA names no folder";
const CLIPS = [
  ["cmu/amc/02_01.amc", 31],
  ["cmu/bvh/01_01.bvh", 38],
  ["cmu/bvh-daz/05_01.bvh", 40],
  ["other/animated-drawings/zombie.bvh", 20],
  ["other/bandai-namco/dataset-1_bow_active_001.bvh", 20],
  ["other/xia-style", 20],
  ["other/c3d.org/sample_01/Eb015pr.c3d", 26],
  ["other/c3d.org/sample_00/pyCGM2 lower limb CGM24 Walking01.c3d", 100],
];

let browser, folder;
before(async () => {
  browser = await launch();
  folder = mkdtempSync(join(tmpdir(), "mcz-real-"));
});
after(async () => {
  await browser?.close();
  if (folder) rmSync(folder, { recursive: true });
});

function mcz(...args) {
  const done = spawnSync(python, ["-m", "mcz", ...args], { env: environment, encoding: "utf8" });
  assert.ok(done.status <= 1, done.stderr);
}

async function served(files, run, options) {
  const server = await serve({ files });
  const page = await open(browser, server.url, options);
  try {
    await run(page);
    assert.deepEqual([page.faults, page.strays], [[], []]);
  } finally {
    await page.context().close();
    await server.close();
  }
}

/** A file of the data; of a folder its first BVH. */
function real(path) {
  const whole = join(MCZ_DATA, path);
  if (!/xia-style$/.test(path)) return whole;
  return join(whole, readdirSync(whole).filter((name) => name.endsWith(".bvh")).sort()[0]);
}

for (const [path, nPoints] of CLIPS) {
  test(`${path}: points, curves, nothing serious for axe`, { skip }, async () => {
    const out = join(folder, `${nPoints}${path.replaceAll(/\W/g, "_")}.mcz`);
    mcz("encode", real(path), "-o", out);
    await served([out], async (page) => {
      await page.click("#tab-joints");
      const n = Number((await page.textContent("#panel-joints > p")).match(/of ([\d,]+)/)[1].replaceAll(",", ""));
      assert.ok(n >= nPoints, `${n}`);
      await page.waitForFunction(() => / to /.test(document.querySelector(".strip.curves canvas").ariaLabel ?? ""));
      assert.ok((await inked(page, ".strip.curves canvas")).pixels > 200);
      assert.deepEqual(await axe(page), []);
    });
  });
}

test("a C3D: events with labels, gone through by keys; analog channels", { skip }, async () => {
  const out = join(folder, "events.mcz");
  mcz("encode", real("other/c3d.org/sample_01/Eb015pr.c3d"), "-o", out);
  await served([out], async (page) => {
    const marks = page.locator(".strip.marks canvas");
    assert.match(await marks.getAttribute("aria-label"), /RIC at \d+; RHS at \d+; RTO at \d+/);
    await marks.focus();
    const at = [];
    for (let k = 0; k < 3; k++) {
      await page.keyboard.press("n");
      at.push(parseInt(await page.textContent("output.place")));
    }
    assert.ok(at[0] < at[1] && at[1] < at[2], `${at}`);
    await page.locator(".strip.curves", { hasText: "analog: FX1" }).waitFor();
    assert.ok((await inked(page, ".strip.marks canvas")).pixels > 200);
  });
});

test("an archive of 177 clips: found, walked through by keys", { skip }, async () => {
  const many = join(folder, "clips");
  const found = spawnSync("find", [join(MCZ_DATA, "other"), join(MCZ_DATA, "cmu"), "-name", "*.bvh", "-size", "-1000k"], { encoding: "utf8" }).stdout;
  const paths = found.trim().split("\n").sort();
  for (let k = 0; k < 177; k++) {
    mkdirSync(join(many, `part ${k % 5}`), { recursive: true });
    // Those that come twice have another rate: of equal files an archive has one clip.
    const text = readFileSync(paths[k % paths.length], "latin1");
    const other = k < paths.length ? text : text.replace(/Frame Time:\s*\S+/, `Frame Time: 0.0${100 + k}`);
    writeFileSync(join(many, `part ${k % 5}`, `${String(k).padStart(3, "0")}.bvh`), other, "latin1");
  }
  const out = join(folder, "archive.mcz");
  mcz("pack", many, out, "--effort", "fast");
  await served([out], async (page) => {
    await page.waitForSelector("text=177 clips");
    assert.equal(await page.locator("#clips .tree-row .caret").count() > 0, true);
    await page.fill('[aria-label="Search clips"]', "170");
    await page.waitForSelector("text=1 found of 177");
    await page.keyboard.press("Enter");
    await page.keyboard.press("Enter");
    await shown(page, "170");
  });
});

test("damaged files: what is lost is marked in time, the others are shown", { skip }, async () => {
  const source = join(folder, "walk.mcz");
  mcz("encode", real("cmu/bvh/01_01.bvh"), "-o", source, "--codec", "raw", "--force");
  const bytes = readFileSync(source);
  bytes[bytes.length >> 1] ^= 0xff;
  const out = join(folder, "damaged.mcz");
  writeFileSync(out, bytes);
  await served([out], async (page) => {
    await page.waitForFunction(() => /are lost/.test(document.querySelector(".strip.marks canvas")?.ariaLabel ?? ""));
    assert.match(await page.textContent("#panel-info"), /frames [\d,]+ to [\d,]+ are lost/);
    assert.ok((await inked(page, ".strip.marks canvas")).pixels > 500);
  });
});

test("twenty thousand clips: listed, searched, and shown", { skip: !existsSync(fixture("many.mcz", { isAll: Boolean(MCZ_DATA) })) && skip }, async () => {
  await served([fixture("many.mcz", { isAll: true })], async (page) => {
    await page.waitForSelector("text=20,000 clips");
    await page.fill('[aria-label="Search clips"]', "19999");
    await page.waitForSelector("text=1 found of 20,000", { timeout: 60_000 });
    await page.keyboard.press("Enter");
    await page.keyboard.press("Enter");
    await shown(page, "19999");
    assert.ok((await page.locator("#clips .tree-row").count()) < 60);
  });
});

test("a hundred thousand frames: curves, zoomed", { skip }, async () => {
  await served([fixture("long.mcz", { isAll: true })], async (page) => {
    await page.waitForFunction(() => / to .* m\/s/.test(document.querySelector(".strip.curves canvas").ariaLabel ?? ""), null, { timeout: 60_000 });
    await page.locator(".strip.curves canvas").first().focus();
    for (let k = 0; k < 8; k++) await page.keyboard.press("+");
    await page.waitForFunction(() => {
      const [, from, to] = document.querySelector(".strip.ruler canvas").ariaLabel.match(/Frames (\d+) to (\d+)/);
      return to - from < 1000;
    });
    assert.ok((await inked(page, ".strip.curves canvas")).pixels > 200);
  });
});
