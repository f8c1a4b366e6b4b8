// Tests of the parts of the decoder that formulas or other programs can tell: node --test.
// Whole files are what conformance/run.py is for.

import assert from "node:assert/strict";
import { createHash } from "node:crypto";
import { test } from "node:test";
import { constants, deflateRawSync } from "node:zlib";

import { BitReader } from "./bits.js";
import { ByteReader } from "./bytes.js";
import { cosines } from "./cosines.js";
import { crc32 } from "./crc32.js";
import { decimals, rounded, shortest32 } from "./decimals.js";
import { Model, RangeDecoder } from "./entropy.js";
import { Refused } from "./errors.js";
import * as grids from "./grids.js";
import { inflate } from "./inflate.js";
import { Kinematics, hasKinematics } from "./kinematics.js";
import { halvings, join } from "./lifting.js";
import { ordinalOf } from "./ordinals.js";
import { PoseMetric } from "./pose-metric.js";
import { AcrossChannels, folded } from "./pose-prediction.js";
import { logOf } from "./pose-sizes.js";
import { PrefixCode } from "./prefix.js";
import { Sha256, sha256 } from "./sha256.js";
import { checkAsf } from "./source-asf.js";
import { textOfOrdinal, tokenValue } from "./text.js";
import { WAVELETS, bandLengths, neededRanges, synthesis } from "./wavelets.js";

/** Numbers from 0 up to 1, the same in every run. */
function dice(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

const bytesOf = (text) => new TextEncoder().encode(text);
const hexOf = (bytes) => Buffer.from(bytes).toString("hex");

// Conventions

const varint = (...bytes) => new ByteReader(Uint8Array.from(bytes), "test").varint();

test("varints", () => {
  assert.equal(varint(0), 0);
  assert.equal(varint(0x7f), 127);
  assert.equal(varint(0x80, 1), 128);
  assert.equal(varint(255, 255, 255, 255, 255, 255, 255, 15), 2 ** 53 - 1);
});

test("varints that are refused", () => {
  assert.throws(() => varint(0x80, 0), Refused);
  assert.throws(() => varint(0x80), Refused);
  assert.throws(() => varint(255, 255, 255, 255, 255, 255, 255, 16), Refused);
  assert.throws(() => varint(128, 128, 128, 128, 128, 128, 128, 128, 1), Refused);
  assert.throws(() => varint(128, 128, 128, 128, 128, 128, 128, 128, 0), Refused);
});

test("zigzag varints", () => {
  for (const [byte, value] of [[0, 0], [1, -1], [2, 1], [3, -2], [126, 63], [127, -64]]) {
    assert.equal(new ByteReader(Uint8Array.of(byte), "test").zigzag(), value);
  }
});

test("texts", () => {
  const text = (...bytes) => new ByteReader(Uint8Array.of(bytes.length, ...bytes), "test").text();
  assert.equal(text(0xef, 0xbb, 0xbf, 0x41), "\ufeffA");
  assert.throws(() => text(0xed, 0xa0, 0x80), Refused); // a surrogate
  assert.throws(() => text(0xc0, 0x80), Refused); // an overlong form
  assert.throws(() => text(0xf4, 0x90, 0x80, 0x80), Refused); // beyond U+10FFFF
});

test("CRC-32", () => {
  assert.equal(crc32(bytesOf("123456789")), 0xcbf43926);
});

test("SHA-256", () => {
  const random = dice(1);
  for (const size of [0, 1, 55, 56, 63, 64, 65, 119, 120, 1000]) {
    const bytes = Uint8Array.from({ length: size }, () => 256 * random());
    const expected = createHash("sha256").update(bytes).digest("hex");
    assert.equal(hexOf(sha256(bytes)), expected);
    const cut = Math.floor(size / 3);
    const parts = new Sha256().update(bytes.subarray(0, cut)).update(bytes.subarray(cut));
    assert.equal(hexOf(parts.digest()), expected);
  }
});

const { Z_FIXED, Z_HUFFMAN_ONLY, Z_RLE } = constants;
const WAYS = [{ level: 0 }, { level: 1 }, { level: 9 }];
for (const strategy of [Z_FIXED, Z_HUFFMAN_ONLY, Z_RLE]) WAYS.push({ strategy });

test("raw deflate", () => {
  const random = dice(2);
  for (const size of [0, 1, 300, 70000, 200000]) {
    const bytes = Uint8Array.from({ length: size }, (_, i) => 4 * random() ** 3 + (i >> 12));
    for (const way of WAYS) {
      const data = new Uint8Array(deflateRawSync(bytes, way));
      assert.deepEqual(inflate(data, size, "test"), bytes);
      assert.throws(() => inflate(data.subarray(0, -1), size, "test"), Refused);
      assert.throws(() => inflate(data, size + 1, "test"), Refused);
      if (size > 0) assert.throws(() => inflate(data, size - 1, "test"), Refused);
    }
  }
});

test("a byte behind raw deflate", () => {
  const data = new Uint8Array(deflateRawSync(bytesOf("abc")));
  assert.throws(() => inflate(Uint8Array.of(...data, 0), 3, "test"), Refused);
});

// Entropy coding

/** The coder whose bits RangeDecoder decodes. */
class RangeEncoder {
  constructor() {
    this.low = 0;
    this.high = 2 ** 32 - 1;
    this.bytes = [];
  }

  encode(bit, one) {
    const w = this.high - this.low;
    const part = Math.floor(w / 65536) * one + Math.floor(((w % 65536) * one) / 65536);
    if (bit) this.high = this.low + part;
    else this.low += part + 1;
    while (Math.floor(this.low / 2 ** 24) === Math.floor(this.high / 2 ** 24)) {
      this.bytes.push(Math.floor(this.low / 2 ** 24));
      this.low = (this.low * 256) % 2 ** 32;
      this.high = ((this.high * 256) % 2 ** 32) + 255;
    }
  }

  end() {
    for (let t = 0; ; t++) {
      const unit = 2 ** (32 - 8 * t);
      const m = Math.ceil(this.low / unit) * unit;
      if (m > this.high) continue;
      for (let i = 0; i < t; i++) this.bytes.push(Math.floor(m / 2 ** (24 - 8 * i)) % 256);
      return Uint8Array.from(this.bytes);
    }
  }
}

test("range coder", () => {
  for (let seed = 0; seed < 200; seed++) {
    const random = dice(seed);
    const encoder = new RangeEncoder();
    const bits = Array.from({ length: seed * 3 }, () => {
      const one = 1 + Math.floor(65535 * random() ** 4);
      const bit = random() * 65536 < one ? 1 : 0;
      encoder.encode(bit, one);
      return { bit, one };
    });
    const data = encoder.end();
    const decoder = new RangeDecoder(data);
    for (const { bit, one } of bits) assert.equal(decoder.decode(one), bit);
    decoder.finish("test");
    const longer = new RangeDecoder(Uint8Array.of(...data, 0));
    for (const { one } of bits) longer.decode(one);
    assert.throws(() => longer.finish("test"), Refused);
  }
});

test("range coder: numbers, and an end that never comes", () => {
  const encoder = new RangeEncoder();
  for (let i = 52; i >= 0; i--) encoder.encode(i % 3 === 0 ? 1 : 0, 32768);
  const decoder = new RangeDecoder(encoder.end());
  const expected = Array.from({ length: 53 }, (_, i) => ((52 - i) % 3 === 0 ? 1 : 0)).join("");
  assert.equal(decoder.number(53), parseInt(expected, 2));
  assert.equal(decoder.number(0), 0);
  const endless = new RangeDecoder(new Uint8Array(0));
  assert.throws(() => endless.number(100), Refused);
});

/** A mixed bit as SPEC.md has it, with BigInt for all that could be rounded. */
function mixedBySpec({ probabilities, counts, weights }, contexts, mixer, squash, stretch, bitOf) {
  const x = contexts.map((context) => stretch(probabilities[context]));
  const of = [0, 1, 2].map((i) => BigInt(weights[3 * mixer + i]));
  const dot = Number((of[0] * BigInt(x[0]) + of[1] * BigInt(x[1]) + of[2] * BigInt(x[2])) >> 16n);
  const one = squash(Math.max(-2047, Math.min(dot, 2047)));
  const bit = bitOf(one);
  const error = 65536 * bit - one;
  x.forEach((stretched, i) => {
    const moved = weights[3 * mixer + i] + Math.floor((stretched * error + 8192) / 16384);
    weights[3 * mixer + i] = Math.max(-(2 ** 24), Math.min(moved, 2 ** 24));
  });
  for (const context of contexts) {
    const p = probabilities[context];
    const rate = Math.floor(65536 / (counts[context] + 2));
    probabilities[context] = p + Math.floor((((bit ? 65535 : 0) - p) * rate) / 65536);
    if (counts[context] < 250) counts[context]++;
  }
  return bit;
}

test("mixed bits", () => {
  // prettier-ignore
  const NODES = [
    22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743, 32768,
    40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438,
    65476, 65500, 65514,
  ];
  const squash = (x) => {
    const i = Math.floor((x + 2048) / 128);
    const v = (x + 2048) % 128;
    return Math.floor((NODES[i] * (128 - v) + NODES[i + 1] * v + 64) / 128);
  };
  const stretch = (p) => {
    const target = 16 * Math.floor(p / 16) + 8;
    let x = -2047;
    while (x < 2047 && squash(x) < target) x++;
    return x;
  };
  const random = dice(3);
  const start = new Model(
    Uint16Array.from({ length: 9 }, () => 65536 * random()),
    Uint8Array.from({ length: 9 }, () => 251 * random()),
    Float64Array.from([2 ** 24, -(2 ** 24), 65536, 20000, 30000, 40000]),
  );
  const wanted = start.copy();
  const encoder = new RangeEncoder();
  const bits = Array.from({ length: 500 }, (_, i) => {
    const contexts = [i % 9, (i * 5 + 1) % 9, (i * 7 + 2) % 9];
    const bit = mixedBySpec(wanted, contexts, i % 2, squash, stretch, (one) => {
      const drawn = random() < 0.7 ? 1 : 0;
      encoder.encode(drawn, one);
      return drawn;
    });
    return { bit, contexts };
  });
  const decoder = new RangeDecoder(encoder.end());
  const model = start.copy();
  bits.forEach(({ bit, contexts }, i) => {
    assert.equal(model.mixed(decoder, i % 2, ...contexts), bit);
  });
  decoder.finish("test");
  assert.deepEqual(model, wanted);
});

test("bits", () => {
  const bits = new BitReader(Uint8Array.of(0b10110000), "test");
  assert.equal(bits.plain(3), 0b101);
  assert.equal(bits.plain(1), 1);
  bits.finish();
  assert.equal(bits.plain(8), 0);
  assert.throws(() => bits.finish(), Refused);
});

test("prefix codes", () => {
  const code = new PrefixCode([2, 1, 3, 3], "test");
  const bits = new BitReader(Uint8Array.of(0b10011011, 0b10000000), "test");
  assert.deepEqual([1, 2, 3, 4].map(() => code.symbol(bits)), [0, 1, 2, 3]);
  assert.throws(() => new PrefixCode([1, 2], "test"), Refused);
  assert.throws(() => new PrefixCode([2], "test"), Refused);
  assert.equal(new PrefixCode([0, 1], "test").symbol(new BitReader(Uint8Array.of(0), "test")), 1);
  const none = new PrefixCode([], "test");
  assert.throws(() => none.symbol(new BitReader(Uint8Array.of(0), "test")), Refused);
});

// Transforms

test("cosines are orthonormal", () => {
  for (const n of [1, 2, 3, 8, 31]) {
    const rows = cosines(n);
    for (let a = 0; a < n; a++) {
      for (let b = 0; b < n; b++) {
        let dot = 0;
        for (let i = 0; i < n; i++) dot += rows[a * n + i] * rows[b * n + i];
        assert.ok(Math.abs(dot - (a === b ? 1 : 0)) < 1e-14, `${n}: ${a} ${b}`);
      }
    }
  }
});

/** One level of analysis: the low and the high half of a signal. */
function analysis({ lo, hi }, signal) {
  const taps = lo.length;
  const n = signal.length;
  const mirrored = (i) => {
    const at = ((i % (2 * n)) + 2 * n) % (2 * n);
    return signal[at < n ? at : 2 * n - 1 - at];
  };
  const half = (filter) =>
    Float64Array.from({ length: Math.floor((n + taps - 1) / 2) }, (_, k) => {
      let sum = 0;
      for (let t = 0; t < taps; t++) sum += filter(t) * mirrored(2 * k + 1 - t);
      return sum;
    });
  const low = half((k) => (k % 2 === 0 ? hi[k] : -hi[k]));
  const high = half((k) => (k % 2 === 0 ? -lo[k] : lo[k]));
  return { low, high };
}

test("synthesis undoes analysis", () => {
  const random = dice(4);
  WAVELETS.slice(1).forEach((wavelet, index) => {
    for (const n of [1, 2, 5, 16, 37]) {
      const signal = Float64Array.from({ length: n }, () => 100 * random());
      const levels = 3;
      const lengths = bandLengths(n, wavelet.lo.length, levels);
      const details = [];
      let low = signal;
      for (let l = 0; l < levels; l++) {
        const halves = analysis(wavelet, low);
        details.push(halves.high);
        low = halves.low;
      }
      for (let l = levels; l > 0; l--) {
        low = synthesis(wavelet, low, details[l - 1], 0, lengths[l - 1]);
      }
      signal.forEach((x, i) => {
        assert.ok(Math.abs(low[i] - x) < 1e-9, `wavelet ${index + 1}, ${i} of ${n}`);
      });
    }
  });
});

test("synthesis of a part is that of the whole", () => {
  const random = dice(5);
  const wavelet = WAVELETS[4];
  const n = 60;
  const [, length] = bandLengths(n, wavelet.lo.length, 1);
  const low = Float64Array.from({ length }, random);
  const high = Float64Array.from({ length }, random);
  const whole = synthesis(wavelet, low, high, 0, n);
  for (const [start, end] of [[0, 1], [7, 20], [8, 9], [59, 60]]) {
    const { starts, ends } = neededRanges(start, end, wavelet.lo.length, 1);
    const part = (band) => band.subarray(starts[1], ends[1]);
    assert.deepEqual(
      synthesis(wavelet, part(low), part(high), start, end),
      whole.slice(start, end),
    );
  }
});

// Numbers

test("rounded and decimals: ties go to the even digit", () => {
  assert.equal(rounded(2.5, 1).digits, "2");
  assert.equal(rounded(3.5, 1).digits, "4");
  assert.equal(rounded(0.125, 2).digits, "12");
  assert.deepEqual(rounded(1e23, 17), { digits: "99999999999999992", k: 6 });
  assert.equal(decimals(0.5, 0), "0");
  assert.equal(decimals(1.5, 0), "2");
  assert.equal(decimals(2.5, 0), "2");
  assert.equal(decimals(0.375, 2), "0.38");
  assert.equal(decimals(0.625, 2), "0.62");
  assert.equal(decimals(1.005, 2), "1.00");
});

test("shortest decimals of binary32", () => {
  const shortestOf = (word) => Number(shortest32(grids.float32Of(word)));
  assert.equal(shortestOf(0x0f800000), 1.2621775e-29);
  assert.equal(shortestOf(0x39800000), 0.00024414062);
  assert.equal(shortestOf(0x00000001), 1e-45);
  assert.equal(shortestOf(0x7f7fffff), 3.4028235e38);
  const random = dice(6);
  for (let i = 0; i < 2000; i++) {
    const x = grids.float32Of(Math.floor(0x7f800000 * random()));
    const text = shortest32(x);
    assert.equal(Math.fround(Number(text)), x, text);
  }
});

const GRIDS = {
  integer: new grids.Grid(grids.INTEGER, 0, 0, 1),
  scaled: new grids.Grid(grids.SCALED, 0, 0, 0.1),
  fixed6: new grids.Grid(grids.FIXED, 6, 0, 1),
  trimmed22: new grids.Grid(grids.TRIMMED, 22, 0, 1),
  general6: new grids.Grid(grids.GENERAL, 6, 0, 1),
  general15: new grids.Grid(grids.GENERAL, 15, 0, 1),
  text64: new grids.Grid(grids.TEXT64, 0, 0, 1),
  binary32: new grids.Grid(grids.BINARY32, 0, 0, 1),
  binary64: new grids.Grid(grids.BINARY64, 0, 0, 1),
  vax: new grids.Grid(grids.VAX_F, 0, 0, 1),
  printed4: new grids.Grid(grids.PRINTED, 4, 0, 1, 210),
  printed32: new grids.Grid(grids.PRINTED, 32, 0, 1, 145),
  printed64: new grids.Grid(grids.PRINTED, 64, 0, 1, 208),
  printed6digits: new grids.Grid(grids.PRINTED, 134, 0, 1, 197),
};

test("value to ordinal undoes ordinal to value", () => {
  const random = dice(7);
  for (const [name, grid] of Object.entries(GRIDS)) {
    for (let i = 0; i < 500; i++) {
      const part = BigInt(Math.floor(2 ** 53 * random()));
      const m = (grid.greatest * part) >> 53n;
      const minus = i % 2 === 1;
      const ordinal = minus ? (grid.least + grid.greatest === 0n ? -m : -1n - m) : m;
      const x = grids.valueOf(grid, ordinal);
      if (Number.isNaN(x)) continue; // payloads are kept by ordinals alone
      if (grid === GRIDS.vax && (m >> 23n) === 0n) continue; // zeros with a fraction
      assert.equal(ordinalOf(grid, x), ordinal, `${name} ${ordinal}`);
    }
  }
});

test("value to ordinal: ties, ends and what is no number", () => {
  const { integer, scaled, fixed6, general6, general15, text64, binary32, binary64, vax } = GRIDS;
  assert.equal(ordinalOf(integer, 2.5), 2n);
  assert.equal(ordinalOf(integer, -3.5), -4n);
  assert.equal(ordinalOf(integer, -0), 0n);
  assert.equal(ordinalOf(integer, Infinity), integer.greatest);
  assert.equal(ordinalOf(scaled, -Infinity), scaled.least);
  assert.equal(ordinalOf(fixed6, -0), -1n);
  assert.equal(ordinalOf(fixed6, NaN), 0n);
  assert.equal(ordinalOf(fixed6, -1e300), fixed6.least);
  assert.equal(ordinalOf(general6, 0.9999996), ordinalOf(general6, 1));
  assert.equal(ordinalOf(general6, 5e-324), 0n);
  assert.equal(ordinalOf(general6, -5e-324), -1n);
  // The binary64 nearest to 10^23 lies below it.
  assert.equal(grids.valueOf(general15, ordinalOf(general15, 1e23)), 1e23);
  assert.equal(ordinalOf(text64, Infinity), text64.greatest);
  assert.equal(ordinalOf(binary32, NaN), 0x7fc00000n);
  assert.equal(ordinalOf(binary32, -Infinity), -1n - 0x7f800000n);
  assert.equal(ordinalOf(binary64, NaN), 0x7ff8000000000000n);
  assert.equal(ordinalOf(vax, 1), 0x40800000n);
  assert.equal(ordinalOf(vax, -0), 0n);
  assert.equal(ordinalOf(vax, 2 ** -129), 0n);
  assert.equal(ordinalOf(vax, -(2 ** -128.5)), -1n - 2n ** 23n);
  assert.equal(ordinalOf(vax, 1 + 2 ** -24), 0x40800000n); // a tie
  assert.equal(ordinalOf(vax, 1 + 3 * 2 ** -24), 0x40800002n);
  assert.equal(ordinalOf(vax, 1e300), vax.greatest);
});

test("ordinal to text", () => {
  const text = (grid, ordinal) =>
    textOfOrdinal(grid, Number(ordinal & 0xffffffffn), Number(ordinal >> 32n));
  const { fixed6, general6, text64 } = GRIDS;
  assert.equal(text(fixed6, -1n), "-0.000000");
  assert.equal(text(fixed6, 1234567n), "1.234567");
  assert.equal(text(general6, ordinalOf(general6, 1e-5)), "1e-05");
  assert.equal(text(general6, ordinalOf(general6, -123456)), "-123456");
  assert.equal(text(text64, grids.bitsOf(0.1)), "0.1");
});

test("ordinal to text of PRINTED grids", () => {
  const cases = [
    [4, 0, 210, 5n, "5.000000000000000104e-04"],
    [4, 0, 84, 5017n, "0.50170000000000003000"],
    [131, grids.UPPER, 194, -275575n, "-2.73E-01"],
    [32, 0, 144, 0x3dcccccdn, "0.1000000014901161"],
    [64, 0, 64, 0x43abc16d674ec800n, "1000000000000000000"],
    [64, grids.PLUS | grids.EXPONENT3, 192, 0n, "+0e+000"],
    [0, 0, 2, -8n, "-7.00"],
  ];
  for (const [digits, flags, style, ordinal, text] of cases) {
    const grid = new grids.Grid(grids.PRINTED, digits, flags, 1, style);
    const halves = [Number(ordinal & 0xffffffffn), Number(ordinal >> 32n)];
    assert.equal(textOfOrdinal(grid, ...halves), text);
    assert.equal(grids.valueOf(grid, ordinal), Number(text));
  }
});

test("tokens", () => {
  const value = (token) => tokenValue(bytesOf(token));
  assert.equal(value("+1.5e3"), 1500);
  assert.ok(Object.is(value("-0.00"), -0));
  assert.equal(value("1e999"), Infinity);
  assert.equal(value("-1.#INF00"), -Infinity);
  assert.ok(Number.isNaN(value("-nan(0x8_000)")));
  for (const token of ["", ".", "1e", "0x10", " 1", "1_0", "nan()x", "--1"]) {
    assert.throws(() => value(token), Refused, token);
  }
});

// Kinematics

const KINDS = { tx: 1, ty: 2, tz: 3, rx: 4, ry: 5, rz: 6, sx: 7, sy: 8, sz: 9, length: 10, qw: 11 };
Object.assign(KINDS, { qx: 12, qy: 13, qz: 14, vx: 15, vy: 16, vz: 17 });

/** A skeleton of a joint for each list of channels, one below the other. */
function skeletonOf(joints, options = {}) {
  let firstColumn = 0;
  const list = joints.map(({ channels = "", ...joint }, index) => {
    const kinds = channels.split(" ").filter(Boolean);
    const out = {
      parent: index - 1,
      positionsAdd: false,
      offset: [0, 0, 0],
      axis: [0, 0, 0],
      axisOrder: 0,
      tails: [],
      ...joint,
      channels: kinds.map((kind) => ({ kind: KINDS[kind] ?? 0 })),
      firstColumn,
    };
    firstColumn += kinds.length;
    return out;
  });
  const channels = list.flatMap((joint) => joint.channels);
  return { intrinsic: true, angleUnit: 1, joints: list, channels, ...options };
}

function assertPoints(skeleton, values, expected) {
  const { points } = new Kinematics(skeleton).pose(values);
  assert.equal(points.length, expected.length);
  points.forEach((point, i) => {
    point.forEach((x, k) => {
      const near = Number.isNaN(expected[i][k])
        ? Number.isNaN(x)
        : Math.abs(x - expected[i][k]) < 1e-12;
      assert.ok(near, `point ${i}: ${point}, not ${expected[i]}`);
    });
  });
}

test("kinematics: a chain, turned", () => {
  const skeleton = skeletonOf([
    { channels: "tx ty tz rz" },
    { channels: "rz", offset: [2, 0, 0], tails: [[1, 0, 0]] },
  ]);
  assertPoints(skeleton, [5, 6, 7, 90, -90], [[5, 6, 7], [5, 8, 7], [6, 8, 7]]);
});

test("kinematics: positions add or replace", () => {
  const joints = [{}, { channels: "tx", offset: [1, 2, 3] }];
  assertPoints(skeletonOf(joints), [10], [[0, 0, 0], [10, 2, 3]]);
  joints[1].positionsAdd = true;
  assertPoints(skeletonOf(joints), [10], [[0, 0, 0], [11, 2, 3]]);
});

test("kinematics: the order of rotations", () => {
  const joints = [{ channels: "rx rz", tails: [[1, 0, 0]] }];
  assertPoints(skeletonOf(joints), [90, 90], [[0, 0, 0], [0, 0, 1]]);
  // About fixed axes; the point set is acclaim, whose points are tails.
  assertPoints(skeletonOf(joints, { intrinsic: false }), [90, 90], [[0, 1, 0]]);
});

test("kinematics: an axis turns the axes of a joint", () => {
  const joints = [{ channels: "rx", axis: [0, 0, 90], tails: [[1, 0, 0]] }];
  // The joint's x is the world's y.
  assertPoints(skeletonOf(joints, { intrinsic: false }), [90], [[0, 0, -1]]);
});

test("kinematics: quaternions, of which no size counts", () => {
  const joints = [{ channels: "qw qx qy qz", tails: [[1, 0, 0]] }];
  assertPoints(skeletonOf(joints), [3, 0, 0, 3], [[0, 0, 0], [0, 1, 0]]);
  assertPoints(skeletonOf(joints), [0, 0, 0, 0], [[0, 0, 0], [NaN, NaN, NaN]]);
  const parts = [{ channels: "qw qx qy rz", tails: [[1, 0, 0]] }];
  assertPoints(skeletonOf(parts), [NaN, 1, 1, 90], [[0, 0, 0], [0, 1, 0]]);
});

test("kinematics: rotation vectors, axis times angle", () => {
  const joints = [{ channels: "vz vx vy", tails: [[1, 0, 0]] }];
  assertPoints(skeletonOf(joints), [90, 0, 0], [[0, 0, 0], [0, 1, 0]]);
  assertPoints(skeletonOf(joints), [0, 0, 0], [[0, 0, 0], [1, 0, 0]]);
  assertPoints(skeletonOf(joints), [-1e-200, 0, 360], [[0, 0, 0], [1, 0, 0]]);
  const third = 120 / Math.sqrt(3); // x to y, y to z, z to x
  assertPoints(skeletonOf(joints), [third, third, third], [[0, 0, 0], [0, 1, 0]]);
  const radians = skeletonOf(joints, { angleUnit: 2 });
  assertPoints(radians, [1e-9, 0, 0], [[0, 0, 0], [1, 1e-9, 0]]);
  const parts = [{ channels: "vx rz vy", tails: [[1, 0, 0]] }];
  assertPoints(skeletonOf(parts), [NaN, 90, 3], [[0, 0, 0], [0, 1, 0]]);
  assert.ok(!hasKinematics(skeletonOf(joints, { angleUnit: 0 })));
});

test("kinematics: scale and length are not handed on", () => {
  const joints = [
    { channels: "sx", tails: [[1, 0, 0]] },
    { channels: "length", offset: [1, 0, 0], tails: [[0, 2, 0]] },
    { offset: [0, 2, 0], tails: [[1, 0, 0]] },
  ];
  assertPoints(skeletonOf(joints), [3, 0.5], [
    [0, 0, 0],
    [3, 0, 0],
    [3, 0, 0],
    [3, 2.5, 0],
    [3, 2.5, 0],
    [4, 2.5, 0],
  ]);
});

test("kinematics: what is invalid", () => {
  const joints = [{ channels: "rz", tails: [[0, 0, 1]] }, { offset: [0, 0, 0] }];
  const nowhere = [NaN, NaN, NaN];
  assertPoints(skeletonOf(joints), [NaN], [[0, 0, 0], nowhere, nowhere]);
  assert.ok(!hasKinematics(skeletonOf(joints, { angleUnit: 0 })));
  assert.ok(!hasKinematics(skeletonOf([{ channels: "plain" }])));
  assert.ok(hasKinematics(skeletonOf([{}])));
});

// Pose metric

/** R, row after row, of a factor. */
function denseOf({ paths, starts, nKept }, entries) {
  return paths.map((path, c) => {
    const row = new Array(nKept).fill(0);
    const root = 1 / entries[starts[c + 1] - 1];
    path.forEach((d, i) => (row[d] = d === c ? root : root * entries[starts[c] + i]));
    return row;
  });
}

const SWINGING = [
  { channels: "tx ty tz rz rx", offset: [1, 2, 3] },
  { channels: "ry rx", offset: [2, 0, 1], axis: [10, 20, 30], tails: [[1, 0, 0], [0, 2, 1]] },
  { channels: "tx rz plain rx", offset: [0, -3, 0], tails: [[1, 1, 0]] },
];

// Lifting

test("lifting: lengths", () => {
  assert.deepEqual(halvings(37, 3), [37, 19, 10, 5]);
  assert.deepEqual(halvings(3, 8), [3, 2, 1]);
  assert.deepEqual(halvings(1, 8), [1]);
});

test("lifting: what stands still is its approximation", () => {
  for (const n of [2, 3, 7, 8]) {
    const approximation = new Float64Array(2 * Math.ceil(n / 2)).map((_, i) => (i % 2 ? -3 : 5));
    const rows = join(approximation, new Float64Array(2 * Math.floor(n / 2)), 2);
    assert.equal(rows.length, 2 * n);
    rows.forEach((x, i) => assert.ok(Math.abs(x - (i % 2 ? -3 : 5)) < 1e-12));
  }
});

test("lifting: the taps of the 9/7 wavelet", () => {
  // The synthesis filters of bior4.4 have unit norm; those of Lifting have 1 and 2 as their sums.
  const approximation = new Float64Array(16);
  approximation[8] = 1;
  const low = join(approximation, new Float64Array(16), 1).subarray(12, 21);
  const taps = [...WAVELETS[10].lo].filter((tap) => tap !== 0);
  assert.equal(taps.length, 7);
  taps.forEach((tap, k) => assert.ok(Math.abs(low[k + 1] - tap * Math.SQRT2) < 1e-9));
});

// Rows in the metric

test("posewave: logarithms of sizes", () => {
  for (let k = 0; k < 1024; k++) {
    const e = logOf(k / 16);
    const slack = 1 + 1e-12;
    assert.ok(2 ** (e / 6) <= (1 + k / 4) * slack && 1 + k / 4 < 2 ** ((e + 1) / 6) * slack, `${k}`);
  }
  assert.equal(logOf(0), 0);
  assert.equal(logOf(63 / 4), 36);
  assert.equal(logOf(2 ** 33), logOf(4095.999));
});

test("posewave: folded sums", () => {
  assert.equal(folded(Float64Array.from({ length: 96 }, (_, i) => i)), 4560);
  // What is added first decides what is rounded away.
  const values = new Float64Array(64);
  [values[0], values[32], values[16], values[48]] = [1e16, 1, 1, -1e16];
  assert.equal(folded(values), 1e16 + 1 + (1 - 1e16));
});

test("posewave: channels that go together are foretold", () => {
  const across = new AcrossChannels(2);
  const next = dice(5);
  for (let row = 0; row < 400; row++) {
    const x = next() - 0.5;
    across.learn(Float64Array.of(8 * x, -24 * x), 1);
  }
  across.means.fill(0);
  across.spread(0, 0, 1);
  assert.ok(Math.abs(across.means[1] + 3) < 0.1, `${across.means[1]}`);
});

test("pose metric: what points really do", () => {
  for (const intrinsic of [true, false]) {
    const skeleton = skeletonOf(SWINGING, { intrinsic });
    const values = skeleton.channels.map((_, i) => 17 * i - 60);
    const kept = [...values.keys()];
    const reg = kept.map(() => 1e-3);
    const metric = new PoseMetric(skeleton, kept, reg, { radius: 0, kappa: 0 });
    const R = denseOf(metric, metric.factor(values));
    const kinematics = new Kinematics(skeleton);
    const slopes = kept.map((c) => {
      const at = (step) => kinematics.pose(values.map((v, i) => (i === c ? v + step : v))).points.flat();
      const before = at(-1e-3);
      return at(1e-3).map((x, i) => (x - before[i]) / 2e-3);
    });
    const nPoints = slopes[0].length / 3;
    for (const c of kept) {
      for (const d of kept) {
        const found = R.reduce((sum, row) => sum + row[c] * row[d], c === d ? -1e-3 : 0);
        const expected = slopes[c].reduce((sum, x, i) => sum + x * slopes[d][i], 0) / nPoints;
        assert.ok(Math.abs(found - expected) < 1e-8, `${c} ${d}: ${found}, not ${expected}`);
      }
    }
  }
});

test("pose metric: rows come back", () => {
  const skeleton = skeletonOf(SWINGING);
  const roll = dice(9);
  const kept = [0, 1, 3, 4, 6, 7, 8, 9, 10];
  const reg = kept.map(() => 1e-4);
  const metric = new PoseMetric(skeleton, kept, reg, { radius: 0.5, kappa: 0.5 });
  const entries = metric.factor(skeleton.channels.map(() => 300 * roll()));
  const x = kept.map(() => roll() - 0.5);
  const y = denseOf(metric, entries).map((row) => row.reduce((sum, r, i) => sum + r * x[i], 0));
  metric.fromMetric(entries, y).forEach((value, i) => assert.ok(Math.abs(value - x[i]) < 1e-9));
});

test("ASF: the skeleton that a file describes", () => {
  const bytes = (text) => Uint8Array.from(text, (c) => c.charCodeAt(0));
  const text = [
    "# K\xf6rper, in no UTF-8",
    ":units",
    "  angle RAD",
    ":bonedata",
    "  begin",
    "  name foot",
    "  direction 0 -1 0",
    "  length 2.5",
    "  dof L rx twist",
    "  end",
    "  begin",
    "  name leg",
    "  direction (1 0 0)",
    "  length 4",
    "  axis 0 0 20 zyx",
    "  end",
    ":hierarchy",
    "  leg foot",
    "  root leg",
  ].join("\r");
  const zero = [0, 0, 0];
  const channel = (kind, name = "") => ({ kind, name, unit: "", joint: 0 });
  const moving = [1, 2, 3, 4, 5, 6].map((kind) => channel(kind));
  const joint = { positionsAdd: true, offset: zero, axis: zero, axisOrder: 0, channels: [] };
  const joints = [
    { ...joint, name: "root", parent: -1, tails: [], channels: moving },
    { ...joint, name: "leg", parent: 0, axis: [0, 0, 20], axisOrder: 5, tails: [[4, 0, 0]] },
    {
      ...joint,
      name: "foot",
      parent: 1,
      offset: [4, 0, 0],
      tails: [[0, -2.5, 0]],
      channels: [channel(10), channel(4), channel(200, "twist")],
    },
  ];
  const skeleton = { name: "any", intrinsic: false, angleUnit: 2, upAxis: 0, forwardAxis: 0, handedness: 0, joints };
  checkAsf(bytes(text), skeleton);
  for (const [old, now] of [
    ["4", "4e0"],
    ["leg foot", "leg foot foot"],
    ["length 4", "length 4,0"],
    ["RAD", "deg"],
    ["zyx", "zyz"],
    ["0 -1 0", "0 -1 1"],
    [":bonedata", ":bones"],
  ]) {
    const check = () => checkAsf(bytes(text.replace(old, now)), skeleton);
    if (now === "4e0") check();
    else assert.throws(check, Refused, `${old} as ${now}`);
  }
});
