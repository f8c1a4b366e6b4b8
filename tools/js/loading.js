// The bytes of segments, fetched by ranges, checked, and compared with what the index says.

import { FRAMING_SIZE, HEADER_SIZE } from "./chunks.js";
import { frameSegment, impliedMask, readSegment } from "./data.js";
import { Refused } from "./errors.js";
import { CHECK_SIZE, MOST_HEAD, indexedBody } from "./packets.js";
import { payloadIn } from "./ranges.js";

const LISTED = ["signal", "nFrames", "lead", "tail", "flags"]; // what an index says of a segment

/**
 * @param {{ranges: import("./ranges.js").Ranges, limits: object}} file
 * @param {import("./clip.js").Clip} clip
 * @param {import("./clip.js").Signal} signal of it
 * @param {object[]} segments as the index has them
 * @returns {Promise<import("./data.js").Segment[]>} the same with their payloads
 * @throws {Refused}
 */
export async function loadSegments({ ranges, limits }, clip, signal, segments) {
  const parts = await ranges.readAll(segments.map(extentOf));
  const told = [...new Set(segments.map((segment) => segment.told ?? null))].filter(Boolean);
  const toldParts = await ranges.readAll(told.map(extentOf));
  const masks = told.map((segment, i) => impliedMask(indexedBody(toldParts[i], segment, null)));
  return segments.map((segment, i) => {
    const { packet, offset, size, firstFrame, fresh } = segment;
    const place = { type: "DATA", offset: offset - HEADER_SIZE, length: size };
    const mask = segment.told ? masks[told.indexOf(segment.told)] : segment.mask;
    const payload = packet ? indexedBody(parts[i], segment, mask) : payloadIn(parts[i], place);
    const reading = { ...signal, due: firstFrame };
    if (packet > 1) {
      const frame = { body: payload, fresh, number: firstFrame, mask };
      return { ...frameSegment(frame, reading, limits), offset };
    }
    const signals = [...clip.signals];
    signals[signal.index] = reading;
    const found = readSegment(payload, { ...clip, signals }, limits);
    if (LISTED.some((field) => found[field] !== segment[field])) {
      throw new Refused(`DATA at ${place.offset}: it is not as the index says`);
    }
    return { ...found, offset };
  });
}

/** Where the bytes of a segment lie, with what checks them. */
function extentOf({ packet, offset, size }) {
  if (packet === 0) {
    return { start: offset - HEADER_SIZE, stop: offset - HEADER_SIZE + FRAMING_SIZE + size };
  }
  return { start: Math.max(0, offset - MOST_HEAD), stop: offset + size + CHECK_SIZE };
}
