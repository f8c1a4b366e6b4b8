// SPEC.md, "Codec 128: lossless".

import { RangeDecoder, bits, clamp } from "../entropy.js";
import { Refused } from "../errors.js";
import { binary32Ordinal } from "../grids.js";
import {
  COUNTS,
  MULTIPLES,
  PLAIN,
  POWERS_OF_10,
  PRODUCTS,
  classesOf,
  ordinalOfCount,
  productOf,
  withRests,
} from "../heads.js";
import { halvesOf, setHalves, setInteger } from "../int64.js";
import { ordinalOf } from "../ordinals.js";
import { SignalDecoder } from "../ordinal-streams.js";
import { Residuals, side } from "../residuals.js";
import { restart, startModels } from "../start-models.js";

export const id = 128;
export const name = "lossless";
export const version = 1;

// The first context and the mixer of each kind of bit.
const SAME = 0;
const UP = 384;
const ZERO = 432;
const FAR = 464;
const MINUS = 768;
const ZERO_SIGN = 800;
const RESIDUALS = 808;
const SAME_MIXER = 0;
const UP_MIXER = 1;
const ZERO_MIXER = 2;
const FAR_MIXER = 3;
const ZERO_SIGN_MIXER = 4;
const MINUS_MIXER = 5;
const RESIDUALS_MIXER = 6;

const TWO_40 = 2 ** 40;
const TWO_44 = 2 ** 44;
const TWO_52 = 2 ** 52;

/** The codec in each of its versions. */
const VERSIONS = [false, true].map((hasForms) => ({
  name,
  rules: { hasProducts: hasForms, hasCounts: hasForms },
  decoder: (ordinals) => new BitDecoder(ordinals),
}));

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header the codec's header in CLIP
 * @param {{channels: object[], groups: number[][], grids: object[], nResolutions: number}} layout
 * @param {number} codecVersion 0 or 1
 * @returns {{decodes: "ordinals", alone: true, decode: (segments: object[]) => BigInt64Array}}
 * @throws {Refused}
 */
export function open(header, layout, codecVersion) {
  if (header.length !== 0) throw new Refused("lossless: the header is not empty");
  if (layout.nResolutions !== 1) {
    throw new Refused(`lossless: ${layout.nResolutions} resolutions, not 1`);
  }
  return {
    decodes: "ordinals",
    alone: true, // lead, tail and freshness mean nothing
    decode: (segments) => new SignalDecoder(VERSIONS[codecVersion], layout, segments).decode(),
  };
}

// Bits

/** A coded channel: its head, what it remembers, and the numbers of its form. */
export class CodedChannel {
  constructor(head) {
    this.column = head.column;
    this.isPlain = [PLAIN, MULTIPLES, PRODUCTS, COUNTS].includes(head.form);
    this.form = head.form;
    this.drop = head.drop;
    this.unit = head.unit;
    this.shifts = head.shifts;
    this.law = head.law;
    this.restsOf = head.restsOf ?? null; // of rests: the law that they are added to
    this.grid = head.grid;
    this.fromLast = head.fromLast;
    this.taps = head.taps;
    this.last = 0;
    this.differences = new Float64Array(head.taps.length);
    this.fast = 16 * head.scale;
    this.slow = 16 * head.scale;
    this.side1 = 0;
    this.side2 = 0;

    Object.assign(this, classesOf(head));
    this.top = head.top;
    this.limit = this.powers[this.width] - 1;
  }

  predict() {
    const { taps, differences } = this;
    let sum = 16;
    for (let i = 0; i < taps.length; i++) sum += taps[i] * differences[i];
    return (this.fromLast ? this.last : 0) + Math.floor(sum / 32);
  }
}

/** beside(value, scale) of the specification. */
function beside(value, scale) {
  return clamp(bits(value) - bits(scale) + 3, 0, 7);
}

/** Decodes the coded channels of a group in a segment, one group after the other. */
export class BitDecoder {
  /**
   * @param {BigInt64Array} ordinals where they go
   * @param {string} annex the file of the start table
   * @param {[number, number]} first the first context and mixer of residuals
   */
  constructor(ordinals, annex = "lossless_start.json", first = [RESIDUALS, RESIDUALS_MIXER]) {
    this.ordinals = ordinals;
    this.halves = halvesOf(ordinals);
    [this.startModel] = startModels(annex);
    this.model = this.startModel.copy();
    this.residuals = new Residuals(this.model, ...first);
    this.coder = null;
    this.near = 0;
    this.other = 3;
  }

  /** Decodes the coded channels of a group; the arguments behind `data` are those of `decode`. */
  decodeGroup(heads, data, nRows, nChannels, firstIndex, what) {
    restart(this.model, this.startModel);
    this.coder = new RangeDecoder(data);
    const channels = withRests(heads).map((head) => new CodedChannel(head));
    this.decode(channels, nRows, nChannels, firstIndex);
    this.coder.finish(what);
  }

  /** Ordinal of row r and a channel goes to firstIndex + r * nChannels + its column. */
  decode(channels, nRows, nChannels, firstIndex) {
    for (let row = 0; row < nRows; row++) {
      this.near = 0;
      this.other = 3;
      const first = firstIndex + row * nChannels;
      for (let i = 0; i < channels.length; i++) {
        const channel = channels[i];
        if (channel.isPlain) this.plain(channel, first + channel.column);
        else this.classes(channel, first + channel.column);
        this.other = channel.side1;
      }
    }
  }

  residual(channel, minus, f, g) {
    const { side1, side2 } = channel;
    return this.residuals.decode(this.coder, minus, f, g, this.near, side1, side2, this.other);
  }

  remember(channel, value, predicted) {
    const { differences, slow } = channel;
    for (let i = differences.length - 1; i > 0; i--) differences[i] = differences[i - 1];
    if (differences.length > 0) differences[0] = clamp(value - channel.last, -TWO_40, TWO_40);
    channel.last = value;
    const error = value - predicted;
    const size = 16 * Math.min(Math.abs(error), TWO_44);
    this.near = (this.near + bits(size) - bits(slow)) >> 1;
    channel.fast += Math.floor((size - channel.fast) / 2);
    channel.slow = slow + Math.floor((size - slow) / 32);
    channel.side2 = channel.side1;
    channel.side1 = side(error);
  }

  /** Forms 0 and 32 to 34, and rests. */
  plain(channel, index) {
    this.plainOf(channel, index, clamp(channel.predict(), -TWO_44, TWO_44));
  }

  /** Such a number against what is predicted. */
  plainOf(channel, index, predicted) {
    const value = predicted + this.residual(channel, false, channel.fast, channel.slow);
    if (!(value >= -TWO_44 && value < TWO_44)) {
      throw new Refused(`lossless: the value ${value} is beyond 2^44`);
    }
    this.remember(channel, value, predicted);
    const { drop } = channel;
    if (channel.restsOf !== null) {
      setInteger(this.halves, index, channel.restsOf.counted + value);
    } else if (channel.form === COUNTS) {
      channel.law.counted = ordinalOfCount(channel, value);
      setInteger(this.halves, index, channel.law.counted);
    } else if (channel.form === MULTIPLES) {
      setInteger(this.halves, index, binary32Ordinal(value * channel.unit));
    } else if (channel.form === PRODUCTS) {
      this.ordinals[index] = ordinalOf(channel.grid, productOf(channel, value));
    } else if (drop <= 8) {
      setInteger(this.halves, index, value * 2 ** drop + this.coder.number(drop));
    } else {
      // value * 2^drop, and the low bits apart: drop is at most 19.
      const low = (value % 2 ** (32 - drop)) * 2 ** drop + this.coder.number(drop);
      setHalves(this.halves, index, low, Math.floor(value / 2 ** (32 - drop)));
    }
  }

  /** The other forms. */
  classes(channel, index) {
    const { coder, model } = this;
    const { fast, slow, powers, least, greatest } = channel;
    const predicted = clamp(channel.predict(), -channel.limit, channel.limit);
    const s = Math.abs(predicted);
    const guess = guessed(channel, s);
    const c = this.classOf(channel, s, guess);
    if (c === ZERO_CLASS) {
      const z = ZERO_SIGN;
      const negative = model.mixed(coder, ZERO_SIGN_MIXER, z, z + 1, z + 2);
      this.remember(channel, 0, predicted);
      setHalves(this.halves, index, -negative, -negative);
      return;
    }
    const k = c - channel.width + channel.top;
    if (!(k >= 0 && k <= channel.top)) {
      throw new Refused(`lossless: class ${k} of 0 to ${channel.top}`);
    }

    // the sign
    const besideFast = beside(s, fast);
    const besideSlow = beside(s, slow);
    const either = c === guess ? besideFast : 8 + besideSlow;
    const m8 = MINUS + 8 + besideSlow;
    const differs = model.mixed(coder, MINUS_MIXER, MINUS + besideFast, m8, MINUS + 16 + either);
    const minus = predicted < 0 !== (differs === 1);

    // the mantissa
    const j = Math.max(c - channel.nDigits, -63);
    const power = powers[Math.abs(j)];
    const expected = predicted < 0 === minus ? expectedMantissa(channel, s, j, power) : least;
    let f;
    let g;
    if (j >= 0) {
      f = Math.floor(fast / power);
      g = Math.floor(slow / power);
    } else {
      const b = Math.min(power, TWO_52);
      const h = Math.floor(TWO_52 / b);
      f = Math.min(fast, h) * b;
      g = Math.min(slow, h) * b;
    }
    const m = expected + this.residual(channel, minus, f, g);
    if (!(m >= least && m <= greatest)) {
      throw new Refused(`lossless: mantissa ${m} of ${least} to ${greatest}`);
    }
    this.take(channel, index, minus, k, m, predicted);
  }

  /** Remembers a number of class k and mantissa m, and sets its ordinal. */
  take(channel, index, minus, k, m, predicted) {
    const j = Math.max(k + channel.width - channel.top - channel.nDigits, -63);
    const power = channel.powers[Math.abs(j)];
    let v;
    if (j >= 0) v = m * power;
    else if (power > 2 * m) v = 0;
    else v = Math.floor((m + Math.floor(power / 2)) / power);
    this.remember(channel, minus && v > 0 ? -v : v, predicted);
    this.setClass(channel, index, minus, k, m);
  }

  /** The class, counted so that the class top is W; ZERO_CLASS for a zero. */
  classOf(channel, s, guess) {
    const { coder, model } = this;
    const { fast, slow, powers } = channel;
    const under = s - (guess > 0 ? powers[guess - 1] : 0);
    const over = powers[guess] - s;
    const u = under < over ? 0 : 1;
    const e = Math.min(under, over);
    const rf = beside(e, fast);
    const rs = beside(e, slow);
    const here = clamp(bits(s) - bits(slow) + 3, 0, 11);
    const a = SAME + 16 * rf + 2 * rs + u;
    const c = SAME + 224 + 8 * Math.min(guess, 15) + rf;
    if (model.mixed(coder, SAME_MIXER, a, SAME + 128 + 8 * here + rs, c)) return guess;
    const greater = model.mixed(coder, UP_MIXER, UP + u, UP + 2 + rf, UP + 10 + rs);
    if (!greater && model.mixed(coder, ZERO_MIXER, ZERO + u, ZERO + 2 + rf, ZERO + 10 + rs)) {
      return ZERO_CLASS;
    }
    let t = 0;
    for (;;) {
      const b = FAR + 32 + 8 * t + rf;
      if (!model.mixed(coder, FAR_MIXER, FAR + 2 * t + greater, b, FAR + 160 + 8 * t + rs)) break;
      t++;
      if (t > 12) throw new Refused("lossless: a class more than 4096 from the expected one");
    }
    const steps = t === 0 ? 0 : 2 ** (t - 1) + coder.number(t - 1);
    return greater ? guess + 1 + steps : guess - 1 - steps;
  }

  /** Sets the ordinal of a sign, a class k and a mantissa m. */
  setClass(channel, index, minus, k, m) {
    const inClass = (channel.decimal ? 1 : 0) + m - channel.least;
    if (channel.small) {
      const magnitude = (k * channel.perClass + inClass) * 2 ** channel.drop;
      setInteger(this.halves, index, minus ? -1 - magnitude : magnitude);
    } else {
      const scaled = BigInt(k) * BigInt(channel.perClass) + BigInt(inClass);
      const magnitude = scaled << BigInt(channel.drop);
      this.ordinals[index] = minus ? -1n - magnitude : magnitude;
    }
  }
}

const ZERO_CLASS = -Infinity;

/** The least g >= 0 with B^g > s. */
export function guessed(channel, s) {
  if (!channel.decimal) return bits(s);
  let g = 0;
  while (POWERS_OF_10[g] <= s) g++;
  return g;
}

/** The mantissa m' that is expected where the sign is. */
function expectedMantissa(channel, s, j, power) {
  const { least, greatest } = channel;
  if (j >= 0) return clamp(Math.floor((s + Math.floor(power / 2)) / power), least, greatest);
  if (s === 0) return least;
  if (power > Math.floor(greatest / s)) return greatest;
  return clamp(s * power, least, greatest);
}
