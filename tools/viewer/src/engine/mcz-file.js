// An .mcz, opened: what its clips are, and their values. Of a file that is served or on a disk only
// what is needed is read.

import { clockFacts, nearestFrame } from "../ui/times.js";
import { analogValues, fromBlob, fromBytes, fromUrl, open } from "../../../js/mcz.js";

const ANALOG = 4; // the role of the signal whose values are words, which the source says the meaning of

/**
 * @param {{blob?: Blob, bytes?: Uint8Array, url?: string, headers?: object}} where
 * @param {{salvage?: boolean}} options
 */
export async function openMcz(where, { salvage = false } = {}) {
  const file = await open(sourceOf(where), { salvage });
  return {
    size: file.size,
    nClips: file.clips.length,
    damage: file.damage.map(({ text }) => text),
    rows: (from, to) => file.clips.slice(from, to),
    clip: async (index) => clipOf(file, await file.clip(index)),
  };
}

function sourceOf({ blob, bytes, url, headers }) {
  if (bytes) return fromBytes(bytes);
  return blob ? fromBlob(blob) : fromUrl(url, { headers });
}

async function clipOf(file, clip) {
  const { name, nFrames, skeleton, rate, origin, firstFrame } = clip;
  const segments = clip.signals.map((_, signal) => segmentsOf(clip.segments(signal), nFrames));
  const recording = await known(() => clip.recording());
  const clock = clockFacts(await known(() => clip.times()), rate);
  const channels = (signal) =>
    signal.channels.map((channel, i) => ({ ...channel, ...unitOf(signal, recording, i) }));
  return {
    name,
    aliases: file.clips[clip.index].aliases,
    nFrames,
    skeleton,
    rate,
    firstFrame,
    numbers: clip.frameNumbers.map(({ frame, number }) => ({ frame, number: Number(number) })),
    clock,
    source: origin,
    metadata: [...((await known(() => file.metadata(clip.index))) ?? clip.metadata)],
    quality: (await known(() => clip.quality())) ?? [],
    lost: lostFrames(file.damage, clip, segments[0] ?? []),
    events: eventsOf(recording, { rate, nFrames, ...clock }),
    signals: clip.signals.map((signal, i) => ({
      ...signal,
      channels: channels(signal),
      segments: segments[i],
    })),
    async read(signal, from, to) {
      const { values, mask } = await clip.read({ signal, frames: [from, to] });
      const isWords = clip.signals[signal].role === ANALOG && recording?.analog?.length > 0;
      return { values: isWords ? analogValues(recording, values) : values, mask };
    },
    sourceBytes: () => clip.source(),
  };
}

/** What is only told is left out where it is damaged. */
async function known(ask) {
  try {
    return await ask();
  } catch {
    return null;
  }
}

function unitOf({ role, channels }, recording, i) {
  const isAnalog = role === ANALOG && recording?.analog?.length === channels.length;
  return isAnalog ? { unit: recording.analog[i].unit } : {};
}

/** Frames that each segment has of those that are shown. */
function segmentsOf(segments, nFrames) {
  return segments
    .map(({ firstFrame, nFrames: n }) => [
      Math.max(0, firstFrame),
      Math.min(nFrames, firstFrame + n),
    ])
    .filter(([from, to]) => to > from);
}

/** Frames of the motion that a damaged file has lost: those that no segment has, and those it tells. */
function lostFrames(damage, { name, nFrames, signals }, segments) {
  const told = damage.filter(
    ({ clip, signal, frames }) => clip === name && frames !== null && signal === signals[0].name,
  );
  const all = [...gapsIn(segments, nFrames), ...told.map(({ frames }) => frames)];
  const within = all.map(([from, to]) => [Math.max(0, from), Math.min(nFrames, to)]);
  return joined(within.filter(([from, to]) => to > from).sort((a, b) => a[0] - b[0]));
}

/** Ranges that touch, as one; they are in order. */
function joined(ranges) {
  const out = [];
  for (const [from, to] of ranges) {
    const last = out.at(-1);
    if (last !== undefined && from <= last[1]) last[1] = Math.max(last[1], to);
    else out.push([from, to]);
  }
  return out;
}

/** Frames that no segment has. */
export function gapsIn(segments, nFrames) {
  const gaps = [];
  let due = 0;
  for (const [from, to] of segments) {
    if (from > due) gaps.push([due, from]);
    due = Math.max(due, to);
  }
  if (due < nFrames) gaps.push([due, nFrames]);
  return gaps;
}

/** Events at the frames that are nearest to their times. */
function eventsOf(recording, clip) {
  if (!recording || !clip.rate) return [];
  return recording.events.map(({ label, time, context, subject, description }) => ({
    frame: nearestFrame(clip, time),
    label,
    context,
    subject,
    description,
    time,
  }));
}
