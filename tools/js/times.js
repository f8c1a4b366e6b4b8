// SPEC.md, "Time": when the frames of a clip were, in seconds on the clock of the recording.

import { TIMES, TIMES_PER_SECOND } from "./registry.js";

/**
 * The times of all frames.
 *
 * @param {import("./ranged-clip.js").RangedClip} clip
 * @returns {Promise<Float64Array | null>} null where neither times nor a rate are known
 * @throws {import("./errors.js").MczError}
 */
export async function timesOf(clip) {
  const column = await columnOf(clip);
  if (column !== null && isClock(column)) return column;
  const { rate, nFrames, firstTime } = clip;
  if (rate === null) return null;
  const numbers = numbersOf(clip);
  const from = firstTime === null ? 1 : numbers[0];
  return Float64Array.from({ length: nFrames }, (_, f) => (firstTime ?? 0) + (numbers[f] - from) / rate);
}

/** The signal of times in seconds, null where there is none. */
async function columnOf(clip) {
  const found = clip.clip.signals.find(({ role }) => role === TIMES);
  if (!found) return null;
  const { values, mask } = await clip.read({ signal: found.index });
  const perSecond = TIMES_PER_SECOND.get(found.channels[0].unit);
  return Float64Array.from({ length: clip.nFrames }, (_, f) =>
    mask === null || mask[f] ? Number(values[f]) / perSecond : NaN,
  );
}

/** Whether times count: all are known, and none falls. */
function isClock(times) {
  return times.every((time, f) => Number.isFinite(time) && (f === 0 || time >= times[f - 1]));
}

function numbersOf({ frameNumbers, nFrames }) {
  const numbers = new Float64Array(nFrames);
  frameNumbers.forEach(({ frame, number }, at) => {
    const end = frameNumbers[at + 1]?.frame ?? nFrames;
    for (let f = frame; f < end; f++) numbers[f] = Number(number) + f - frame;
  });
  return numbers;
}
