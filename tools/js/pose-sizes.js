// SPEC.md, "Rows in the metric": how large the integers of a row will be, from magnitudes
// around them.

import { clamp } from "./entropy.js";
import { folded, padded } from "./pose-prediction.js";
import { N_FEATURES } from "./pose-start.js";

// Features of a channel: magnitudes that are known before its integer is.
export const BEFORE_1 = 0;
export const BEFORE_2 = 1;
const BEFORE_3 = 2;
const GRAND = 3;
export const PARENT = 4;
export const PARENT_NEXT = 5;
const PARENT_LAST = 6;
const SIDE_1 = 7;
const SIDE_2 = 8;
const SIDE_3 = 9;
const SIDE_4 = 10;
export const ROW = 11;
const ROW_BEFORE = 12;
const ROW_PARENT = 13;
export const USUAL = 14;
export const SCALED = 15;

// prettier-ignore
const OF_ROWS = [
  BEFORE_1, BEFORE_2, BEFORE_3, GRAND, PARENT, PARENT_NEXT, PARENT_LAST, ROW_BEFORE, ROW_PARENT,
  USUAL,
];

const OF_CHANNELS = [SIDE_1, SIDE_2, SIDE_3, SIDE_4, ROW, SCALED];

/** Largest magnitude. */
export const MOST_SIZE = 4096;
const LEAST_SIZE = 0.008;
const BASE_SIZE = 0.015;

const LEVEL_RATE = 0.016;
const OWN_RATE = 0.032;
const USUAL_RATE = 0.06;
const CHANNELS = 62;

/** Sixths of an octave: LOGS[k] = floor(6 log2(1 + k / 4)). */
const LOGS = new Int32Array(1024);
for (let k = 0, e = 0; k < LOGS.length; k++) {
  while (4n ** 6n << BigInt(e + 1) <= BigInt(4 + k) ** 6n) e++;
  LOGS[k] = e;
}

/**
 * About 6 log2(1 + 4 value).
 *
 * @param {number} value at least 0
 * @returns {number} at most 95
 */
export function logOf(value) {
  const x = value * 16;
  if (x < 1024) return LOGS[x | 0];
  return LOGS[x < 65536 ? (x | 0) >> 6 : 1023] + 36;
}

/** Two sizes of each integer of a row: what the level's weights, and what the channel's make of it. */
export class Sizes {
  /**
   * @param {Uint8Array} classes of the channels
   * @param {import("./pose-start.js").Start} start
   */
  constructor(classes, start) {
    const n = classes.length;
    const ofEach = (make) => Array.from({ length: N_FEATURES }, make);
    this.n = n;
    this.levelWeights = start.levelSizes.slice();
    this.ownWeights = ofEach((_, k) => Float64Array.from(classes, (of) => start.ownSizes[of][k]));
    this.features = ofEach(() => new Float64Array(n));
    /** What is usual of each channel. */
    this.usual = this.features[USUAL];
    classes.forEach((of, c) => (this.usual[c] = start.usual[of]));
    /** The two sizes, and what they should have been. */
    this.one = new Float64Array(n);
    this.two = new Float64Array(n);
    this.found = new Float64Array(n);
    this.spare = new Float64Array(n);
    this.products = new Float64Array(padded(n));
    this.first = 0;
  }

  /**
   * Begins a row: what other rows tell.
   *
   * @param {number} kind of the level
   * @param {Float64Array[]} rows features 0 to 6
   * @param {number} before mean magnitude of the row before
   * @param {number} parent mean magnitude of the row above
   */
  begin(kind, rows, before, parent) {
    const { n, features, one, two, levelWeights, ownWeights } = this;
    this.first = kind * N_FEATURES;
    rows.forEach((row, k) => (features[k] = row));
    features[ROW_BEFORE].fill(before);
    features[ROW_PARENT].fill(parent);
    one.fill(BASE_SIZE);
    two.fill(BASE_SIZE);
    for (const k of OF_ROWS) {
      const source = features[k];
      const weight = levelWeights[this.first + k];
      const own = ownWeights[k];
      for (let c = 0; c < n; c++) {
        one[c] += weight * source[c];
        two[c] += own[c] * source[c];
      }
    }
  }

  /**
   * Adds what the channels before a channel tell, two products at a time.
   *
   * @param {number} c the channel
   * @param {Float64Array} told magnitudes of the four channels before, the last first; the row's mean;
   *   what is usual, scaled
   */
  add(c, told) {
    const { features, one, two, levelWeights, ownWeights, first } = this;
    let m1 = one[c];
    let m2 = two[c];
    for (let i = 0; i < OF_CHANNELS.length; i += 2) {
      const [k, next] = [OF_CHANNELS[i], OF_CHANNELS[i + 1]];
      const [x, y] = [told[i], told[i + 1]];
      features[k][c] = x;
      features[next][c] = y;
      if (i === 0) {
        m1 = m1 + levelWeights[first + k] * x + levelWeights[first + next] * y;
        m2 = m2 + ownWeights[k][c] * x + ownWeights[next][c] * y;
      } else {
        m1 += levelWeights[first + k] * x + levelWeights[first + next] * y;
        m2 += ownWeights[k][c] * x + ownWeights[next][c] * y;
      }
    }
    one[c] = clamp(m1, LEAST_SIZE, MOST_SIZE);
    two[c] = clamp(m2, LEAST_SIZE, MOST_SIZE);
  }

  /**
   * Learns from the row; the sizes are used up.
   *
   * @param {Float64Array} magnitudes of its integers
   */
  learn(magnitudes) {
    const { n, features, one, two, found, spare, products, usual } = this;
    spare.fill(2);
    for (const source of features) {
      for (let c = 0; c < n; c++) spare[c] += source[c] * source[c];
    }
    const rate = (LEVEL_RATE * CHANNELS) / Math.max(n, CHANNELS);
    for (let c = 0; c < n; c++) {
      const energy = 1 / spare[c];
      one[c] = (found[c] - one[c]) * rate * energy;
      two[c] = (found[c] - two[c]) * OWN_RATE * energy;
    }
    features.forEach((source, k) => {
      const own = this.ownWeights[k];
      products.fill(0);
      for (let c = 0; c < n; c++) {
        own[c] += two[c] * source[c];
        products[c] = one[c] * source[c];
      }
      this.levelWeights[this.first + k] += folded(products);
    });
    for (let c = 0; c < n; c++) usual[c] += (magnitudes[c] - usual[c]) * USUAL_RATE;
  }
}
