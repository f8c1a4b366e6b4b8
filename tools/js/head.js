// SPEC.md, "HEAD" and "Versions".

import { ByteReader } from "./bytes.js";
import { Unsupported } from "./errors.js";
import { profile } from "./limits.js";

const MAJOR = 0;
const LEAST_MINOR = 2; // CLIP and INDX of 0.1 were others
const GREATEST_MINOR = 9;

/** The version of SPEC.md that this decoder follows. */
export const VERSION = `${MAJOR}.${GREATEST_MINOR}`;

/**
 * @param {Uint8Array} payload of HEAD
 * @returns {object} the limits of the profile
 * @throws {Refused | Unsupported}
 */
export function readHead(payload) {
  const reader = new ByteReader(payload, "HEAD");
  reader.take(2); // the version of the writer
  const needsMajor = reader.u8();
  const needsMinor = reader.u8();
  const profileId = reader.u8();
  reader.rest();
  if (needsMajor !== MAJOR || needsMinor < LEAST_MINOR || needsMinor > GREATEST_MINOR) {
    throw new Unsupported(`a file that needs version ${needsMajor}.${needsMinor}`);
  }
  return profile(profileId);
}
