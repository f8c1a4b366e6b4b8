// SPEC.md, "Codec 1: fast".

import { annexJson } from "../annex.js";
import { bits, clamp } from "../entropy.js";
import { Refused } from "../errors.js";
import { binary32Ordinal } from "../grids.js";
import {
  COUNTS,
  MULTIPLES,
  PLAIN,
  PRODUCTS,
  classesOf,
  ordinalOfCount,
  productOf,
  withRests,
} from "../heads.js";
import { halvesOf, setHalves, setInteger } from "../int64.js";
import { ordinalOf } from "../ordinals.js";
import { SignalDecoder } from "../ordinal-streams.js";

export const id = 1;
export const name = "fast";
export const version = 0;

const SLOT_BITS = 12;
const N_SLOTS = 2 ** SLOT_BITS;
const TWO_16 = 2 ** 16;
const TWO_40 = 2 ** 40;
const TWO_44 = 2 ** 44;
const POWERS_OF_2 = Float64Array.from({ length: 64 }, (_, n) => 2 ** n);

const CODEC = {
  name,
  rules: { maxTaps: 4, hasDepth: true, hasProducts: true, hasCounts: true },
  decoder: (ordinals) => new GroupDecoder(ordinals),
};

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header the codec's header in CLIP
 * @param {{channels: object[], groups: number[][], grids: object[], nResolutions: number}} layout
 * @returns {{decodes: "ordinals", alone: true, decode: (segments: object[]) => BigInt64Array}}
 * @throws {Refused}
 */
export function open(header, layout) {
  if (header.length !== 0) throw new Refused("fast: the header is not empty");
  if (layout.nResolutions !== 1) throw new Refused(`fast: ${layout.nResolutions} resolutions`);
  return {
    decodes: "ordinals",
    alone: true, // lead, tail and freshness mean nothing
    decode: (segments) => new SignalDecoder(CODEC, layout, segments).decode(),
  };
}

let known = null;

/** The distributions of the annex: of each context its symbol by slot, its starts and counts. */
function contexts() {
  known ??= annexJson("fast_counts.json").counts.map((counts) => {
    const symbols = new Uint8Array(N_SLOTS);
    const starts = new Uint16Array(counts.length);
    let slot = 0;
    counts.forEach((count, symbol) => {
      starts[symbol] = slot;
      symbols.fill(symbol, slot, slot + count);
      slot += count;
    });
    return { counts: Uint16Array.from(counts), starts, symbols };
  });
  return known;
}

/** The coder's state, its words, and the bits that lie at the other end of a stream. */
class Source {
  constructor(data, what) {
    this.data = data;
    this.what = what;
    this.contexts = contexts();
    this.word = 4; // offset of the next word
    this.bit = 0; // bits that were taken
    this.x = this.byte(0) + 256 * this.byte(1) + TWO_16 * (this.byte(2) + 256 * this.byte(3));
    if (this.x < TWO_16) this.refuse(`a state of ${this.x}`);
  }

  refuse(message) {
    throw new Refused(`${this.what}: ${message}`);
  }

  /** A byte; 0 behind the end, as `check` says sooner or later. */
  byte(i) {
    return this.data[i] ?? 0;
  }

  /** Refuses a stream of which more was taken than it has. */
  check() {
    if (this.word + Math.ceil(this.bit / 8) > this.data.length) this.refuse("it is too short");
  }

  finish() {
    const taken = this.word + Math.ceil(this.bit / 8);
    if (taken !== this.data.length) {
      this.refuse(`${this.data.length} bytes, of which ${taken} belong`);
    }
    if (this.x !== TWO_16) this.refuse(`the state is ${this.x} at the end`);
    if (this.take(-this.bit & 7) !== 0) this.refuse("bits that no number has are not 0");
  }

  symbol(context) {
    const { counts, starts, symbols } = this.contexts[context];
    const slot = this.x & (N_SLOTS - 1); // the state is a u32
    const symbol = symbols[slot];
    this.x = counts[symbol] * (this.x >>> SLOT_BITS) + slot - starts[symbol];
    if (this.x < TWO_16) {
      this.x = this.x * TWO_16 + this.byte(this.word) + 256 * this.byte(this.word + 1);
      this.word += 2;
    }
    return symbol;
  }

  /** A number of n bits; beyond 2^53 it is about that, and then of no use but to be refused. */
  take(n) {
    if (n <= 24) return this.takeFew(n);
    let value = 0;
    for (let got = 0; got < n; ) {
      const from = this.bit & 7;
      const part = Math.min(8 - from, n - got);
      const byte = this.byte(this.data.length - 1 - (this.bit >> 3));
      value += ((byte >> from) & ((1 << part) - 1)) * POWERS_OF_2[got];
      this.bit += part;
      got += part;
    }
    return value;
  }

  /** A number of at most 24 bits. */
  takeFew(n) {
    const at = this.data.length - 1 - (this.bit >> 3);
    const from = this.bit & 7;
    let word = this.byte(at);
    if (from + n > 8) word |= (this.byte(at - 1) << 8) | (this.byte(at - 2) << 16);
    if (from + n > 24) word |= this.byte(at - 3) << 24;
    this.bit += n;
    return (word >>> from) & ((1 << n) - 1);
  }

  takeBig(n) {
    const low = BigInt(this.take(Math.min(n, 32)));
    return n <= 32 ? low : low | (BigInt(this.take(n - 32)) << 32n);
  }
}

/** A coded channel: its head, what follows from it, and what it remembers. */
class Channel {
  constructor(head, what) {
    Object.assign(this, head, classesOf(head));
    this.plain = [PLAIN, MULTIPLES, PRODUCTS, COUNTS].includes(head.form);
    this.lowest = this.width - head.depth; // class, by digits in fixed point
    this.limit = this.plain ? TWO_44 : this.powers[this.width] - 1;
    this.ranks = (head.depth + 1) * this.perClass;
    if (!this.plain && this.ranks > 2 ** 60) throw new Refused(`${what}: ${this.ranks} numbers`);
    this.narrow = this.plain || this.ranks <= 2 ** 51; // doubles hold all that is made of ranks
    this.f = 16 * head.scale;
    this.last = 0;
    this.differences = new Float64Array(4);
  }

  predict() {
    const { taps, differences, limit } = this;
    let sum = 16;
    for (let i = 0; i < taps.length; i++) sum += taps[i] * differences[i];
    return clamp((this.fromLast ? this.last : 0) + Math.floor(sum / 32), -limit, limit);
  }

  remember(v, p) {
    const { differences } = this;
    differences.copyWithin(1, 0, 3);
    differences[0] = clamp(v - this.last, -TWO_40, TWO_40);
    this.last = v;
    this.f += Math.floor((16 * Math.abs(v - p) - this.f) / 4);
  }

  /** The class of a prediction of size s, by digits. */
  classOf(s) {
    let c = Math.max(1, this.lowest);
    while (this.powers[c] <= s) c++;
    return c;
  }

  /** The rank that is expected for a prediction, and how large a step is there. */
  expected(p) {
    if (this.plain) return { e: p, q: 0 };
    const s = Math.abs(p);
    const c = this.classOf(s);
    const j = c - this.nDigits;
    const q = this.decimal ? (425 * j + 16) >> 5 : 4 * j;
    let e = this.narrow ? 0 : 0n;
    if (s >= this.powers[c - 1]) {
      const power = this.powers[Math.abs(j)];
      if (this.narrow) {
        const m = Math.floor((s + Math.floor(power / 2)) / power);
        const own = j >= 0 ? Math.min(m, this.greatest) : s * power;
        e = 1 + (c - this.lowest) * this.perClass + own - this.least;
      } else {
        const big = BigInt(power);
        const m = (BigInt(s) + big / 2n) / big;
        const most = BigInt(this.greatest);
        const own = j >= 0 ? (m < most ? m : most) : BigInt(s) * big;
        e = 1n + BigInt(c - this.lowest) * BigInt(this.perClass) + own - BigInt(this.least);
      }
    }
    if (p < 0) e = this.narrow ? -1 - e : -1n - e;
    return { e, q };
  }
}

/** Decodes the coded channels of a group, one after the other. */
class GroupDecoder {
  /** @param {BigInt64Array} ordinals where they go */
  constructor(ordinals) {
    this.ordinals = ordinals;
    this.halves = halvesOf(ordinals);
  }

  /** Ordinal of row r and a channel goes to firstIndex + r * nChannels + its column. */
  decodeGroup(heads, data, nRows, nChannels, firstIndex, what) {
    const channels = withRests(heads).map((head) => new Channel(head, what));
    this.source = new Source(data, what);
    for (const channel of channels) {
      const first = firstIndex + channel.column;
      channel.last = this.number(channel, this.first(channel), first);
      for (let row = 1; row < nRows; row++) this.next(channel, first + row * nChannels);
    }
    this.source.finish();
  }

  /** The rank of a first row. */
  first({ narrow }) {
    const n = this.source.take(6);
    if (n > 61) this.source.refuse(`a first number of ${n} bits`);
    if (n === 0) return narrow ? 0 : 0n;
    return this.signed(narrow, 1, n - 1);
  }

  /** high * 2^n + n bits, with a sign; the bit of the sign comes first. */
  signed(narrow, high, n) {
    const minus = this.source.take(1) === 1;
    if (narrow) {
      const size = high * POWERS_OF_2[n] + this.source.take(n);
      return minus ? 0 - size : size;
    }
    const size = (BigInt(high) << BigInt(n)) + this.source.takeBig(n);
    return minus ? -size : size;
  }

  next(channel, index) {
    const p = channel.predict();
    const { e, q } = channel.expected(p);
    const v = this.number(channel, e + this.miss(channel, q), index);
    channel.remember(v, p);
  }

  miss({ f, narrow }, q) {
    const { source } = this;
    const o = bits(f + 1) - 1;
    const t = Math.max(0, 4 * o + ((Math.floor((4 * f + 4) / POWERS_OF_2[o]) & 3)) - q);
    const k = clamp((t >> 2) - 7, 0, 44);
    const s = source.symbol(t < 28 ? t : 28 + (t % 4));
    if (s < 16) {
      if (k === 0 && s === 0) return narrow ? 0 : 0n;
      return this.signed(narrow, s, k);
    }
    if (s < 48) return this.signed(narrow, 4 + (s % 4), k + 2 + ((s - 16) >> 2));
    const h = source.take(6);
    if (h === 0 || h + k > 61) source.refuse(`a miss of ${h} + ${k} bits`);
    return this.signed(narrow, 1, h + k - 1);
  }

  /** Sets an ordinal to that of a rank, and returns its value in fixed point. */
  number(channel, rank, index) {
    this.source.check();
    if (channel.plain) return this.plainNumber(channel, rank, index);
    const minus = rank < 0;
    const { depth, perClass, least, lowest, nDigits, powers } = channel;
    const u = channel.narrow ? (minus ? -1 - rank : rank) : minus ? -1n - rank : rank;
    if (u == 0) {
      setHalves(this.halves, index, -minus, -minus);
      return 0;
    }
    let k;
    let m;
    if (channel.narrow) {
      k = Math.floor((u - 1) / perClass);
      m = u - 1 - k * perClass + least;
    } else {
      k = Number((u - 1n) / BigInt(perClass));
      m = Number((u - 1n) % BigInt(perClass)) + least;
    }
    if (k > depth) this.source.refuse(`class ${k} of ${depth}`);
    const j = lowest + k - nDigits;
    const power = powers[Math.min(Math.abs(j), 63)];
    let v;
    if (j >= 0) v = m * power;
    else if (power > 2 * m) v = 0;
    else if (channel.narrow) v = Math.floor((m + Math.floor(power / 2)) / power);
    else v = Number((BigInt(m) + BigInt(power) / 2n) / BigInt(power));
    this.setOrdinal(channel, minus, u, index);
    return minus ? 0 - v : v;
  }

  setOrdinal({ top, depth, perClass, decimal, drop, small }, minus, u, index) {
    const before = decimal ? 0 : -1; // F - 1
    if (small) {
      const magnitude = ((top - depth) * perClass + before + Number(u)) * 2 ** drop;
      setInteger(this.halves, index, minus ? -1 - magnitude : magnitude);
    } else {
      const m = BigInt(top - depth) * BigInt(perClass) + BigInt(before) + BigInt(u);
      this.ordinals[index] = minus ? -1n - (m << BigInt(drop)) : m << BigInt(drop);
    }
  }

  plainNumber(channel, v, index) {
    const { form, unit, drop } = channel;
    if (!(v >= -TWO_44 && v < TWO_44)) this.source.refuse(`the value ${v} is beyond 2^44`);
    if (channel.restsOf !== undefined) {
      setInteger(this.halves, index, Number(this.ordinals[index]) + v);
    } else if (form === COUNTS) {
      setInteger(this.halves, index, ordinalOfCount(channel, v));
    } else if (form === MULTIPLES) {
      setInteger(this.halves, index, binary32Ordinal(v * unit));
    } else if (form === PRODUCTS) {
      this.ordinals[index] = ordinalOf(channel.grid, productOf(channel, v));
    } else {
      // v * 2^drop, and the low bits apart: drop is at most 19.
      const low = (v % 2 ** (32 - drop)) * 2 ** drop + this.source.take(drop);
      setHalves(this.halves, index, low, Math.floor(v / 2 ** (32 - drop)));
    }
    return v;
  }
}
