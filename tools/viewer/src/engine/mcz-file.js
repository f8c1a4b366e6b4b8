// An .mcz, opened: what its clips are, and their values.

import { codecLabel } from "../../../js/codecs.js";
import { Room, decodedLimit } from "../../../js/limits.js";
import { readFile } from "../../../js/read.js";
import { sourceFormatLabel } from "../../../js/registry.js";
import { decodeSignal } from "../../../js/signals.js";
import { sources } from "../../../js/mcz.js";

/** @param {{blob?: Blob, bytes?: Uint8Array, url?: string, headers?: object}} where */
export async function openMcz(where) {
  const bytes = await bytesOf(where);
  const file = readFile(bytes);
  const clips = [...file.clips.values()];
  return {
    size: bytes.length,
    nClips: clips.length,
    damage: [],
    rows: (from, to) => clips.slice(from, to).map((clip, i) => rowOf(clip, from + i)),
    clip: async (index) => readerOf(clips[index], bytes, file),
  };
}

async function bytesOf({ blob, bytes, url, headers }) {
  if (bytes) return bytes;
  if (blob) return new Uint8Array(await blob.arrayBuffer());
  const response = await fetch(url, { headers });
  if (!response.ok) throw new Error(`${url}: ${response.status} ${response.statusText}`);
  return new Uint8Array(await response.arrayBuffer());
}

function rateOf({ numerator, denominator }) {
  return numerator === 0 ? null : numerator / denominator;
}

const bytesOfSignal = ({ segments }) =>
  segments.reduce((sum, { payload }) => sum + payload.length, 0);

function rowOf({ name, nFrames, frameRate, signals, skeleton }, index) {
  return {
    index,
    name,
    nFrames,
    rate: rateOf(frameRate),
    codecs: [...new Set(signals.map(({ codec }) => codecLabel(codec)))],
    nChannels: skeleton.channels.length,
    bytes: signals.reduce((sum, signal) => sum + bytesOfSignal(signal), 0),
  };
}

function readerOf(clip, bytes, file) {
  const { name, nFrames, skeleton, source, quality, numbers } = clip;
  const limit = decodedLimit(file.size);
  return {
    name,
    nFrames,
    skeleton,
    rate: rateOf(clip.frameRate),
    metadata: [...clip.metadata],
    source: source && { path: source.path, format: sourceFormatLabel(source.format) },
    quality: quality ?? [],
    firstFrame: Number(numbers[0].number),
    lost: [],
    events: [],
    signals: clip.signals.map((signal) => ({
      name: signal.name,
      codec: codecLabel(signal.codec),
      channels: signal.channels,
      ownChannels: signal.ownChannels,
      samplesPerFrame: signal.samplesPerFrame,
      nResolutions: signal.nResolutions,
      bytes: bytesOfSignal(signal),
      segments: segmentsOf(signal, nFrames),
    })),
    async read(index, from, to) {
      const room = new Room(limit);
      const { values, mask } = decodeSignal(clip, clip.signals[index], { from, to, dropped: 0, room });
      return { values, mask };
    },
    async sourceBytes() {
      const found = sources(bytes).find(({ path }) => path === source?.path);
      return found?.bytes ?? null;
    },
  };
}

/** Frames of the clip that each segment has. */
function segmentsOf({ segments, skip }, nFrames) {
  return segments
    .map(({ firstFrame, nFrames: n }) => [
      Math.max(0, firstFrame - skip),
      Math.min(nFrames, firstFrame + n - skip),
    ])
    .filter(([from, to]) => to > from);
}
