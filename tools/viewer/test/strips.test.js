// Strips of curves: zoom, pan, values, keys, marks.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { axe, inked, launch, open, settled } from "./helpers/browser.js";
import { fixture } from "./helpers/fixtures.js";
import { serve } from "./helpers/server.js";

let browser, server, page;
before(async () => {
  const names = ["walk.mcz", "walk-small.mcz", "markers.mcz", "steps.mcz", "bvh.mcz", "numbered.mcz"];
  server = await serve({ files: names.map((name) => fixture(name)) });
  browser = await launch();
  page = await open(browser, server.url);
});
after(async () => {
  await browser?.close();
  await server?.close();
});

const ruler = () => page.getAttribute(".strip.ruler canvas", "aria-label");
const place = () => page.textContent("output.place");
const speed = () => page.locator(".strip.curves canvas").first();

test("a strip says its figures, and its curve is drawn", async () => {
  await page.waitForFunction(() =>
    /[\d.]+ to [\d.]+ m\/s/.test(document.querySelector(".strip.curves canvas").ariaLabel),
  );
  assert.equal(await speed().getAttribute("role"), "slider");
  const { pixels, colors } = await inked(page, ".strip.curves canvas");
  assert.ok(pixels > 1000 && colors > 3, `${pixels} ${colors}`);
});

test("the pointer shows the value of its frame", async () => {
  const value = page.locator(".strip.curves .value").first();
  const before = await value.textContent();
  const box = await speed().boundingBox();
  await page.mouse.move(box.x + box.width * 0.8, box.y + 10);
  assert.match(await value.textContent(), /m\/s$/);
  assert.notEqual(await value.textContent(), before);
});

test("a click goes to its frame", async () => {
  const box = await speed().boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + 20);
  assert.match(await place(), /^121 \//);
  const line = await page.locator(".playhead").boundingBox();
  assert.ok(Math.abs(line.x - box.x - box.width / 2) < 8);
});

test("the wheel zooms all strips about the pointer; Shift moves; 0 shows all", async () => {
  const box = await speed().boundingBox();
  const all = await ruler();
  await page.mouse.move(box.x + box.width / 2, box.y + 20);
  for (let k = 0; k < 5; k++) await page.mouse.wheel(0, -100);
  await page.waitForFunction((old) => document.querySelector(".strip.ruler canvas").ariaLabel !== old, all);
  await settled(page);
  const [, from, to] = (await ruler()).match(/Frames (\d+) to (\d+)/).map(Number);
  assert.ok(from > 60 && to < 180, `${from} ${to}`);
  await speed().focus();
  await page.keyboard.press("Shift+ArrowRight");
  await settled(page);
  assert.ok(Number((await ruler()).match(/Frames (\d+)/)[1]) > from);
  await page.keyboard.press("0");
  await settled(page);
  assert.match(await ruler(), /Frames 1 to 240/);
});

test("two fingers zoom: each stays on its frame, and nothing is clicked", async () => {
  const box = await speed().boundingBox();
  const before = await place();
  const client = await page.context().newCDPSession(page);
  const touch = (type, ...xs) =>
    client.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: xs.map((x, id) => ({ x: box.x + x * box.width, y: box.y + 20, id })),
    });
  await touch("touchStart", 0.4);
  await touch("touchStart", 0.4, 0.6);
  for (const by of [0.1, 0.2, 0.3]) await touch("touchMove", 0.4 - by, 0.6 + by);
  await touch("touchEnd", 0.1);
  await touch("touchEnd");
  await settled(page);
  const [, from, to] = (await ruler()).match(/Frames (\d+) to (\d+)/).map(Number);
  assert.ok(Math.abs(from - 91) < 3 && Math.abs(to - 150) < 3, `${from} ${to}`);
  assert.equal(await place(), before);
  await speed().focus();
  await page.keyboard.press("0");
  await settled(page);
});

test("keys on a strip go through frames, and what is shown follows", async () => {
  await speed().focus();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  assert.match(await place(), /^2 \//);
  assert.match(await speed().getAttribute("aria-valuetext"), /^frame 2, /);
  for (let k = 0; k < 4; k++) await page.keyboard.press("+");
  await settled(page);
  await page.keyboard.press("End");
  await settled(page);
  assert.match(await ruler(), /to 240 are/);
  await page.keyboard.press("0");
});

test("more curves: positions, channels; each can be taken away", async () => {
  await page.click("button[aria-label='Curves to show']");
  await page.click("text=Position of selected points");
  await page.click("text=Channels of selected joints");
  assert.deepEqual(await axe(page), []);
  await page.keyboard.press("Escape");
  await page.locator(".strip", { hasText: "Position of root" }).waitFor();
  await page.waitForFunction(() =>
    [...document.querySelectorAll(".strip canvas")].some((one) => /Position.*x: .* cm/.test(one.ariaLabel)),
  );
  await page.click("button[aria-label^='Remove: Channels']");
  await page.locator(".strip.curves", { hasText: "Channels" }).waitFor({ state: "detached" });
});

test("lines between markers that keep their distance, where their names say nothing", async () => {
  const page = await open(browser, server.url);
  const box = page.locator("#view-menu >> text=Lines between markers");
  await page.click("button[aria-label='View']");
  assert.ok(!(await box.isVisible())); // a skeleton has bones
  await page.keyboard.press("Escape");
  await page.locator("#clips .tree-row", { hasText: "numbered.mcz" }).click();
  await page.waitForFunction(() => /numbered\.mcz/.test(document.title));
  const nLines = () => page.evaluate(() => mczViewer.stage.shown.body.bones.length);
  assert.equal(await nLines(), 0);
  await page.click("button[aria-label='View']");
  await box.click();
  await page.waitForFunction(() => mczViewer.stage.shown.body.bones.length > 8);
  await box.click();
  await settled(page);
  assert.equal(await nLines(), 0);
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

// As `mcz.contacts` has them.
const STEPS = {
  lfoot: [[14, 79], [147, 210]],
  ltoes: [[16, 80], [148, 212]],
  rfoot: [[81, 144]],
  rtoes: [[82, 146]],
};

test("contacts of feet are those of mcz.contacts; strip and rings have the same", async () => {
  const page = await open(browser, server.url);
  await page.locator("#clips .tree-row", { hasText: "steps.mcz" }).click();
  await page.waitForFunction(() => /steps\.mcz/.test(document.title));
  await page.click("button[aria-label='Curves to show']");
  await page.click("#curves-menu >> text=Foot contacts");
  await page.keyboard.press("Escape");
  const words = /lfoot 2 contacts; ltoes 2 contacts; rfoot 1 contact; rtoes 1 contact/;
  await marked(page, words);
  assert.ok((await inked(page, ".strip.marks canvas")).pixels > 300);
  const found = await page.evaluate(async () => {
    const { engine, store } = mczViewer;
    return engine.contacts(store.get("shown"), { from: 0, to: 1, up: null });
  });
  assert.deepEqual(Object.fromEntries(found.feet.map(({ name, runs }) => [name, runs])), STEPS);
  for (const [frame, n] of [[0, 0], [40, 1], [100, 1], [145, 1], [220, 0]]) {
    await page.evaluate((at) => mczViewer.store.set({ frame: at }), frame);
    await page.waitForFunction((k) => mczViewer.stage.contacts.mesh.count === k, n);
  }
  // What is compared has rings, and what is chosen in one is chosen in the other.
  await page.evaluate(async () => {
    const { engine, store } = mczViewer;
    const { fileId, index } = store.get("shown");
    store.set({ compared: await engine.clip(fileId, index), layout: "side", selection: [4], frame: 40 });
  });
  await page.waitForFunction(() => mczViewer.stage.contactsOfOther.mesh.count === 1);
  assert.deepEqual(await page.evaluate(() => mczViewer.stage.chosenOther()), [4]);
  assert.deepEqual(page.faults, []);
  await page.context().close();
});

const marked = (page, words) =>
  page.waitForFunction(
    (source) => new RegExp(source).test(document.querySelector(".strip.marks canvas")?.ariaLabel ?? ""),
    words.source,
  );

test("without a length unit it is said why there are no contacts", async () => {
  const page = await open(browser, server.url);
  await page.locator("#clips .tree-row", { hasText: "bvh.mcz" }).click();
  await page.waitForFunction(() => /bvh\.mcz/.test(document.title));
  await page.click("button[aria-label='Curves to show']");
  await page.click("#curves-menu >> text=Foot contacts");
  await marked(page, /no contacts of feet: the length unit is unknown/);
  await page.context().close();
});

test("a peak of the error is clicked: its frame, its worst point", async () => {
  await page.hover(".tree-row:nth-child(2)");
  await page.click('button[aria-label^="Compare with walk-small"]');
  const error = page.locator(".strip", { hasText: "Error" }).locator("canvas");
  await error.waitFor();
  await error.focus();
  await page.keyboard.press("n");
  const first = await place();
  await page.keyboard.press("n");
  assert.notEqual(await place(), first);
  await page.keyboard.press("p");
  assert.equal(await place(), first);
  assert.match(await page.textContent("#message"), /^Frame \d+: .+ mm/);
  await page.click("#tab-joints");
  assert.match(await page.textContent("#panel-joints > p"), /^1 of 31/);
});

test("markers have strips, too", async () => {
  await page.click(".tree-row:nth-child(3)");
  await page.waitForFunction(() => /markers\.mcz/.test(document.title));
  await page.locator(".strip", { hasText: "Speed of" }).waitFor();
  assert.deepEqual(await axe(page), []);
});

test("nothing failed", () => {
  assert.deepEqual(page.faults, []);
  assert.deepEqual(page.strays, []);
});
