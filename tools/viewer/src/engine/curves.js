// Courses of numbers over many frames, as few as there are pixels: of each the least and greatest.

import { nextTurn } from "./turns.js";

const PIECE = 2048; // frames between two looks for other messages

/**
 * @param {object} clip see clip.js
 * @param {{columns: number[], signal?: number | "positions", from: number, to: number,
 *   width: number}} wanted columns of a signal; of "positions" three of each point
 * @returns {Promise<{least: Float32Array, most: Float32Array, width: number, gaps: Uint8Array}>}
 *   column after column, `width` numbers each; NaN where there is none. `gaps` 1 where a value of
 *   these pixels is missing.
 */
export async function curvesOf(clip, { columns, signal = 0, from, to, width }) {
  const range = new Range(columns.length, { from, to, width });
  for (let start = from; start < to; start += PIECE) {
    const end = Math.min(to, start + PIECE);
    if (signal === "positions")
      addPositions(range, columns, await clip.positions(start, end), start, clip);
    else
      await clip.overBlocks(signal, start, end, (block) =>
        addBlock(range, columns, block, clip, signal),
      );
    await nextTurn();
  }
  return range.result();
}

function addPositions(range, columns, places, first, clip) {
  const rowSize = clip.facts.points.length * 3;
  const nFrames = places.length / Math.max(1, rowSize);
  for (let f = 0; f < nFrames; f++) {
    columns.forEach((column, i) => range.add(i, first + f, places[f * rowSize + column]));
  }
}

function addBlock(range, columns, { values, mask, rowSize, first, start, end }, clip, signal) {
  const { samplesPerFrame, nChannels } = clip.facts.signals[signal];
  for (let f = start; f < end; f++) {
    for (let sample = 0; sample < samplesPerFrame; sample++) {
      const row = (f - first) * rowSize + sample * nChannels;
      const at = f + sample / samplesPerFrame;
      columns.forEach((column, i) => {
        const isThere = mask === null || mask[row + column] === 1;
        range.add(i, at, isThere ? values[row + column] : NaN);
      });
    }
  }
}

/** Least and greatest numbers of pixels. */
export class Range {
  constructor(nColumns, { from, to, width }) {
    const pixels = Math.max(1, Math.floor(width));
    Object.assign(this, { from, pixels, scale: pixels / Math.max(1, to - from) });
    this.least = new Float32Array(nColumns * pixels).fill(NaN);
    this.most = new Float32Array(nColumns * pixels).fill(NaN);
    this.gaps = new Uint8Array(nColumns * pixels);
  }

  add(column, frame, value) {
    const pixel = Math.min(this.pixels - 1, Math.floor((frame - this.from) * this.scale));
    const at = column * this.pixels + pixel;
    if (!Number.isFinite(value)) this.gaps[at] = 1;
    // NaN compares as false: the first number comes in by the negation.
    else {
      if (!(this.least[at] <= value)) this.least[at] = value;
      if (!(this.most[at] >= value)) this.most[at] = value;
    }
  }

  result() {
    const { least, most, gaps, pixels } = this;
    return { least, most, gaps, width: pixels };
  }
}
