// SPEC.md, "Limits and profiles".

import { LimitExceeded, Unsupported } from "./errors.js";

const MIB = 2 ** 20;

/** The limits of each profile, by its id in HEAD; `plain`: see plain.js. */
const PROFILES = [
  {
    name: "base",
    channels: 16384,
    joints: 4096,
    segmentBytes: 64 * MIB,
    modelBytes: 64 * MIB,
    payloadBytes: 2 ** 31,
    packetBytes: 64 * 1024,
    templateBytes: 64 * MIB,
    signals: 2 ** 16,
    rows: 2 ** 23,
    plain: false,
  },
  {
    name: "large",
    channels: 2 ** 20,
    joints: 2 ** 18,
    segmentBytes: 2 ** 34,
    modelBytes: 2 ** 31,
    payloadBytes: 2 ** 40,
    packetBytes: 64 * 1024,
    templateBytes: 2 ** 31,
    signals: 2 ** 20,
    rows: 2 ** 31,
    plain: false,
  },
  {
    name: "small",
    channels: 256,
    joints: 256,
    segmentBytes: 2 * MIB,
    modelBytes: 0,
    payloadBytes: 64 * 1024,
    packetBytes: 64 * 1024,
    templateBytes: 64 * 1024,
    signals: 16,
    rows: 1024,
    plain: true,
  },
];

const LEAST_DECODED_BYTES = 64 * MIB;
const DECODED_RATIO = 4096;
const LEAST_INDEX_BYTES = 64 * 1024;
const INDEX_RATIO = 2;
const MOST_HELD = 512 * MIB;

/**
 * The limits of a profile.
 *
 * @param {number} id the profile of HEAD
 * @throws {Unsupported} where the profile is unknown
 */
export function profile(id) {
  if (id >= PROFILES.length) throw new Unsupported(`profile ${id} is unknown`);
  return PROFILES[id];
}

/** Throws {@link LimitExceeded} where `value` is beyond `limit`. */
export function within(value, limit, what) {
  if (value > limit) throw new LimitExceeded(`${what}: ${value} is beyond the limit of ${limit}`);
}

/**
 * Bytes that one signal, attachment or source file may become, unless the caller says otherwise.
 *
 * @param {number} fileBytes bytes of the file
 */
export function decodedLimit(fileBytes) {
  return Math.max(LEAST_DECODED_BYTES, DECODED_RATIO * fileBytes);
}

/** Signals or files that are held at once: they have a limit each, and one together. */
export class Room {
  /** @param {number} limit bytes of each */
  constructor(limit) {
    this.limit = limit;
    this.left = Math.max(limit, MOST_HELD);
  }

  /**
   * Throws {@link LimitExceeded} where there is no room for so many bytes more.
   *
   * @param {number} bytes
   */
  take(bytes) {
    within(bytes, this.left, "bytes beside what else is held at once");
    this.left -= bytes;
  }
}

/** Bytes that an INDX may inflate to. */
export function indexLimit(fileBytes) {
  return Math.max(LEAST_INDEX_BYTES, INDEX_RATIO * fileBytes);
}

/** Decoded bytes of some rows: 8 a value, and 8 a row where there are no channels. */
export function decodedBytes(rows, nChannels) {
  return 8 * rows * Math.max(1, nChannels);
}
