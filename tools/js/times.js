// SPEC.md, "Time": when the frames of a clip were, in seconds on the clock of the recording.

import { TIMES, TIMES_PER_SECOND, sourceKind } from "./registry.js";
import { clockOf, timeOf } from "./source-table.js";

const SAME_RATE = 1e-5; // relative

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
  const numbers = numbersOf(clip);
  const printed = await printedTimes(clip, numbers);
  if (printed !== null && isClock(printed)) return printed;
  const { rate, nFrames } = clip;
  if (rate === null) return null;
  const { firstTime } = clip;
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

/** The times that the source gives to frame numbers, null where it gives none. */
async function printedTimes({ clip, file, rate }, numbers) {
  const { source } = clip;
  if (source === null || clip.signals[0].samplesPerFrame > 1) return null;
  const kind = sourceKind(source.format);
  if (kind === "c3d") return rate === null ? null : numbers.map((number) => (number - 1) / rate);
  if (kind !== "table") return null;
  await file.shared.loadTemplate(source, "clip");
  const clock = clockOf(source.template.data, clip.signals.length);
  return clock === null ? null : clockTimes(clock, numbers, rate);
}

function clockTimes(clock, numbers, rate) {
  const own = Number(clock.denominator) * 10 ** clock.grid.digits;
  const perNumber = Number(clock.numerator) / own; // of printed units
  const unit = rate === null || perNumber === 0 ? 0 : Math.round(Math.log10(perNumber * rate) / 3);
  const scale = 10 ** clock.grid.digits * 1000 ** Math.min(3, Math.max(0, unit));
  const corrected = rate === null || perNumber === 0 ? 1 : correction(numbers, perNumber, scale, clock, rate);
  return numbers.map((number) => (Number(timeOf(clock, BigInt(number))) / scale) * corrected);
}

/** By what the times are multiplied where the rate of the clip corrects that of the clock. */
function correction(numbers, perNumber, scale, clock, rate) {
  if (numbers.length < 2) return 1;
  const own = scale / (10 ** clock.grid.digits * perNumber);
  const near = (step) => Math.abs(own / rate - step) <= SAME_RATE * step;
  return near(1) || near(usualStep(numbers)) ? 1 : own / rate;
}

/** The median of the steps between frame numbers, as a whole number. */
function usualStep(numbers) {
  const steps = numbers.slice(1).map((number, at) => number - numbers[at]).sort();
  const middle = steps.length >> 1;
  return Math.trunc(steps.length % 2 ? steps[middle] : (steps[middle - 1] + steps[middle]) / 2);
}
