// SPEC.md, "Salvage": the frames that a damaged signal still has.

import { Refused, Unsupported } from "./errors.js";
import { chainsOf } from "./losses.js";

/**
 * Decodes what can be decoded of some frames; the rest is invalid.
 *
 * @param {import("./clip.js").Signal} signal with the segments that are there
 * @param {{from: number, to: number}} request frames of the clip
 * @param {number} stored frames of the signal where it is whole
 * @param {(segments: object[], from: number, to: number) => Promise<object>} decode of frames of
 *   the clip from a chain of segments; may throw {@link Refused}
 * @returns {Promise<{nRows: number, nChannels: number, values: Float64Array | BigInt64Array,
 *   mask: Uint8Array, lost: [number, number][]}>}
 */
export async function salvageSignal(signal, { from, to }, stored, decode) {
  const { skip, samplesPerFrame, integer } = signal;
  const nChannels = signal.channels.length;
  const perFrame = samplesPerFrame * nChannels;
  const size = (to - from) * perFrame;
  const values = integer ? new BigInt64Array(size) : new Float64Array(size).fill(NaN);
  const mask = new Uint8Array(size);
  const found = [];
  const rescue = async (segments, a, b) => {
    const part = await decode(segments, a, b);
    const start = (a - from) * perFrame;
    values.set(part.values, start);
    if (part.mask) mask.set(part.mask, start);
    else mask.fill(1, start, start + part.values.length);
    found.push([a, b]);
  };
  for (const chain of chainsOf(signal.segments, stored)) {
    const a = Math.max(from, chain.from - skip);
    const b = Math.min(to, chain.to - skip);
    if (a < b) await halve(chain.segments, a, b, skip, rescue);
  }
  const nRows = (to - from) * samplesPerFrame;
  return { signal, nRows, nChannels, values, mask, lost: without(found, from, to) };
}

/** Lets `rescue` have frames; where that fails, those of fewer and fewer segments. */
async function halve(segments, from, to, skip, rescue) {
  const todo = [[from, to]];
  const last = segments.at(-1);
  const end = Math.min(to, last.firstFrame + last.nFrames - skip);
  const lead = segments.reduce((most, segment) => Math.max(most, segment.lead), 0);
  while (todo.length > 0) {
    const [a, b] = todo.pop();
    try {
      await rescue(segments, a, b);
    } catch (error) {
      if (!(error instanceof Refused) || error instanceof Unsupported) throw error;
      const starts = segments.map(({ firstFrame }) => firstFrame - skip);
      const inner = starts.filter((start) => start > a && start < b);
      const middle = inner[inner.length >> 1];
      if (inner.length > 0) todo.push([middle, b], [a, middle]);
      // Of one segment, the frames that the one after affects may be lost with that.
      else if (lead > 0 && b === end && end - lead > a) todo.push([a, end - lead]);
    }
  }
}

/** The runs of frames that are not among those found. */
function without(found, from, to) {
  const lost = [];
  let at = from;
  for (const [a, b] of found.sort((one, other) => one[0] - other[0])) {
    if (a > at) lost.push([at, a]);
    at = b;
  }
  if (at < to) lost.push([at, to]);
  return lost;
}
