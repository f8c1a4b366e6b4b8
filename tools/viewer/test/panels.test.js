// Bar, clips, details: by mouse and by keyboard.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { MIDDLE, PHONE, USUAL, axe, launch, open, settled, shown } from "./helpers/browser.js";
import { fixture } from "./helpers/fixtures.js";
import { serve } from "./helpers/server.js";

let browser, server;
before(async () => {
  server = await serve({ files: [fixture("folders.mcz"), fixture("walk.mcz")] });
  browser = await launch();
});
after(async () => {
  await browser?.close();
  await server?.close();
});

const names = (page) => page.$$eval("#clips .tree-row .name", (all) => all.map((one) => one.textContent));
const active = (page) => page.evaluate(() => document.activeElement.textContent);

test("folders of names, opened and closed by keys", async () => {
  const page = await open(browser, server.url);
  const all = ["folders.mcz", "walks", "slow", "fast", "runs", "a", "b", "stand", "walk.mcz"];
  assert.deepEqual(await names(page), all);
  await page.locator("#clips [tabindex='0'].tree-row").focus();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowDown");
  assert.match(await active(page), /^walks/);
  await page.keyboard.press("ArrowLeft");
  await settled(page);
  assert.deepEqual((await names(page)).slice(0, 3), ["folders.mcz", "walks", "runs"]);
  await page.keyboard.press("ArrowRight");
  await settled(page);
  await page.keyboard.type("st");
  assert.match(await active(page), /^stand/);
  await page.keyboard.press("Enter");
  await shown(page, "stand");
  assert.equal(await page.getAttribute(".tree-row:has-text('stand')", "aria-current"), "true");
  await page.keyboard.press("End");
  assert.match(await active(page), /^walk\.mcz/);
  await page.context().close();
});

test("search, by a key, and from there to a clip", async () => {
  const page = await open(browser, server.url);
  await page.keyboard.press("/");
  await page.keyboard.type("runs b");
  await page.waitForSelector("text=1 found of 6");
  await page.keyboard.press("Enter");
  await page.keyboard.press("Enter");
  await shown(page, "runs/b");
  await page.keyboard.press("/");
  await page.keyboard.press("Escape");
  await page.waitForSelector("text=6 clips");
  await page.context().close();
});

for (const name of ["aliases.mcz", "aliases-damaged.mcz"]) {
  test(`${name}: other names of a clip are found and told`, async () => {
    const own = await serve({ files: [fixture(name)], api: { salvage: name.includes("damaged") } });
    const page = await open(browser, own.url, { isEmpty: true });
    await page.keyboard.press("/");
    await page.keyboard.type("again bvh");
    await page.waitForSelector("text=/1 found of \\d/");
    assert.match(await page.textContent("#clips .tree-row"), /a\/walk.*also named b\/again\.bvh/);
    await page.keyboard.press("Enter");
    await page.keyboard.press("Enter");
    await shown(page, "a/walk");
    assert.match(await page.textContent("#panel-info"), /Also namedb\/again\.bvh/);
    await page.context().close();
    await own.close();
  });
}

test("a clip is compared by Shift C", async () => {
  const page = await open(browser, server.url);
  await page.locator("#clips [tabindex='0'].tree-row").focus();
  await page.keyboard.press("End");
  await page.keyboard.press("Shift+C");
  await page.locator(".strip", { hasText: "Error" }).waitFor();
  await page.click("#tab-compare");
  await page.click("text=Side by side");
  await page.click("text=Color points by error");
  assert.deepEqual(await axe(page), []);
  await page.click("text=Stop");
  await page.locator(".strip", { hasText: "Error" }).waitFor({ state: "detached" });
  await page.context().close();
});

test("points: a tree, selected by keys; searched; left and right", async () => {
  const page = await open(browser, server.url);
  await page.click("#tab-joints");
  const texts = (all) => all.map((one) => one.textContent);
  const chosen = () => page.$$eval('#panel-joints [aria-selected="true"] .name', texts);
  await page.locator("#panel-joints [tabindex='0'].tree-row").focus();
  await page.keyboard.type("lfoot");
  await page.keyboard.press("Enter");
  await settled(page);
  assert.deepEqual(await chosen(), ["lfoot"]);
  await page.locator(".strip", { hasText: "Speed of lfoot" }).waitFor();
  await page.click("button[aria-label^=Left]");
  assert.match(await page.textContent("#panel-joints > p"), /^1[0-9] of 31/);
  await page.fill('[aria-label="Search points"]', "rtoes");
  await page.waitForFunction(() => document.querySelectorAll("#panel-joints .tree-row").length === 1);
  await page.click("button[aria-label^=None]");
  await settled(page);
  assert.deepEqual(await chosen(), []);
  assert.deepEqual(await axe(page), []);
  await page.context().close();
});

test("the up axis is switched", async () => {
  const page = await open(browser, server.url);
  const before = await page.screenshot({ clip: { x: 300, y: 60, width: 700, height: 500 } });
  await page.click("#panel-info >> text=z >> nth=-1");
  await page.waitForTimeout(300);
  const later = await page.screenshot({ clip: { x: 300, y: 60, width: 700, height: 500 } });
  assert.ok(!before.equals(later));
  await page.context().close();
});

test("theme: remembered, and the picture follows", async () => {
  const page = await open(browser, server.url, { theme: "light" });
  const back = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const light = await back();
  await page.click("button[aria-label='Light or dark']");
  await page.click("text=Dark");
  assert.notEqual(await back(), light);
  await page.reload();
  await shown(page);
  assert.notEqual(await back(), light);
  await page.context().close();
});

test("help lists the keys, and Escape leaves it", async () => {
  const page = await open(browser, server.url);
  await page.keyboard.press("?");
  await page.waitForSelector("dialog[open]");
  assert.match(await page.textContent("dialog"), /Space/);
  assert.deepEqual(await axe(page), []);
  await page.keyboard.press("Escape");
  await page.waitForSelector("dialog[open]", { state: "detached" }).catch(() => {});
  assert.equal(await page.locator("dialog[open]").count(), 0);
  await page.context().close();
});

test("panels give room by keys, and come back", async () => {
  const page = await open(browser, server.url);
  const width = () => page.$eval("#stage", (stage) => stage.clientWidth);
  const before = await width();
  await page.keyboard.press("b");
  await page.keyboard.press("i");
  assert.equal(await width(), USUAL.width);
  await page.keyboard.press("b");
  await page.keyboard.press("i");
  assert.equal(await width(), before);
  await page.context().close();
});

test("a phone: drawers, of which one is open; targets of 44 pixels; no scrolling aside", async () => {
  const page = await open(browser, server.url, { viewport: PHONE, hasTouch: true, isMobile: true });
  for (const [name, panel] of [["Clips", "#clips"], ["Details", "#inspector"], ["Curves", ".strip-board"]]) {
    await page.tap(`.panel-switch >> text=${name}`);
    await settled(page);
    const seen = await page.$$eval(
      "#clips, #inspector, .strip-board",
      (all) => all.filter((one) => one.checkVisibility()).length,
    );
    assert.equal(seen, 1, name);
    assert.ok(await page.isVisible(panel));
    assert.deepEqual(await axe(page), [], name);
    const small = await page.$$eval("button, select, [role=tab]", (all) =>
      all
        .filter((one) => one.checkVisibility() && !one.matches(".link, .small"))
        .filter((one) => one.getBoundingClientRect().height < 43.5)
        .map((one) => one.ariaLabel ?? one.textContent),
    );
    assert.deepEqual(small, [], name);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), name);
  }
  assert.ok((await page.$eval("#stage", (stage) => stage.clientHeight)) > 200);
  await page.context().close();
});

test("every state of the bar is fine for axe, at a middle width, too", async () => {
  const page = await open(browser, server.url, { viewport: MIDDLE, theme: "dark" });
  await page.click("button[aria-label='View']");
  assert.deepEqual(await axe(page), []);
  await page.click("text=Foot contacts");
  await page.click("button[aria-label='View: Front']");
  await page.keyboard.press("Escape");
  assert.equal(await page.evaluate(() => document.activeElement.ariaLabel), "View");
  await page.keyboard.press("i");
  for (const id of ["info", "joints", "compare", "export"]) {
    await page.click(`#tab-${id}`);
    assert.deepEqual(await axe(page), [], id);
  }
  await page.context().close();
});

test("the keyboard alone reaches everything that can be pressed", async () => {
  const page = await open(browser, server.url);
  const wanted = await page.$$eval("button, input, select, canvas, [role=tree]", (all) =>
    all.filter((one) => {
      const isOwn = one.type !== "radio" && one.role !== "tree";
      return isOwn && one.checkVisibility() && !one.disabled && one.tabIndex >= 0;
    }).length,
  );
  await page.evaluate(() => document.activeElement.blur());
  const reached = new Set();
  for (let k = 0; k < wanted + 20; k++) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => {
      const one = document.activeElement;
      one.dataset.reached ??= String(document.querySelectorAll("[data-reached]").length);
      return one.matches("button, input, select, canvas") ? one.dataset.reached : "";
    }));
  }
  const missed = await page.$$eval("button, input, select, canvas", (all) =>
    all
      .filter((one) => one.checkVisibility() && !one.disabled && one.tabIndex >= 0)
      .filter((one) => one.type !== "radio" && !one.dataset.reached)
      .map((one) => one.outerHTML.slice(0, 120)),
  );
  assert.deepEqual(missed, []);
  await page.context().close();
});

test("a clip whose first frames are empty begins where its points are", async () => {
  const own = await serve({ files: [fixture("late.mcz")] });
  const page = await open(browser, own.url);
  await page.waitForFunction(() => /^21 \/ 240/.test(document.querySelector("output.place").textContent));
  await page.context().close();
  await own.close();
});

test("lines between markers whose names say nothing are offered on the picture", async () => {
  const own = await serve({ files: [fixture("numbered.mcz")] });
  const page = await open(browser, own.url);
  await page.click(".stage-guess");
  await page.waitForFunction(() => globalThis.mczViewer.stage.shown.neighbors?.length > 10);
  assert.equal(await page.locator(".stage-guess").isVisible(), false);
  await page.context().close();
  await own.close();
});

test("two files open on Compare, each named below its figure", async () => {
  const files = [fixture("walk.mcz"), fixture("walk-small.mcz")];
  const own = await serve({ files, api: { diff: true } });
  const page = await open(browser, own.url);
  await page.waitForSelector("#tab-compare[aria-selected='true']");
  await page.waitForSelector("text=Greatest");
  const below = await page.$$eval(".stage-file", (all) => all.map((one) => one.textContent));
  assert.deepEqual(below, ["walk.mcz", "walk-small.mcz"]);
  assert.deepEqual(await axe(page), []);
  await page.context().close();
  await own.close();
});
