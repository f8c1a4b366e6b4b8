// SPEC.md, "Rows in the metric": what the integers of a row are predicted from, in binary64.

import { clamp } from "./entropy.js";
import { N_KINDS, N_TAPS } from "./pose-start.js";

const BLOCK = 64;
const MEMORY = 0.996;
const NOISE = 0.1;
const PRIOR = 2;
const CARRIED = 40;
const SEEN = 25;

const LANES = 32;
const TAP_MEMORY = 0.98;
const TAP_RATE = 0.012;
const MOST_TAP = 2;
const START_ENERGY = 500;

/** What channels of a row tell of later ones: L D L' of each block of channels. */
export class AcrossChannels {
  /** @param {number} nChannels */
  constructor(nChannels) {
    const nBlocks = Math.ceil(nChannels / BLOCK);
    /** Where each block begins, and where the last one ends. */
    this.starts = Int32Array.from({ length: nBlocks + 1 }, (_, b) =>
      Math.floor((b * nChannels) / nBlocks),
    );
    /** Columns of L, BLOCK numbers each, those of a block one after the other. */
    this.columns = new Float64Array(nBlocks * BLOCK * BLOCK);
    this.variances = new Float64Array(nBlocks * BLOCK).fill(PRIOR);
    this.count = 0;
    /** What is foretold of each channel of a row. */
    this.means = new Float64Array(nChannels);
  }

  /**
   * Begins with a prior.
   *
   * @param {import("./pose-prior.js").Prior} prior of all channels
   * @param {ArrayLike<number>} kept channels
   */
  learnt({ lower, variances }, kept) {
    const { starts } = this;
    for (let block = 0; block + 1 < starts.length; block++) {
      for (let c = starts[block]; c < starts[block + 1]; c++) {
        const at = block * BLOCK + c - starts[block];
        this.variances[at] = variances[kept[c]];
        for (let d = c + 1; d < starts[block + 1]; d++) {
          this.columns[at * BLOCK + d - starts[block]] = lower[kept[d]][kept[c]];
        }
      }
    }
    this.count = SEEN;
  }

  /** Lets a level begin with what the coarser ones have taught. */
  begin() {
    if (this.count <= CARRIED) return;
    const share = CARRIED / this.count;
    for (let i = 0; i < this.variances.length; i++) this.variances[i] *= share;
    this.count = CARRIED;
  }

  /**
   * Adds to the means of the later channels of a block what the miss of one says of them.
   *
   * @param {number} block
   * @param {number} c the channel
   * @param {number} miss
   */
  spread(block, c, miss) {
    const { means, columns, starts } = this;
    let at = (block * BLOCK + c - starts[block]) * BLOCK + c - starts[block] + 1;
    for (let b = c + 1; b < starts[block + 1]; b++, at++) means[b] += columns[at] * miss;
  }

  /**
   * Learns from a row.
   *
   * @param {Float64Array} rest what was missed in time; it is used up
   * @param {number} share what the row counts for
   */
  learn(rest, share) {
    for (let block = 0; block + 1 < this.starts.length; block++) this.update(block, rest, share);
    this.count = this.count * MEMORY + 1;
  }

  /** A step of Bennett's update for each channel of a block. */
  update(block, rest, weight) {
    const { columns, variances, starts } = this;
    const first = starts[block];
    const size = starts[block + 1] - first;
    let share = weight;
    for (let a = 0; a < size; a++) {
      const miss = rest[first + a];
      const before = variances[block * BLOCK + a] * MEMORY + NOISE;
      const after = before + share * miss * miss;
      const gain = (share * miss) / after;
      share *= before / after;
      variances[block * BLOCK + a] = after;
      const line = (block * BLOCK + a) * BLOCK;
      for (let b = a + 1; b < size; b++) {
        const left = rest[first + b] - miss * columns[line + b];
        rest[first + b] = left;
        columns[line + b] += gain * left;
      }
    }
  }
}

/** What rows before, and rows of the level above, tell of a row: five of them, with taps. */
export class InTime {
  /**
   * @param {number} nChannels
   * @param {Float64Array} taps of each kind of level two sets
   */
  constructor(nChannels, taps) {
    this.taps = taps.slice();
    this.energies = new Float64Array(2 * N_KINDS * N_TAPS).fill(START_ENERGY);
    this.means = new Float64Array(nChannels);
    this.scales = new Float64Array(nChannels);
    this.products = new Float64Array(padded(nChannels));
    this.first = 0;
    this.sources = [];
  }

  /**
   * Sets `means` of a row.
   *
   * @param {number} set of taps
   * @param {Float64Array[]} sources integers of five rows
   */
  begin(set, sources) {
    const { means, taps } = this;
    this.first = set * N_TAPS;
    this.sources = sources;
    means.fill(0);
    sources.forEach((source, k) => {
      const tap = taps[this.first + k];
      for (let c = 0; c < means.length; c++) means[c] += tap * source[c];
    });
  }

  /**
   * Learns from the row; `means` is used up.
   *
   * @param {Float64Array} values its integers
   * @param {Float64Array} usual magnitudes of each channel
   * @param {number} share what the row counts for
   */
  learn(values, usual, share) {
    const { means, scales, products, taps, energies, first } = this;
    const n = means.length;
    for (let c = 0; c < n; c++) {
      scales[c] = share / (usual[c] + 0.3);
      means[c] = (values[c] - means[c]) * scales[c];
    }
    this.sources.forEach((source, k) => {
      const at = first + k;
      products.fill(0);
      for (let c = 0; c < n; c++) products[c] = source[c] * source[c] * scales[c];
      energies[at] = energies[at] * TAP_MEMORY + folded(products);
      products.fill(0);
      for (let c = 0; c < n; c++) products[c] = source[c] * means[c];
      const rate = energies[at] * (1 - TAP_MEMORY) + 5;
      taps[at] = clamp(taps[at] + (TAP_RATE * folded(products)) / rate, -MOST_TAP, MOST_TAP);
    });
  }
}

/**
 * The sum of values, a multiple of 32 of them: lanes of 32 are added, then the halves of what is
 * left. The values are used up.
 *
 * @param {Float64Array} values
 */
export function folded(values) {
  for (let at = LANES; at < values.length; at++) values[at % LANES] += values[at];
  for (let half = LANES / 2; half >= 4; half /= 2) {
    for (let c = 0; c < half; c++) values[c] += values[c + half];
  }
  return values[0] + values[1] + (values[2] + values[3]);
}

/** The least multiple of 32 that is not below n. */
export function padded(n) {
  return LANES * Math.ceil(n / LANES);
}
