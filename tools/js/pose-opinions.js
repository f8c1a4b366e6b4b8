// SPEC.md, "Rows in the metric": decisions of which several contexts have an opinion.

import { GREATEST_COUNT, GREATEST_WEIGHT, NODES, RATE, SQUASH, STRETCH } from "./entropy.js";

/** Contexts that have an opinion on a decision. */
const N_OPINIONS = 4;

/** Decisions on one integer, one after the other: each context, set and second thought has 12. */
export const N_SLOTS = 12;

/** What is weighed: the opinions, and a bias. */
export const N_INPUTS = N_OPINIONS + 1;

/** Numbers of a second thought. */
export const N_SECOND = NODES.length;

const BIAS = 77;
const LIMIT = 2047;
const LEAST_CHANCE = 16;

/** What an opinion counts for that has seen n bits, in 65536ths. */
const TRUST = new Int32Array(GREATEST_COUNT + 1);
for (let n = 0; n < TRUST.length; n++) TRUST[n] = Math.floor((65536 * (10 * n + 4)) / (10 * n + 16));

const between = (v, a, b) => Math.max(a, Math.min(v, b));

/** Contexts, sets of weights, and second thoughts. */
export class Opinions {
  /**
   * All are of every context, set or scale {@link N_SLOTS} times as many numbers.
   *
   * @param {Uint16Array} probabilities
   * @param {Uint8Array} counts
   * @param {Float64Array} weights {@link N_INPUTS} each; integers, as doubles because their
   *   products do not fit 32 bits
   * @param {Int32Array} second {@link N_SECOND} each
   */
  constructor(probabilities, counts, weights, second) {
    this.probabilities = probabilities;
    this.counts = counts;
    this.weights = weights;
    this.second = second;
    /** The contexts that have an opinion at the moment. */
    this.contexts = new Int32Array(N_OPINIONS);
    this.inputs = new Int32Array(N_INPUTS);
    this.inputs[N_OPINIONS] = BIAS;
  }

  /**
   * A decision.
   *
   * @param {import("./entropy.js").RangeDecoder} coder
   * @param {number} slot number of the decision
   * @param {number} set of weights
   * @param {number} otherSet
   * @param {number} scale whose second thoughts count
   * @returns {0 | 1}
   */
  decide(coder, slot, set, otherSet, scale) {
    const { probabilities, counts, weights, second, contexts, inputs } = this;
    const one = (set * N_SLOTS + slot) * N_INPUTS;
    const other = (otherSet * N_SLOTS + slot) * N_INPUTS;
    let dot = (weights[one + N_OPINIONS] + weights[other + N_OPINIONS]) * BIAS;
    for (let k = 0; k < N_OPINIONS; k++) {
      const at = contexts[k] * N_SLOTS + slot;
      const said = (STRETCH[probabilities[at] >> 4] * TRUST[counts[at]]) >> 16;
      inputs[k] = said;
      dot += (weights[one + k] + weights[other + k]) * said;
    }
    const x = Math.floor(between(dot / 65536, -LIMIT, LIMIT)) + 2048;
    const chance = SQUASH[x];
    const node = (scale * N_SLOTS + slot) * N_SECOND + (x >> 7);
    const share = x & 127;
    const later = (second[node] * (128 - share) + second[node + 1] * share) >> 7;
    const final = (chance + later + 1) >> 1;
    const bit = coder.decode(between(final, LEAST_CHANCE, 65536 - LEAST_CHANCE));

    const error = (bit << 16) - chance;
    for (let k = 0; k < N_INPUTS; k++) {
      const change = (inputs[k] * error + 32768) >> 16;
      weights[one + k] = between(weights[one + k] + change, -GREATEST_WEIGHT, GREATEST_WEIGHT);
      weights[other + k] = between(weights[other + k] + change, -GREATEST_WEIGHT, GREATEST_WEIGHT);
    }
    const target = bit ? 65535 : 0;
    for (let k = 0; k < N_OPINIONS; k++) {
      const at = contexts[k] * N_SLOTS + slot;
      const n = counts[at];
      probabilities[at] += ((target - probabilities[at]) * RATE[n]) >> 16;
      if (n < GREATEST_COUNT) counts[at] = n + 1;
    }
    second[node] += ((target - second[node]) * (128 - share)) >> 14;
    second[node + 1] += ((target - second[node + 1]) * share) >> 14;
    return bit;
  }
}
