// SPEC.md, "Rows in the metric": what is known before a segment, from the annex.

import { annexJson } from "./annex.js";
import { Model } from "./entropy.js";
import { HEAD_CONTEXTS } from "./pose-head.js";
import { N_INPUTS, N_SECOND, N_SLOTS, Opinions } from "./pose-opinions.js";

/** Kinds of levels, features of a channel, taps of a mean in time. */
export const N_KINDS = 6;
export const N_FEATURES = 16;
export const N_TAPS = 5;

/** Contexts of opinions that all channels share, and those that each channel has beside them. */
export const N_SHARED = 1280;
export const N_OWN = 36;

/** Sets of weights that all channels share; each channel has one more. Second thoughts. */
export const N_SETS = 64;
export const N_SCALES = 16;

/** Single bits of a segment: contexts of its rows, then those of its head. */
export const HEAD = 676;
const N_SMALL_MIXERS = 12;

const parsed = new WeakMap();

/**
 * A start table, as arrays that nobody changes. Those of channels are by class.
 *
 * @typedef {object} Start
 * @property {Uint16Array} probabilities of the shared slots
 * @property {Uint8Array} counts
 * @property {Uint16Array[]} ownProbabilities of the slots of a channel
 * @property {Uint8Array[]} ownCounts
 * @property {Float64Array} weights of the shared sets
 * @property {Float64Array[]} ownWeights of the set of a channel
 * @property {Int32Array} second of a scale
 * @property {Model} small
 * @property {Float64Array} taps
 * @property {Float64Array} levelSizes
 * @property {Float64Array} ownSizes
 * @property {Float64Array} usual
 */

/**
 * @param {number} index of the start table, 0 or 1
 * @returns {Start}
 * @throws {import("./errors.js").Unsupported} where the annex is not there
 */
export function startTable(index) {
  const document = annexJson("posewave_start.json");
  if (!parsed.has(document)) {
    parsed.set(
      document,
      document.sets.map((table) => startOf(table, document.counts)),
    );
  }
  return parsed.get(document)[index];
}

/** `counts` are what digits of counts stand for. */
function startOf(table, counts) {
  const probabilities = Uint16Array.from(bytes(table.probabilities), middle);
  const known = countsOf(table.counts, counts);
  const weights = Float64Array.from(bytes(table.weights), (byte) => (byte - 128) * 1024);
  const [shared, own] = [N_SHARED * N_SLOTS, N_OWN * N_SLOTS];
  const [sets, set] = [N_SETS * N_SLOTS * N_INPUTS, N_SLOTS * N_INPUTS];
  return {
    probabilities: probabilities.subarray(0, shared),
    counts: known.subarray(0, shared),
    ownProbabilities: parts(probabilities.subarray(shared), own),
    ownCounts: parts(known.subarray(shared), own),
    weights: weights.subarray(0, sets),
    ownWeights: parts(weights.subarray(sets), set),
    second: Int32Array.from(bytes(table.second), middle),
    small: smallOf(table, counts),
    taps: fractions(table.taps),
    levelSizes: fractions(table.level_sizes),
    ownSizes: parts(fractions(table.own_sizes), N_FEATURES),
    usual: fractions(table.usual),
  };
}

function smallOf(table, counts) {
  const small = Model.even(HEAD + HEAD_CONTEXTS, N_SMALL_MIXERS);
  small.probabilities.set(Array.from(bytes(table.small_probabilities), middle));
  small.counts.set(countsOf(table.small_counts, counts));
  small.weights.set(table.small_weights);
  return small;
}

const bytes = (lines) => Uint8Array.from(lines.join("").match(/../g), (x) => parseInt(x, 16));
const countsOf = (lines, counts) =>
  Uint8Array.from(lines.join(""), (digit) => counts[parseInt(digit, 16)]);
const middle = (byte) => 256 * byte + 128;
const fractions = (integers) => Float64Array.from(integers, (x) => x / 1024);

/** An array in parts of `size` each. */
function parts(array, size) {
  return Array.from({ length: array.length / size }, (_, i) =>
    array.subarray(i * size, (i + 1) * size),
  );
}

/**
 * The opinions that a segment begins with.
 *
 * @param {Start} start
 * @param {Uint8Array} classes of its kept channels
 * @returns {Opinions}
 */
export function startOpinions(start, classes) {
  const ofEach = (lists) => Array.from(classes, (of) => lists[of]);
  const second = new Int32Array(N_SCALES * N_SLOTS * N_SECOND);
  for (let at = 0; at < second.length; at += start.second.length) second.set(start.second, at);
  return new Opinions(
    joined(start.probabilities, ofEach(start.ownProbabilities)),
    joined(start.counts, ofEach(start.ownCounts)),
    joined(start.weights, ofEach(start.ownWeights)),
    second,
  );
}

function joined(first, others) {
  const size = others.reduce((sum, { length }) => sum + length, first.length);
  const out = new first.constructor(size);
  out.set(first);
  let at = first.length;
  for (const other of others) {
    out.set(other, at);
    at += other.length;
  }
  return out;
}
