// SPEC.md, "Codec 3: posewave", "The head": which channels are kept, and a number of each.

import { Refused } from "./errors.js";

const MAX_LENGTH = 40;

// Contexts, counted from the first one of the head.
const LENGTH = 6;
const SIGN = 246;
const SECOND = 252;

/** Contexts of a head. */
export const HEAD_CONTEXTS = 492;

/**
 * @param {import("./entropy.js").RangeDecoder} coder
 * @param {import("./entropy.js").Model} model
 * @param {number} first context of the head
 * @param {ArrayLike<number>} kinds of each channel 0 for a rotation, 1 for a position, 2 for others
 * @param {string} what names the stream in messages
 * @returns {{kept: Uint8Array, numbers: Float64Array}} of each channel
 * @throws {Refused}
 */
export function readHead(coder, model, first, kinds, what) {
  const kept = new Uint8Array(kinds.length);
  const numbers = new Float64Array(kinds.length);
  let before = 1;
  for (let c = 0; c < kinds.length; c++) {
    before = model.adaptive(coder, first + 2 * kinds[c] + before);
    kept[c] = before;
    numbers[c] = readNumber(coder, model, first, 2 * kinds[c] + before, what);
  }
  return { kept, numbers };
}

/**
 * A number of some bits.
 *
 * @param {import("./entropy.js").RangeDecoder} coder
 * @param {import("./entropy.js").Model} model
 * @param {number} first context of the head
 * @param {number} own 0 to 5: whose contexts it has
 * @param {string} what names the stream in messages
 * @throws {Refused} where it has 40 bits or more
 */
export function readNumber(coder, model, first, own, what) {
  let length = 0;
  while (model.adaptive(coder, first + LENGTH + MAX_LENGTH * own + length)) {
    length++;
    if (length === MAX_LENGTH) throw new Refused(`${what}: a number of ${length} bits`);
  }
  if (length === 0) return 0;
  let size = 1;
  if (length > 1) size = 2 + model.adaptive(coder, first + SECOND + MAX_LENGTH * own + length);
  if (length > 2) size = size * 2 ** (length - 2) + coder.number(length - 2);
  return model.adaptive(coder, first + SIGN + own) ? -size : size;
}
