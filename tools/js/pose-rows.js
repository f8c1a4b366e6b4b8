// SPEC.md, "Rows in the metric": rows of integers, coded with what rows around them tell.

import { clamp } from "./entropy.js";
import { Refused } from "./errors.js";
import { N_SLOTS } from "./pose-opinions.js";
import { AcrossChannels, InTime } from "./pose-prediction.js";
import * as sizing from "./pose-sizes.js";
import { N_OWN, N_SCALES, N_SETS, N_SHARED, startOpinions } from "./pose-start.js";

const { MOST_SIZE, Sizes, logOf } = sizing;

const MAX_INDEX = 2 ** 30;
const MOST_MEAN = 2 ** 31;
const UNIT = 4096;
const HALF = UNIT / 2;

// Of dependent quantization: the state after an even integer and after an odd one.
const NEXT = [
  [0, 5, 1, 6, 2, 4, 3, 7],
  [2, 7, 3, 4, 0, 6, 1, 5],
];
const BEFORE_ESCAPED = 48;
const MOST_LENGTH = 32;
const MAX_EXPONENT = 7;

// The first shared context of each opinion.
const C_MEAN = 0;
const C_LEVEL = 384;
const C_ROWS = 768;

// Contexts and mixers of single bits: whether a row is live, sides, low bits, lengths, exponents.
const C_FLAG = 0;
const C_SIGN = 208;
const C_EXTRA = 416;
const C_ESCAPE = 428;
const C_EXPONENT = 620;
const M_FLAG = 0;
const M_SIGN = 6;

/** The rows of a level that were decoded, and what later ones see of them: in steps of the level. */
class Level {
  constructor(nRows, n) {
    this.nRows = nRows;
    this.n = n;
    this.values = new Float64Array(nRows * n);
    this.magnitudes = new Float64Array(nRows * n);
    /** Mean magnitude of each row. */
    this.means = new Float64Array(nRows);
    this.nothing = new Float64Array(n);
  }

  /** Takes over the last rows of a level, to be followed by others. */
  follow(level, nRows) {
    const { n } = this;
    const first = level.nRows - nRows;
    this.values.set(level.values.subarray(first * n));
    this.magnitudes.set(level.magnitudes.subarray(first * n));
    this.means.set(level.means.subarray(first));
  }

  /** Those of a row; there is nothing above the first. */
  magnitudesOf(row) {
    return row < 0 ? this.nothing : this.magnitudes.subarray(row * this.n, (row + 1) * this.n);
  }

  valuesOf(row) {
    return row < 0 ? this.nothing : this.values.subarray(row * this.n, (row + 1) * this.n);
  }

  meanOf(row) {
    return row < 0 ? 0 : this.means[row];
  }
}

/** Decodes the rows of one level after the other. */
export class RowDecoder {
  /**
   * @param {{classes: Uint8Array, refining: boolean, dependent: boolean, prior: object}} header
   *   classes of all channels, whether rows have exponents, whether quantization is dependent, and
   *   a prior or null
   * @param {ArrayLike<number>} kept channels
   * @param {import("./entropy.js").Model} small of single bits, which the head has used
   * @param {import("./pose-start.js").Start} start
   */
  constructor(header, kept, small, start) {
    const n = kept.length;
    const classes = Uint8Array.from(kept, (c) => header.classes[c]);
    this.refining = header.refining;
    this.dependent = header.dependent;
    this.n = n;
    this.small = small;
    this.opinions = startOpinions(start, classes);
    this.across = new AcrossChannels(n);
    if (header.prior !== null) this.across.learnt(header.prior, kept);
    this.inTime = new InTime(n, start.taps);
    this.sizes = new Sizes(classes, start);
    this.told = new Float64Array(6);
    this.rest = new Float64Array(n);
    /** Rows of zeros, for a level that is not there. */
    this.none = new Level(1, n);
    this.here = this.none;
    this.parent = this.none;
  }

  /**
   * Decodes the rows of a level.
   *
   * @param {import("./entropy.js").RangeDecoder} coder
   * @param {number} level 0 for approximations, 1 and so on for details
   * @param {number} kind of the level, 0 to 5
   * @param {number} nRows
   * @param {string} what names the stream in messages
   * @returns {Float64Array} row after row, in steps of the level
   * @throws {Refused}
   */
  decode(coder, level, kind, nRows, what) {
    // Approximations are nobody's parents.
    this.grand = this.parent;
    this.parent = level > 1 ? this.here : this.none;
    this.here = new Level(nRows, this.n);
    this.kind = kind;
    this.across.begin();
    this.lastExponent = 0;
    this.rows(coder, 0, what);
    return this.here.values;
  }

  /** More rows of the same level, from another stream; gives these alone. */
  goOn(coder, nRows, what) {
    const { here, n } = this;
    // Three rows are looked back to; numbers of rows stay even, or odd.
    const nKnown = Math.min(here.nRows, 4 - (here.nRows % 2));
    this.here = new Level(nKnown + nRows, n);
    this.here.follow(here, nKnown);
    this.rows(coder, nKnown, what);
    return this.here.values.subarray(nKnown * n);
  }

  /** Decodes the rows of the level from one on. */
  rows(coder, first, what) {
    this.coder = coder;
    for (let row = first; row < this.here.nRows; row++) {
      if (!this.isLive(row)) {
        this.lastExponent = 0;
        continue;
      }
      if (this.refining) this.lastExponent = this.exponent(this.lastExponent);
      /** How many steps of the row are one of the level. */
      this.gain = 2 ** this.lastExponent;
      this.begin(row);
      this.integers(row, `${what}, row ${row}`);
      this.learn(row);
    }
  }

  /** By how many octaves the step of a row is finer, after that of the row before. */
  exponent(before) {
    const first = C_EXPONENT + MAX_EXPONENT * before;
    let found = 0;
    while (found < MAX_EXPONENT && this.small.adaptive(this.coder, first + found)) found++;
    return found;
  }

  /** The rows of the coarser level that are nearest in time: at, after and before it. */
  above(row) {
    const last = this.parent.nRows - 1;
    const up = Math.min(row >> 1, last);
    return [up, Math.min(up + 1, last), Math.max(up - 1, 0)];
  }

  /** Whether a row has anything but zeros. */
  isLive(row) {
    const { here, parent, kind } = this;
    const [up, next] = this.above(row);
    const before = here.meanOf(row - 1);
    const around =
      (before > 0 ? 1 : 0) +
      (here.meanOf(row - 2) > 0 ? 2 : 0) +
      (parent.means[up] > 0 ? 4 : 0) +
      (parent.means[next] > 0 ? 8 : 0);
    const large = Math.min(logOf(8 * before) >> 2, 7);
    const larger = Math.min(logOf(8 * parent.means[up]) >> 2, 7);
    const a = C_FLAG + 16 * kind + around;
    const b = C_FLAG + 96 + 8 * kind + large;
    return this.small.mixed(this.coder, M_FLAG + kind, a, b, C_FLAG + 144 + 8 * large + larger);
  }

  /** What other rows tell of a row: of its magnitudes, and of its integers. */
  begin(row) {
    const { here, parent, grand, kind } = this;
    const [up, next, last] = this.above(row);
    const rows = [row - 1, row - 2, row - 3].map((r) => here.magnitudesOf(r));
    rows.push(grand.magnitudesOf(Math.min(up >> 1, grand.nRows - 1)));
    rows.push(...[up, next, last].map((r) => parent.magnitudesOf(r)));
    this.rowBefore = here.meanOf(row - 1);
    this.sizes.begin(kind, rows, this.rowBefore, parent.means[up]);
    this.around = Math.min(logOf((this.rowBefore + parent.means[up]) * this.gain) >> 2, 7);
    const sources = [row - 1, row - 2].map((r) => here.valuesOf(r));
    sources.push(...[up, next, last].map((r) => parent.valuesOf(r)));
    this.inTime.begin(2 * kind + (row & 1), sources);
  }

  /** Decodes the integers of a row, channel by channel. */
  integers(row, what) {
    const { n, here, across, sizes, told, rowBefore, gain } = this;
    const { usual, found } = sizes;
    const values = here.valuesOf(row);
    const magnitudes = here.magnitudesOf(row);
    const timely = this.inTime.means;
    let total = 0;
    let totalUsual = 0;
    let block = 0;
    let state = 0;
    told.fill(0);
    across.means.fill(0);
    for (let c = 0; c < n; c++) {
      if (c === across.starts[block + 1]) block++;
      told[4] = c > 3 ? total / c : rowBefore;
      told[5] = (usual[c] * (total + rowBefore + 0.1)) / (totalUsual + rowBefore + 0.1);
      sizes.add(c, told);
      const mean = clamp((across.means[c] + timely[c]) * gain, -MOST_MEAN, MOST_MEAN);
      const fixed = Math.floor(mean * UNIT);
      const odd = state % 2 === 1;
      const among = odd ? fixed + clamp(fixed, -HALF, HALF) : fixed;
      const rounded = Math.floor((among + HALF) / UNIT);
      const integer = this.integer(c, among, rounded, odd);
      if (Math.abs(integer) > MAX_INDEX) throw new Refused(`${what}: ${integer} is beyond 2^30`);
      const value = odd ? integer - 0.5 * Math.sign(integer) : integer;
      if (this.dependent) state = NEXT[integer & 1][state];
      values[c] = value / gain;

      const miss = (value - fixed / UNIT) / gain;
      const size = Math.min(0.5 * Math.abs(miss) + 0.5 * Math.abs(values[c]), MOST_SIZE);
      magnitudes[c] = integer === 0 && rounded === 0 ? 0 : size;
      found[c] = Math.min(Math.abs(miss), MOST_SIZE);
      for (let k = 3; k > 0; k--) told[k] = told[k - 1];
      told[0] = magnitudes[c];
      total += magnitudes[c];
      totalUsual += usual[c];
      across.spread(block, c, miss);
    }
    here.means[row] = total / n;
  }

  /**
   * Decodes the integer of channel c.
   *
   * @param {number} fixed its mean, in 4096ths
   * @param {number} rounded the integer that is nearest to it
   * @param {boolean} odd whether integers stand for 0 and the halves
   */
  integer(c, fixed, rounded, odd) {
    const { coder, opinions, kind, gain } = this;
    const { one, two } = this.sizes;
    const finer = (size) => (odd ? size + Math.min(size, 0.5) : size);
    const logSize = logOf(finer(0.5 * (one[c] + two[c]) * gain));
    const logMean = Math.min(logOf(Math.abs(fixed) / UNIT) >> 2, 3);
    const fraction = fixed - UNIT * rounded;
    const distance = Math.min(Math.abs(fraction) >> 8, 7);
    const near = Math.min(distance >> 1, 3);
    this.setContexts(c, logOf(finer(two[c] * gain)), logSize, logMean, near);

    const scale = Math.min((3 * logSize) >> 3, N_SCALES - 1);
    const set = 8 * (4 * Math.min(logMean, 1) + near) + (scale >> 1);
    const decide = (slot) => opinions.decide(coder, slot, set, N_SETS + c, scale);
    if (!decide(0)) return rounded;
    const opposite = fraction < 0 !== fixed < 0 ? 1 : 0;
    const far = this.small.mixed(
      coder,
      M_SIGN + kind,
      C_SIGN + 8 * Math.min(logSize >> 2, 11) + distance,
      C_SIGN + 96 + 8 * (2 * logMean + opposite) + distance,
      C_SIGN + 160 + 4 * (2 * kind + opposite) + near,
    );
    opinions.contexts[0] += far;
    let bucket = 1;
    while (bucket < N_SLOTS && decide(bucket)) bucket++;
    const error = this.sizeOf(bucket);
    return (far === 1) === (fraction >= 0) ? rounded - error : rounded + error;
  }

  /** The contexts of the decisions on the integer of channel c. */
  setContexts(c, logTwo, logSize, logMean, near) {
    const { kind, gain } = this;
    const { contexts } = this.opinions;
    const { features } = this.sizes;
    const before = features[sizing.BEFORE_1][c];
    const above = features[sizing.PARENT][c];
    const beyond = logOf((above + features[sizing.PARENT_NEXT][c]) * gain);
    const local = logOf(0.5 * (before + features[sizing.BEFORE_2][c] + above) * gain);
    const row = Math.min(logOf(features[sizing.ROW][c] * gain) >> 2, 7);
    contexts[0] = C_MEAN + 2 * (4 * (4 * Math.min(div(logTwo, 3), 11) + logMean) + near);
    contexts[1] = C_LEVEL + 4 * (16 * kind + Math.min(div(logSize, 3), 15)) + logMean;
    contexts[2] = C_ROWS + 64 * row + 8 * this.around + Math.min(div(beyond, 5), 7);
    contexts[3] = N_SHARED + N_OWN * c + 6 * kind + Math.min(div(local, 5), 5);
  }

  /** Which size of its bucket the error has: 1 2 3 4 | 5-6 | 7-8 | 9-12 | ... | 33-48 | more. */
  sizeOf(bucket) {
    const { coder, small, kind } = this;
    if (bucket < 5) return bucket;
    if (bucket < N_SLOTS) {
      const n = (bucket - 3) >> 1;
      const low = ((bucket % 2 === 1 ? 4 : 6) << (n - 1)) + 1;
      const top = small.adaptive(coder, C_EXTRA + bucket);
      return low + (top << (n - 1)) + coder.number(n - 1);
    }
    let length = 1;
    const first = C_ESCAPE + MOST_LENGTH * kind;
    while (length < MOST_LENGTH && small.adaptive(coder, first + length)) length++;
    return BEFORE_ESCAPED + 2 ** (length - 1) + coder.number(length - 1);
  }

  /** Lets all predictions learn from a row; one with large integers counts for less. */
  learn(row) {
    const { n, here, sizes, inTime, across, rest } = this;
    const values = here.valuesOf(row);
    sizes.learn(here.magnitudesOf(row));
    let total = 0;
    for (let c = 0; c < n; c++) total += Math.abs(values[c]);
    const root = 1 / ((1.25 * total) / n + 1);
    const share = root * root;
    for (let c = 0; c < n; c++) rest[c] = values[c] - inTime.means[c];
    across.learn(rest, share);
    inTime.learn(values, sizes.usual, share);
  }
}

const div = (a, b) => Math.floor(a / b);
