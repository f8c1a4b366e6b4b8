// The directory of a file that has no index, from a walk through it.

import { hex } from "./bytes.js";
import { Rows } from "./directory.js";
import { decodedLimit, within } from "./limits.js";
import { supplied } from "./missing.js";
import { packetOf } from "./packets.js";
import { readFile } from "./read.js";
import { ALIAS_OF } from "./shared.js";

const MOST_WALKED = 2 ** 29; // bytes of a file that is walked through strictly

/**
 * @param {import("./ranges.js").Ranges} ranges
 * @param {number} [limit] bytes that an attachment or template may inflate to
 * @returns {Promise<import("./directory.js").Directory>}
 * @throws {import("./errors.js").MczError}
 */
export async function walked(ranges, limit) {
  within(ranges.size, MOST_WALKED, "bytes of a file without an index");
  const bytes = await ranges.read(0, ranges.size);
  const options = { decodedLimit: limit ?? decodedLimit(bytes.length) };
  return directoryFrom(await supplied(() => readFile(bytes, options)));
}

/**
 * @param {import("./read.js").MczFile} file as a walk has found it
 * @returns {import("./directory.js").Directory}
 */
export function directoryFrom(file) {
  const rows = Array.from(file.clips.values(), rowFrom);
  const list = new Rows(rows.length, (i) => rows[i]);
  const ancillary = rows.flatMap((row) => row.ancillary);
  return {
    head: file.head,
    shared: new Map(file.shared.map((chunk) => [`${chunk.type} ${hex(chunk.id)}`, chunk])),
    attachments: new Map(Array.from(file.attachments.values(), (of) => [of.name, placesOf(of)])),
    aliases: new Map(Array.from(file.aliases.values(), (of) => [of.name, targetOf(of)])),
    rows: list,
    metadata: ancillary.filter(({ type }) => type === "META"),
  };
}

function placesOf({ name, size, chunks }) {
  return { name, size, parts: chunks.map((chunk) => ({ type: "ATTA", ...chunk })) };
}

function targetOf({ name, of, target }) {
  return { name, of, target: of === ALIAS_OF.SKELETON ? hex(target.id) : target.name };
}

function rowFrom(clip) {
  const { name, nFrames, frameRate, offset, payloadSize, end, ancillary } = clip;
  const segments = clip.segments.map(withoutPayload);
  return {
    name,
    skeletonId: hex(clip.skeleton.id),
    nFrames,
    frameRate,
    signals: clip.signals.map(({ channels, ...signal }) => {
      const { samplesPerFrame, skip, spare, codec, preset, codecVersion } = signal;
      const nChannels = channels.length;
      return { nChannels, samplesPerFrame, skip, spare, codec, preset, codecVersion };
    }),
    place: { type: "CLIP", offset, length: payloadSize },
    end: end && { type: "CEND", offset: end.offset, length: end.length },
    bytes: segments.reduce((sum, { size }) => sum + size, 0),
    ancillary,
    segments: () => segments,
    damage: clip.damage ?? [],
  };
}

function withoutPayload({ payload, tableAt, ...segment }) {
  return { ...segment, packet: packetOf(segment.indexFlags).kind };
}
