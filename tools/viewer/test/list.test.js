// The list of clips alone, with an engine that is made up: a million rows do no harm.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { launch, settled } from "./helpers/browser.js";

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const ENTRY = `
  import { mountClips } from "./panels/clips/clips.js";
  import { Store } from "./store.js";
  import { initial } from "./state.js";
  const row = (index) => ({ index, name: "folder " + (index % 7) + "/clip " + index, nFrames: 100, rate: 120, codecs: ["raw"], bytes: 999 });
  window.start = (nClips) => {
    const asked = { rows: 0, calls: 0 };
    const engine = {
      async rows(id, from, to) {
        asked.calls++;
        asked.rows += to - from;
        await new Promise((resolve) => setTimeout(resolve));
        return Array.from({ length: to - from }, (_, k) => row(from + k));
      },
      clip: async (fileId, index) => ({ key: fileId + "/" + index, fileId, index, ...row(index) }),
    };
    const store = new Store(initial());
    mountClips(document.getElementById("clips"), { store, engine });
    store.set({ files: [{ id: 1, name: "all.mcz", size: 1, nClips, damage: [], url: null }] });
    Object.assign(window, { asked, store });
  };`;

let browser, page;
before(async () => {
  const script = await build({ stdin: { contents: ENTRY, resolveDir: here("../src") }, bundle: true, write: false });
  const style = await build({ entryPoints: [here("../src/style.css")], bundle: true, write: false });
  browser = await launch();
  page = await browser.newPage({ viewport: { width: 400, height: 700 } });
  await page.setContent(`<style>${style.outputFiles[0].text} #clips { height: 600px }</style><nav id="clips"></nav>`);
  await page.addScriptTag({ content: script.outputFiles[0].text });
});
after(() => browser?.close());

const rows = () => page.locator(".tree-row").count();
const texts = () => page.$$eval(".tree-row .name", (all) => all.map((one) => one.textContent));

test("a million rows: a page of them is asked for, a few are made", async () => {
  await page.evaluate(() => start(1_000_000));
  await page.waitForFunction(() => document.querySelector(".tree-row small")?.textContent.includes("100 frames"));
  assert.ok((await rows()) < 60);
  assert.ok((await page.evaluate(() => asked.rows)) <= 1500);
});

test("the end is reached by a key, and by the scroll bar", async () => {
  await page.locator(".tree-row[tabindex='0']").focus();
  await page.keyboard.press("End");
  await page.waitForFunction(() => document.activeElement.textContent.includes("clip 999999"));
  await page.keyboard.press("ArrowUp");
  await page.waitForFunction(() => document.activeElement.textContent.includes("clip 999998"));
  await page.$eval(".tree", (tree) => (tree.scrollTop = tree.scrollHeight / 2));
  await settled(page);
  await page.waitForFunction(() => [...document.querySelectorAll(".tree-row .name")].some((one) => /clip (49|50)\d{4}$/.test(one.textContent)));
  assert.ok((await rows()) < 60);
  assert.ok((await page.evaluate(() => asked.rows)) < 5000);
});

test("wheels go on by rows that follow each other", async () => {
  await page.$eval(".tree", (tree) => (tree.scrollTop = 0));
  await page.mouse.move(200, 300);
  await page.mouse.wheel(0, 120);
  await settled(page);
  await page.waitForFunction(() => [...document.querySelectorAll(".tree-row .name")].every((one) => one.textContent !== "(no name)"));
  const numbers = (await texts()).map((text) => Number(text.match(/\d+$/)[0])).sort((a, b) => a - b).slice(0, 12);
  numbers.forEach((number, k) => k && assert.equal(number, numbers[k - 1] + 1));
});

test("search goes on by and by, says how far, and ends with another word", async () => {
  await page.fill("input[type=search]", "clip 99999");
  await page.waitForFunction(() => /[1-9]\d* found/.test(document.querySelector("#clips > p").textContent));
  await page.fill("input[type=search]", "clip 12345");
  await page.waitForFunction(() => /20 found of 1,000,000$/.test(document.querySelector("#clips > p").textContent), null, { timeout: 60_000 });
  await settled(page);
  assert.ok((await texts()).every((text) => text.includes("12345")));
});

test("twenty thousand in folders", async () => {
  await page.evaluate(() => {
    document.getElementById("clips").replaceChildren();
    start(20_000);
  });
  await page.waitForFunction(() => document.querySelector(".tree-row small")?.textContent === "2,858");
  assert.equal(await rows(), 7);
  await page.click(".tree-row:nth-child(3)");
  await page.waitForFunction(() => document.querySelectorAll(".tree-row").length > 15);
  const took = await page.evaluate(async () => {
    const tree = document.querySelector(".tree");
    const times = [];
    for (let k = 0; k < 60; k++) {
      tree.scrollTop += 400;
      const begun = performance.now();
      await new Promise((resolve) => requestAnimationFrame(() => resolve()));
      times.push(performance.now() - begun);
    }
    return { n: times.length, rows: document.querySelectorAll(".tree-row").length };
  });
  assert.ok(took.rows < 60);
});
