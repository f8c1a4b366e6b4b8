// The page that is built, opened from a disk: no server, nothing in it; files are dropped and chosen.

import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { after, before, test } from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { axe, launch, open, shown } from "./helpers/browser.js";
import { fixture } from "./helpers/fixtures.js";
import { vector } from "./helpers/server.js";

const PAGE = pathToFileURL(fileURLToPath(new URL("../dist/viewer.html", import.meta.url))).href;

let browser, page;
before(async () => {
  browser = await launch();
  page = await open(browser, PAGE, { isEmpty: true });
});
after(() => browser?.close());

/** Drops files, by path, on the page. */
async function drop(...paths) {
  const files = paths.map((path) => ({
    name: path.split("/").pop(),
    base64: readFileSync(path).toString("base64"),
  }));
  await page.evaluate((given) => {
    const data = new DataTransfer();
    for (const { name, base64 } of given) {
      data.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], name));
    }
    const event = (type) => new DragEvent(type, { dataTransfer: data, bubbles: true, cancelable: true });
    document.body.dispatchEvent(event("dragover"));
    if (!document.body.classList.contains("is-dropping")) throw new Error("not seen");
    document.body.dispatchEvent(event("drop"));
  }, files);
}

test("it says what to do", async () => {
  await page.waitForSelector("#message:not(.fault)");
  assert.match(await page.textContent("#message"), /drop one here: \.mcz, \.bvh, \.amc with its \.asf/);
  assert.deepEqual(await axe(page), []);
});

test("an .mcz, a BVH, an AMC with its ASF, a C3D are dropped together", async () => {
  await drop(...["walk.mcz", "walk.bvh", "walk.amc", "walk.asf", "walk.c3d"].map((name) => fixture(name)));
  await shown(page, "walk");
  await page.waitForFunction(() => mczViewer.store.get("files").length === 4);
  assert.deepEqual(
    await page.evaluate(() => mczViewer.store.get("files").map(({ name }) => name)),
    ["walk.mcz", "walk.bvh", "walk.amc", "walk.c3d"],
  );
  assert.equal(await page.evaluate(() => document.body.classList.contains("is-dropping")), false);
});

test("a folder is dropped as people do it, with the folders in it, and a file", async () => {
  const before = await page.evaluate(() => mczViewer.store.get("files").length);
  const session = await page.context().newCDPSession(page);
  const data = { items: [], files: [fixture("takes"), fixture("bvh.mcz")], dragOperationsMask: 1 };
  for (const type of ["dragEnter", "dragOver", "drop"]) {
    await session.send("Input.dispatchDragEvent", { type, x: 400, y: 300, data });
  }
  await page.waitForFunction((n) => mczViewer.store.get("files").length === n, before + 4);
  const names = await page.evaluate((n) => mczViewer.store.get("files").slice(n).map(({ name }) => name), before);
  assert.deepEqual(names, ["walk.bvh", "again.bvh", "other.bvh", "bvh.mcz"]);
});

test("what is no motion file is told", async () => {
  await drop(fixture("walk.asf"));
  await page.waitForSelector("#message.fault");
  assert.match(await page.textContent("#message"), /No motion file there/);
});

const CODECS =
  "awt best dwt fast lsdt-clip lsdt-frame mdtt mrdwt online pca pca-rdo posewave qbc raw".split(" ");

/** Some files of the conformance suite of a codec. */
const vectorsOf = (codec) =>
  readdirSync(vector(codec))
    .filter((name) => name.endsWith(".mcz"))
    .slice(0, 2)
    .map((name) => vector(`${codec}/${name}`));

test("files of all codecs are decoded: their tables are in the page", async () => {
  const before = await page.evaluate(() => mczViewer.store.get("files").length);
  const paths = CODECS.flatMap(vectorsOf);
  assert.ok(paths.length >= CODECS.length);
  await drop(...paths);
  await page.waitForFunction((n) => mczViewer.store.get("files").length === n, before + paths.length);
  const read = await page.evaluate(async (from) => {
    const { engine, store } = mczViewer;
    const one = async ({ id, name }) => {
      const clip = await engine.clip(id, 0);
      const columns = clip.channels.map((_, column) => column);
      await engine.curves(clip, { columns, signal: 0, from: 0, to: clip.nFrames, width: 10 });
      return `${name} ${clip.codec}`;
    };
    return Promise.all(
      store
        .get("files")
        .slice(from)
        .map((file) => one(file).catch((error) => `${file.name}: ${error.message}`)),
    );
  }, before);
  assert.deepEqual(read.filter((text) => text.includes(": ")), []);
  assert.deepEqual(new Set(read.map((text) => text.split(" ").pop())), new Set(CODECS));
});

test("nothing failed, and nothing was asked of anyone", () => {
  assert.deepEqual(page.faults, []);
  assert.deepEqual(page.strays, []);
});
