// The short run: one page, one of each thing. `npm run test:short`.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { PHONE, axe, inked, launch, open, settled } from "./helpers/browser.js";
import { fixture } from "./helpers/fixtures.js";
import { serve } from "./helpers/server.js";

let browser, server, page;
before(async () => {
  server = await serve({ files: [fixture("walk.mcz"), fixture("walk-small.mcz")] });
  browser = await launch();
  page = await open(browser, server.url);
});
after(async () => {
  await browser?.close();
  await server?.close();
});

test("a clip is shown, with its facts", async () => {
  assert.match(await page.title(), /walk\.mcz/);
  assert.match(await page.textContent("#panel-info"), /240/);
  assert.match(await page.textContent("#panel-info"), /5\.644 cm/);
  assert.ok((await inked(page, ".strip.curves canvas")).pixels > 500);
});

test("a second clip is compared, and the greatest error is a click away", async () => {
  await page.hover(".tree-row:nth-child(2)");
  await page.click('button[aria-label^="Compare with walk-small"]');
  await page.click("#tab-compare");
  const error = page.locator(".strip", { hasText: "Error" }).locator("canvas");
  await error.waitFor();
  assert.match(await error.getAttribute("aria-label"), /greatest [\d.]+ mm/);
  await error.focus();
  await page.keyboard.press("Enter");
  const text = await page.textContent("#panel-compare");
  const [, number] = text.match(/Whereframe (\d+)/);
  assert.match(await page.textContent("output.place"), new RegExp(`^${number} /`));
  await page.click("#tab-joints");
  await settled(page);
  assert.equal(await page.locator('#panel-joints [aria-selected="true"]').count(), 1);
});

test("dark and narrow: nothing serious for axe, and no scrolling aside", async () => {
  await page.click("button[aria-label='Light or dark']");
  await page.click("text=Dark");
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  assert.deepEqual(await axe(page), []);
  await page.setViewportSize(PHONE);
  await settled(page);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
});

test("nothing failed, and nothing was asked of anyone else", () => {
  assert.deepEqual(page.faults, []);
  assert.deepEqual(page.strays, []);
});
