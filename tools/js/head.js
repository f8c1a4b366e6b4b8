// SPEC.md, "HEAD" and "Versions".

import { ByteReader } from "./bytes.js";
import { Unsupported } from "./errors.js";
import { profile } from "./limits.js";

const MAJOR = 1;
const MINOR = 0;

/** The version of SPEC.md that this decoder follows. */
export const VERSION = `${MAJOR}.${MINOR}`;

/** The payload of HEAD that a file is read with which has lost its own. */
export const BASE_HEAD = Uint8Array.of(MAJOR, MINOR, MAJOR, MINOR, 0);

/**
 * The version that a file or a clip needs, major x 256 + minor.
 *
 * @param {ByteReader} reader
 * @throws {Unsupported} where it is not read here
 */
export function readNeeds(reader) {
  const major = reader.u8();
  const minor = reader.u8();
  if (major > MAJOR || (major === MAJOR && minor > MINOR)) {
    throw new Unsupported(`${reader.what}: it needs version ${major}.${minor}`);
  }
  if (major === 0) {
    throw new Unsupported(`${reader.what}: it needs version ${major}.${minor}, which mcz 0.9 reads`);
  }
  return major * 256 + minor;
}

/**
 * @param {Uint8Array} payload of HEAD
 * @returns {object} the limits of the profile
 * @throws {Refused | Unsupported}
 */
export function readHead(payload) {
  const reader = new ByteReader(payload, "HEAD");
  reader.take(2); // the version of the writer
  readNeeds(reader);
  const profileId = reader.u8();
  reader.rest();
  return profile(profileId);
}
