// The page as the real `mcz view` serves it, and as `mcz view -o` writes it. Needs Python with mcz.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { axe, curved, inked, launch, open, shown } from "./helpers/browser.js";
import { environment, fixture, python } from "./helpers/fixtures.js";

let browser;
before(async () => {
  browser = await launch();
});
after(() => browser?.close());

/** What a command of `mcz` says. */
const mcz = (...args) =>
  spawnSync(python, ["-m", "mcz", ...args], { env: environment, encoding: "utf8" });

/** Waits for so many tries of the quality panel. */
const tried = (page, n) =>
  page.waitForFunction(
    (k) => new RegExp(`of ${k} tries`).test(document.querySelector(".plot").ariaLabel ?? ""),
    n,
  );

/** Runs `mcz view` on files as long as `run(url)` takes. */
async function viewed(args, run) {
  const words = ["-m", "mcz", "view", "--no-browser", "--keep", ...args];
  const server = spawn(python, words, { env: environment });
  let said = "";
  server.stderr.on("data", (data) => (said += data));
  try {
    const url = await new Promise((resolve, reject) => {
      let text = "";
      server.stdout.on("data", (data) => {
        text += data;
        if (text.includes("\n")) resolve(text.trim());
      });
      server.on("exit", () => reject(new Error(said)));
    });
    await run(url);
  } finally {
    server.kill("SIGINT");
    await new Promise((resolve) => (server.exitCode === null ? server.on("exit", resolve) : resolve()));
  }
}

test("a BVH: shown, coded anew as the slider moves, compared, exported", async () => {
  await viewed([fixture("walk.bvh"), "--unit", "cm"], async (url) => {
    const page = await open(browser, url);
    await page.click("#tab-quality");
    const slider = page.locator("#quality-slider");
    for (const [value, n] of [["300", 1], ["700", 2]]) {
      await slider.fill(value);
      await tried(page, n);
    }
    const rows = await page.$$eval("#panel-quality tbody tr", (all) => all.map((one) => one.textContent));
    assert.equal(rows.length, 2);
    assert.equal(await page.evaluate(() => globalThis.mczViewer.store.get("colors")), "error");
    assert.match(await page.textContent(".result"), /mm/);
    await page.click("#tab-compare");
    await page.waitForSelector("text=Figures of mcz diff");
    assert.match(await page.locator("#compare-file option:checked").textContent(), /^posewave, /);
    await page.waitForFunction(() =>
      /Mean position error[\d.]+ cm/.test(document.querySelector("#panel-compare").textContent),
    );
    assert.deepEqual(await axe(page), []);
    await page.click("#tab-export");
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#export-source")]);
    assert.ok(readFileSync(await download.path()).equals(readFileSync(fixture("walk.bvh"))));
    assert.deepEqual(page.faults, []);
    assert.deepEqual(page.strays, []);
    await page.context().close();
  });
});

test("two files: the figures of mcz diff; a C3D that is chosen in the page is converted", async () => {
  await viewed([fixture("walk.mcz"), fixture("walk-small.mcz")], async (url) => {
    const page = await open(browser, url);
    await page.click("#tab-compare");
    await page.selectOption("#compare-clip", { index: 1 });
    await page.waitForFunction(() => /SQNR/.test(document.querySelector("#panel-compare").textContent));
    const chosen = page.waitForEvent("filechooser");
    await page.click("#open");
    await (await chosen).setFiles(fixture("walk.c3d"));
    await page.waitForFunction(() => /walk\.c3d/.test(document.title));
    await curved(page);
    assert.ok((await inked(page, ".strip.curves canvas")).pixels > 300);
    assert.deepEqual(page.strays, []);
    await page.context().close();
  });
});

/** The numbers of `mcz diff --json` of two files. */
const diffOf = (a, b) => JSON.parse(mcz("diff", fixture(a), fixture(b), "--json").stdout).clips[0];

test("a page with three files has the figures of the pair that is compared", async () => {
  const out = join(fixture(""), `three-${process.pid}.html`);
  const names = ["walk.mcz", "walk-small.mcz", "walk-rough.mcz"];
  const done = mcz("view", ...names.map((name) => fixture(name)), "-o", out, "--force");
  assert.equal(done.status, 0, done.stderr);
  const page = await open(browser, pathToFileURL(out).href);
  await page.click("#tab-compare");
  const figures = page.locator("#panel-compare section", { hasText: "Figures of mcz diff" });
  const sqnr = async (name) => {
    const { sqnr_db: value } = diffOf(names[0], name);
    const words = `SQNR${value.toFixed(1)}`.slice(0, 7);
    await page.waitForFunction(
      (text) => document.querySelector("#panel-compare").textContent.includes(text),
      words,
    );
  };
  await sqnr(names[1]);
  await page.selectOption("#compare-file", { label: names[2] });
  await sqnr(names[2]);
  await page.click("text=Swap");
  await figures.waitFor({ state: "hidden" });
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

test("GLB comes from the server; where it refuses, why is said", async () => {
  await viewed([fixture("walk.mcz"), fixture("no-rate.mcz"), "--rate", "120"], async (url) => {
    const page = await open(browser, url);
    await page.click("#tab-export");
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#export-glb")]);
    assert.match(download.suggestedFilename(), /\.glb$/);
    const bytes = readFileSync(await download.path());
    assert.equal(bytes.subarray(0, 4).toString(), "glTF");
    assert.ok(bytes.length > 10_000 && bytes.readUInt32LE(8) === bytes.length);
    await page.context().close();
  });
  await viewed([fixture("no-rate.mcz")], async (url) => {
    const page = await open(browser, url);
    await page.click("#tab-export");
    await page.click("#export-glb");
    await page.waitForSelector("#message.fault");
    assert.match(await page.textContent("#message"), /rate/);
    await page.context().close();
  });
});

test("one page that holds the clip, opened from a disk", async () => {
  const out = join(fixture(""), `take-${process.pid}.html`);
  const done = mcz("view", fixture("walk.bvh"), "-o", out, "--force");
  assert.equal(done.status, 0, done.stderr);
  const page = await open(browser, pathToFileURL(out).href);
  await shown(page);
  await curved(page);
  assert.ok((await inked(page, ".strip.curves canvas")).pixels > 300);
  assert.deepEqual(await axe(page), []);
  assert.deepEqual(page.faults, []);
  assert.deepEqual(page.strays, []);
  const size = statSync(out).size;
  assert.ok(size < 3e6, `${size}`);
  await page.context().close();
});
