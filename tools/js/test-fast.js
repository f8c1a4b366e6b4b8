// Tests of codec 1, fast: streams written by hand, where the rules of SPEC.md can be counted out.

import assert from "node:assert/strict";
import { test } from "node:test";

import { open } from "./codecs/fast.js";
import { Refused } from "./errors.js";
import { BINARY64, FIXED, GENERAL, Grid } from "./grids.js";

const NO_HEADER = new Uint8Array(0);

/** The ordinals of one segment, whose groups have one channel each unless they are given. */
function decode(streams, nRows, { grid = new Grid(FIXED, 2, 0, 1), groups, nFrames = nRows } = {}) {
  const columns = groups ?? streams.map((_, column) => [column]);
  const channels = columns.flat();
  const grids = channels.map(() => grid);
  const layout = { channels, groups: columns, grids, nResolutions: 1 };
  const own = streams.map((bytes) => Uint8Array.from(bytes));
  return [...open(NO_HEADER, layout).decode([{ nFrames, nRows, streams: [own] }])];
}

const refuses = (...args) => assert.throws(() => decode(...args), Refused);

test("a header is refused", () => {
  assert.throws(() => open(Uint8Array.of(0), { nResolutions: 1 }), Refused);
});

test("constants, steps and copies", () => {
  assert.deepEqual(decode([[0x01]], 2), [0n, 0n]);
  assert.deepEqual(decode([[0x05, 3]], 2), [-2n, -2n]);
  const least = [0x21, 255, 255, 255, 255, 255, 255, 255, 255];
  assert.deepEqual(decode([least], 1), [-(2n ** 63n)]);
  assert.deepEqual(decode([[0x03, 2, 1, 0, 2, 1, 4]], 3), [0n, 2n, 2n]);
  assert.deepEqual(decode([[0x02, 1, 0], [0x05, 4]], 2), [2n, 2n, 2n, 2n]);
});

test("heads that are refused", () => {
  refuses([[0x05, 0]], 1); // a byte too many of an ordinal
  refuses([[0x25, 1, 1, 1, 1, 1, 1, 1, 1, 1]], 1); // nine bytes
  refuses([[0x41]], 1); // a reserved bit of a constant
  refuses([[0x06, 0, 0]], 1); // of a copy
  refuses([[0x07, 1, 1, 0]], 1); // of steps
  refuses([[0x10, 0, 0, 0]], 1); // tiny, in no class
  refuses([[0x03, 1, 1, 0]], 2); // runs of one row of two
  refuses([[0x03, 2, 2, 0, 1, 0]], 2); // of three
  refuses([[0x03, 2, 0, 0, 2, 0]], 2); // of none
  refuses([[0x02, 1, 0]], 1); // a copy of what there is not
  refuses([[0x02, 0, 0]], 1); // of itself
  refuses([[0x01, 0]], 1); // a byte behind the heads
  refuses([[0x80, 16, 0, 0, 0, 0]], 1); // a form that there is not
  refuses([[0x80, 0, 33, 0, 0, 0]], 1); // a drop of 33
  refuses([[0x00, 0, 121, 0]], 1); // a scale
  refuses([[0x40, 0, 0, 1, 1, 0, 0]], 1); // an exception behind the last row
});

// Codes of scale 0, from the lowest bit: 1 is 0, 01 is -1, 001 is 1.

test("predictions", () => {
  assert.deepEqual(decode([[0x00, 6, 0, 0]], 1), [3n]);
  // Errors of 0, 1 and -1, against the last lead, and against it and its last difference.
  assert.deepEqual(decode([[0x00, 6, 0, 1, 0b00101001]], 4), [3n, 3n, 4n, 3n]);
  assert.deepEqual(decode([[0x04, 6, 0, 1, 0b00101001]], 4), [3n, 3n, 4n, 4n]);
});

test("a parent may come behind its child", () => {
  const child = [0x24, 0, 0, 1, 0, ...[0x80, 4], 1, 0b1]; // weight 256
  const parent = [0x04, 0, 0, 1, 0b100];
  assert.deepEqual(decode([child, parent], 2), [0n, 0n, 1n, 1n]);
  refuses([[0x20, 0, 0, 0, 0, 0, 1, 0b1]], 2); // itself
  refuses([child, [0x01]], 2); // a constant
});

test("parents in more than two other groups", () => {
  const group = (...parents) => {
    const heads = parents.flatMap((g) => (g < 0 ? [0x00, 0, 0] : [0x20, 0, 0, g, 0, 0]));
    return [...heads, 0];
  };
  const groups = [[0, 1, 2], [3], [4], [5]];
  assert.equal(decode([group(1, 2, 2), group(-1), group(-1), group(-1)], 1, { groups }).length, 6);
  refuses([group(1, 2, 3), group(-1), group(-1), group(-1)], 1, { groups });
});

test("exceptions take the place of what is decoded", () => {
  const stream = [0x44, 6, 0, 2, 1, 1, 4, 0, 0, 1, 0b00000111];
  assert.deepEqual(decode([stream], 4), [3n, 2n, 0n, 3n]);
});

test("parts that are too long, too short or not filled with 0", () => {
  assert.deepEqual(decode([[0x04, 6, 0, 1, 0b11]], 3), [3n, 3n, 3n]);
  refuses([[0x04, 6, 0, 2, 0b11, 0]], 3);
  refuses([[0x04, 6, 0, 1, 0b111]], 3);
  refuses([[0x04, 6, 0, 1, 0b1]], 3);
  refuses([[0x04, 6, 0, 0]], 3);
  refuses([[0x04, 6, 0, 1, 0b11, 0]], 3); // tails
  refuses([[0x04, 6, 0]], 3);
});

test("codes that are refused", () => {
  const zeros = (n) => [0x00, 0, 0, Math.floor(n / 8) + 1, ...new Array(Math.floor(n / 8)).fill(0)];
  refuses([[...zeros(39), 1 << 7]], 2); // 32 bits behind it
  const code = [...zeros(38), 0b01000000]; // 31 bits behind it, here all 0 but the last of them
  code[3] += 4;
  assert.equal(decode([[...code, 0, 0, 0, 0]], 2)[1], 2n ** 30n + 3n);
  refuses([[...code, 255, 255, 255, 63]], 2); // 2^32 and more
});

test("classes of decimal digits", () => {
  const grid = new Grid(GENERAL, 2, 0, 1);
  // Class 2 of the lead 7 is top - 1; its tail, 5, has three bits.
  const lead = [0x00, 3, 14, 0, 0];
  assert.deepEqual(decode([[...lead, 5]], 1, { grid }), [2n * 90n + 1n + 75n - 10n]);
  refuses([[0x00, 3, 0xc8, 1, 0, 0]], 1, { grid }); // a lead of 100
  refuses([[0x00, 0, 14, 0, 0, 5]], 1, { grid }); // class -1
  assert.deepEqual(decode([[0x00, 3, 1, 0, 0]], 1, { grid }), [-1n]);
  // Tiny, one class below all leads, mantissa 12: 3 bits, then 6.
  const tiny = [0x10, 3, 0, 0, 0];
  assert.deepEqual(decode([[...tiny, 1 | (12 << 3), 0]], 1, { grid }), [90n + 1n + 2n]);
  refuses([[...tiny, 1 | (9 << 3), 0]], 1, { grid }); // a mantissa of one digit
  refuses([[...tiny, 3 | (12 << 3), 0]], 1, { grid }); // class -1
});

test("classes of binary digits", () => {
  const grid = new Grid(BINARY64, 0, 0, 1);
  // 1.5: class 1023, of which the lead has the first two digits; 51 further ones are 0.
  const head = [0x00, ...[0x9b, 8], 6, 0, 0]; // top: 1023 + 28
  const bits = new DataView(new ArrayBuffer(8));
  bits.setFloat64(0, 1.5);
  assert.deepEqual(decode([[...head, ...new Array(7).fill(0)]], 1, { grid }), [bits.getBigInt64(0)]);
});

test("segments that are too large", () => {
  refuses([[0x01]], 4097);
  assert.equal(decode([[0x01]], 4097, { nFrames: 1 }).length, 4097);
  refuses([[0x01]], 2 ** 23 + 1, { nFrames: 1 });
});
