// Files that mean harm, or are broken: no dialog, no script, no hang, no request to elsewhere.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { axe, curved, inked, launch, open, settled, shown } from "./helpers/browser.js";
import { fixture } from "./helpers/fixtures.js";
import { serve } from "./helpers/server.js";

let browser;
before(async () => {
  browser = await launch();
});
after(() => browser?.close());

async function served(files, options, run) {
  const server = await serve({ files });
  const page = await open(browser, server.url, options);
  try {
    await run(page);
    assert.deepEqual(page.strays, []);
    assert.deepEqual(page.faults, []);
  } finally {
    await page.context().close();
    await server.close();
  }
}

const foreign = (page) =>
  page.evaluate(() => ({
    elements: document.querySelectorAll("img, iframe, object, embed, body script:not([type=module]):not(#embedded), svg [onload], [onerror]").length,
    polluted: Object.keys(Object.prototype).length + Object.keys(Array.prototype).length,
    bidi: /[\u202a-\u202e\u2066-\u2069]/.test(document.body.textContent),
    controls: /[\x00-\x08\x0b-\x1f\x7f]/.test(document.querySelector("#clips").textContent),
    longest: Math.max(...[...document.querySelectorAll("*")].map((one) => one.getAttribute("title")?.length ?? 0)),
  }));

test("names with markup, __proto__, turned text, ten thousand letters", () =>
  served([fixture("hostile.mcz")], {}, async (page) => {
    const n = await page.locator("#clips .tree-row").count();
    assert.ok(n > 10);
    await page.locator("#clips .tree-row[tabindex='0']").focus();
    for (let k = 0; k < 60; k++) await page.keyboard.press("ArrowDown");
    await page.keyboard.press("Home");
    for (const id of ["joints", "compare", "export", "info"]) {
      await page.click(`#tab-${id}`);
      await settled(page);
    }
    for (const name of ["__proto__", "constructor", "evil"]) {
      await page.fill('[aria-label="Search clips"]', name);
      await page.waitForFunction((word) => {
        const rows = [...document.querySelectorAll("#clips .tree-row .name")];
        return rows.length > 0 && rows.every((one) => one.textContent.includes(word));
      }, name);
      await page.click("#clips .tree-row");
      await shown(page, name);
    }
    assert.match(await page.textContent("#clips"), /evil\\u202egnp\.exe/);
    const found = await foreign(page);
    assert.ok(found.longest <= 400, `${found.longest}`);
    assert.deepEqual({ ...found, longest: 0 }, { elements: 0, polluted: 0, bidi: false, controls: false, longest: 0 });
    assert.deepEqual(await axe(page), []);
  }));

test("names of points with markup are text in lists, curves and exports", () =>
  served([fixture("hostile.mcz")], {}, async (page) => {
    await page.click("#tab-joints");
    await page.click("#panel-joints .tree-row:nth-child(2)");
    await page.click("#tab-export");
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#export-csv")]);
    assert.doesNotMatch(download.suggestedFilename(), /[<>/\\]/);
    assert.equal((await foreign(page)).elements, 0);
  }));

for (const name of ["cut.mcz", "none.mcz"]) {
  test(`${name}: what is wrong is said`, () =>
    served([fixture(name)], { isEmpty: true }, async (page) => {
      await page.waitForSelector("#message.fault", { timeout: 20_000 });
      assert.deepEqual(await axe(page), []);
    }));
}

test("a damaged segment: its frames are named, the others shown, and the page goes on", () =>
  served([fixture("damaged.mcz"), fixture("walk.mcz")], {}, async (page) => {
    await page.waitForSelector("#message.fault", { timeout: 20_000 });
    assert.match(await page.textContent("#message"), /damaged\.mcz is damaged: frames \d+ to \d+ are lost/);
    assert.match(await page.title(), /damaged\.mcz/);
    await page.locator("#clips .tree-row", { hasText: "walk.mcz" }).click();
    await page.waitForFunction(() => /walk\.mcz/.test(document.title));
    await curved(page);
    assert.ok((await inked(page, ".strip.curves canvas")).pixels > 300);
  }));
