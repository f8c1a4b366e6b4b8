// When the frames of a clip were: SPEC.md, "Time". A clip has `firstTime`, and `times` of all frames
// where they do not follow each other at its rate.

const GAP = 1.5; // usual steps

/** What a clip says of its times: `times` (seconds) is left out where rate and first time give them. */
export function clockFacts(times, rate) {
  if (times === null || times.length === 0) return { firstTime: 0, times: null };
  const firstTime = times[0];
  const isEven = rate > 0 && times.every((time, f) => Math.abs(time - firstTime - f / rate) < 1e-9);
  return { firstTime, times: isEven ? null : times, step: isEven ? 1 / rate : usualStep(times) };
}

function usualStep(times) {
  const steps = times.slice(1).map((time, at) => time - times[at]).sort();
  return steps.length ? steps[steps.length >> 1] : 0;
}

/** The time of a frame in seconds; null where nothing tells it. */
export function timeOf(clip, frame) {
  if (clip.times) return clip.times[Math.min(clip.times.length - 1, Math.max(0, Math.floor(frame)))];
  return clip.rate ? (clip.firstTime ?? 0) + frame / clip.rate : null;
}

/** Whether frames are missing between a frame and the next. */
export function isGapAfter({ times, step }, frame) {
  return Boolean(times) && frame + 1 < times.length && times[frame + 1] - times[frame] > GAP * step;
}

/**
 * Where a time lies among the frames, between two of them as a fraction; null within a gap. Before the
 * first frame and behind the last it goes on at the rate.
 */
export function frameAtTime(clip, time) {
  const { times, rate, firstTime = 0 } = clip;
  if (!times) return rate ? (time - firstTime) * rate : null;
  const last = times.length - 1;
  if (time <= times[0] || last === 0) return (time - times[0]) / (clip.step || 1);
  if (time >= times[last]) return last + (time - times[last]) / (clip.step || 1);
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  if (times[low] === time) return low;
  if (isGapAfter(clip, low)) return null;
  return low + (time - times[low]) / (times[high] - times[low]);
}

/** The frame that is nearest to a time. */
export function nearestFrame(clip, time) {
  const frame = frameAtTime(clip, time);
  if (frame !== null) return Math.round(frame);
  const after = clip.times.findIndex((one) => one > time);
  return time - clip.times[after - 1] <= clip.times[after] - time ? after - 1 : after;
}

/** Runs of frames start <= f < end between gaps, of those from <= f < to. */
export function runsBetweenGaps(clip, from, to) {
  if (!clip.times) return [[from, to]];
  const end = Math.min(clip.times.length, Math.ceil(to));
  const runs = [];
  for (let f = Math.max(0, Math.floor(from)), start = f; f < end; f++) {
    if (f + 1 < end && !isGapAfter(clip, f)) continue;
    runs.push([start, f + 1]);
    start = f + 1;
  }
  return runs;
}
