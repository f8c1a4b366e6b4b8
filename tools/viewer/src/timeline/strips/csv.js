// The curves that are shown, as a table: a row a frame.

import { frameNumber } from "../../ui/text.js";
import { timeOf } from "../../ui/times.js";
import { errorSource } from "./sources.js";

const PIECE = 4096; // frames that are asked for at a time

/**
 * @param {object[]} sources those of the strips
 * @returns {Promise<string>} CSV with a head; of several samples a frame, the last
 */
export async function csvOf(engine, clip, sources, errors) {
  const all = errors ? [...sources, errorSource(errors)] : sources;
  if (!all.length) throw new Error("No curve is shown.");
  const isTimed = timeOf(clip, 0) !== null;
  const head = ["frame", ...(isTimed ? ["seconds"] : [])];
  for (const { name, unit, series } of all) {
    for (const { label } of series) head.push(quoted(`${name}${series.length > 1 ? ` ${label}` : ""}${unit ? ` [${unit}]` : ""}`));
  }
  const lines = [head.join(",")];
  for (let from = 0; from < clip.nFrames; from += PIECE) {
    const to = Math.min(clip.nFrames, from + PIECE);
    const columns = [];
    for (const source of all) columns.push(...(await rows(source, from, to)));
    for (let f = from; f < to; f++) {
      const line = [frameNumber(clip, f), ...(isTimed ? [Number(timeOf(clip, f).toFixed(9))] : [])];
      for (const { most } of columns) line.push(Number.isNaN(most[f - from]) ? "" : plain(most[f - from]));
      lines.push(line.join(","));
    }
  }
  return `${lines.join("\r\n")}\r\n`;
}

/** With as many columns of pixels as frames, each is one frame. */
async function rows(source, from, to) {
  const found = await source.load({ from, to, width: to - from }, () => false, () => {});
  return found ?? source.series.map(() => ({ most: new Float32Array(to - from).fill(NaN) }));
}

/** As few digits as tell a float32 from its neighbors. */
const plain = (value) => Number(value.toPrecision(8));

/** A field of a head; what a spreadsheet would run begins with an apostrophe. */
function quoted(text) {
  const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}
