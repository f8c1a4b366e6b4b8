// SPEC.md, "Conventions": deflate after words.

import { annexBytes } from "./annex.js";
import { inflate } from "./inflate.js";

/**
 * Inflates a raw deflate stream whose distances may reach back into the annex of words.
 *
 * @param {Uint8Array} data the stream, nothing before or behind it
 * @param {number} size bytes that it MUST inflate to
 * @param {string} what named in messages
 * @returns {Uint8Array}
 * @throws {Refused | Unsupported} the latter without the annex
 */
export function inflateAfterWords(data, size, what) {
  return inflate(data, size, what, annexBytes("words.bin"));
}
