// SPEC.md, "Rows in the metric": how channels of well-known skeletons move together, from the annex.

import { annexJson } from "./annex.js";

const UNITS = 64;
const VARIANCE_UNITS = 16;
const parsed = new WeakMap();

/**
 * What rows of a skeleton are known to do before the first, as arrays that nobody changes.
 *
 * @typedef {object} Prior
 * @property {Float64Array[]} lower of each row of L what is left of the diagonal
 * @property {Float64Array} variances
 */

/**
 * @param {number} number of the prior, from 1
 * @returns {Prior | null} null where the annex has none of this number
 * @throws {import("./errors.js").Unsupported} where the annex is not there
 */
export function priorOf(number) {
  const document = annexJson("posewave_priors.json");
  if (!parsed.has(document)) parsed.set(document, document.priors.map(read));
  return parsed.get(document)[number - 1] ?? null;
}

function read({ lower, variances }) {
  const bytes = Int8Array.from(lower.join("").match(/../g), (digits) => parseInt(digits, 16));
  return {
    lower: variances.map((_, row) => {
      const at = (row * (row - 1)) / 2;
      return Float64Array.from(bytes.subarray(at, at + row), (byte) => byte / UNITS);
    }),
    variances: Float64Array.from(variances, (x) => x / VARIANCE_UNITS),
  };
}
