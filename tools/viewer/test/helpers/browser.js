// A page in Chromium, with what went wrong in it, and what it asked for.

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const AXE = readFileSync(fileURLToPath(new URL("../../node_modules/axe-core/axe.min.js", import.meta.url)), "utf8");
const ARGS = [
  "--no-sandbox",
  "--use-gl=angle",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-dev-shm-usage",
];
export const WIDE = { width: 1440, height: 900 };
export const USUAL = { width: 1100, height: 720 }; // all panels are open
export const MIDDLE = { width: 1024, height: 700 };
export const PHONE = { width: 390, height: 844 };

export const launch = () =>
  chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ARGS });

/**
 * Opens an address; waits until a clip is shown, but for `isEmpty`.
 *
 * `page.faults` are errors of the console and dialogs; `page.strays` requests to other origins.
 */
export async function open(browser, url, { viewport = USUAL, theme = "light", isEmpty = false, ...more } = {}) {
  const context = await browser.newContext({ viewport, colorScheme: theme, acceptDownloads: true, ...more });
  const page = await context.newPage();
  page.faults = [];
  page.strays = [];
  page.on("pageerror", (error) => page.faults.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") page.faults.push(message.text());
  });
  page.on("dialog", (dialog) => {
    page.faults.push(`dialog: ${dialog.message()}`);
    dialog.dismiss();
  });
  const { origin } = new URL(url);
  context.on("request", (request) => {
    const to = request.url();
    if (!/^(blob|data):/.test(to) && new URL(to).origin !== origin) page.strays.push(to);
  });
  await page.goto(url);
  if (!isEmpty) await shown(page);
  return page;
}

/** Waits until the bar names a clip and the worst of waiting is over. */
export async function shown(page, name) {
  await page.waitForSelector("#bar .files b", { timeout: 20_000 });
  if (name) await page.waitForFunction((n) => document.querySelector("#bar .files").textContent.includes(n), name);
  await settled(page);
}

export const settled = (page) =>
  page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));

/** What axe finds that is serious or critical. */
export async function axe(page) {
  await page.evaluate(AXE); // by the debugger, which the page's policy does not bind
  const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
  return violations
    .filter(({ impact }) => impact === "serious" || impact === "critical")
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ target, failureSummary }) => `${target} ${failureSummary}`).join(" | ")}`);
}

/** Waits until the first strip of curves says its figures, and is drawn. */
export async function curved(page) {
  await page.waitForFunction(() =>
    /: .*[\d.]+ to [\d.]+/.test(document.querySelector(".strip.curves canvas")?.ariaLabel ?? ""),
  );
  await settled(page);
}

/** How many pixels of a canvas are not of its most frequent color, and how many colors there are. */
export const inked = (page, selector) =>
  page.$eval(selector, (canvas) => {
    const copy = document.createElement("canvas");
    Object.assign(copy, { width: canvas.width, height: canvas.height });
    const context = copy.getContext("2d");
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, copy.width, copy.height);
    const counts = new Map();
    for (let i = 0; i < data.length; i += 4) {
      const color = (data[i] << 24) | (data[i + 1] << 16) | (data[i + 2] << 8) | data[i + 3];
      counts.set(color, (counts.get(color) ?? 0) + 1);
    }
    return { pixels: data.length / 4 - Math.max(...counts.values()), colors: counts.size };
  });
