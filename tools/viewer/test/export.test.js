// Export, and the quality panel: with answers of a server that is made up.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { axe, inked, launch, open, settled } from "./helpers/browser.js";
import { fixture } from "./helpers/fixtures.js";
import { serve } from "./helpers/server.js";

let browser, server, page;
const asked = [];
const CODECS = [
  {
    name: "mrdwt",
    lossless: false,
    quality: "T_g",
    dial: { parameter: "T_g", low: 0, high: 1048576, rises: true, whole: false },
    parameters: [
      { name: "T_g", default: "0.2", range: "", meaning: "global threshold" },
      { name: "mean_error_cm", default: null, range: "", meaning: "at most this mean" },
    ],
  },
];
const encode = (body, held) => {
  asked.push(body);
  const bytes = readFileSync(fixture("bvh-small.mcz"));
  held.push({ name: "walk (mrdwt)", bytes, isHidden: true });
  const payload = Math.round(3000 / (1 + Object.values(body.params)[0]));
  return { url: `files/${held.length - 1}`, name: "walk (mrdwt)", size: bytes.length, payload, quality: {}, seconds: 0.1 };
};
const diff = () => ({ a: "a", b: "b", clips: [{ mean_position_error_cm: 0.125, notes: ["<b>note</b>"] }] });
const glb = () => Buffer.from("glTF....");

before(async () => {
  server = await serve({
    files: [fixture("bvh.mcz")],
    api: { canEncode: true, canGlb: true, codecs: CODECS },
    posts: { encode, diff, glb },
  });
  browser = await launch();
  page = await open(browser, server.url);
});
after(async () => {
  await browser?.close();
  await server?.close();
});

async function downloaded(id) {
  await page.click("#tab-export");
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(`#export-${id}`)]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

test("the slider codes the clip anew: bytes, error, a point of the plot", async () => {
  await page.click("#tab-quality");
  const slider = page.locator("#quality-slider");
  for (const [value, n] of [["300", 1], ["600", 2], ["900", 3]]) {
    await slider.fill(value);
    await page.waitForFunction((k) => new RegExp(`of ${k} tries`).test(document.querySelector(".plot").ariaLabel ?? ""), n);
  }
  assert.equal(asked.length, 3);
  assert.deepEqual(Object.keys(asked[0].params), ["T_g"]);
  assert.ok(asked[0].params.T_g < asked[1].params.T_g && asked[1].params.T_g < asked[2].params.T_g);
  assert.equal(asked[0].url, "files/0");
  assert.match(await page.textContent(".result"), /Bytes/);
  await page.click("text=As a table");
  assert.equal(await page.locator("#panel-quality tbody tr").count(), 3);
  assert.ok((await inked(page, ".plot")).pixels > 300);
  assert.deepEqual(await axe(page), []);
});

test("sliding fast asks once", async () => {
  const before = asked.length;
  for (let value = 100; value < 200; value += 10) await page.locator("#quality-slider").fill(String(value));
  await page.waitForFunction(() => /of 4 tries/.test(document.querySelector(".plot").ariaLabel));
  assert.equal(asked.length, before + 1);
});

test("a target in place of the dial", async () => {
  await page.selectOption("#quality-dial", "mean_error_cm");
  await page.selectOption("#quality-unit", "cm");
  await page.fill("#quality-value", "0.5");
  await page.waitForFunction(() => /of 5 tries/.test(document.querySelector(".plot").ariaLabel));
  assert.deepEqual(asked.at(-1).params, { mean_error_cm: 0.5 });
  assert.equal(asked.at(-1).unit, "cm");
});

test("what is coded is compared, with the figures of mcz diff", async () => {
  await page.click("#tab-compare");
  await page.waitForSelector("text=Figures of mcz diff");
  const text = await page.textContent("#panel-compare");
  assert.match(text, /0\.125 cm/);
  assert.match(text, /<b>note<\/b>/);
});

test("PNG", async () => {
  const { name, bytes } = await downloaded("png");
  assert.match(name, /^walk\.png$/);
  assert.equal(bytes.subarray(1, 4).toString(), "PNG");
  assert.ok(bytes.length > 10_000);
});

test("the source, byte for byte", async () => {
  const { name, bytes } = await downloaded("source");
  assert.equal(name, "walk.bvh");
  assert.ok(bytes.equals(readFileSync(fixture("walk.bvh"))));
});

test("CSV: a head, and a row a frame", async () => {
  const { bytes } = await downloaded("csv");
  const lines = bytes.toString().trim().split("\r\n");
  assert.equal(lines.length, 241);
  assert.match(lines[0], /^frame,seconds,Speed of Hips/);
  assert.match(lines[1], /^1,0,[\d.]+/);
});

test("GLB comes from the server", async () => {
  const { name, bytes } = await downloaded("glb");
  assert.equal(name, "walk.glb");
  assert.equal(bytes.toString(), "glTF....");
});

test("a film", async () => {
  const { name, bytes } = await downloaded("video");
  assert.match(name, /\.(webm|mp4)$/);
  assert.ok(bytes.length > 2000);
  await settled(page);
});

test("nothing failed, and nothing was asked of anyone else", () => {
  assert.deepEqual(page.faults, []);
  assert.deepEqual(page.strays, []);
});
