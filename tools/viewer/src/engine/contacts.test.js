// What `mcz.contacts` says of the same feet: the numbers are those of Python.

import assert from "node:assert/strict";
import { test } from "node:test";
import { contactsIn, contactsOf, isFoot, runsOf } from "./contacts.js";

/** Numbers that are the same every time, in any language: Lehmer's generator. */
function numbers(seed) {
  let state = seed;
  return () => (state = (state * 16807) % 2147483647) / 2147483647;
}

/** A foot that steps, with noise, and frames in which it is not known. */
function foot(seed, nFrames, rate) {
  const next = numbers(seed);
  const step = 0.7 + 0.6 * next();
  const stand = 0.4 + 0.3 * next();
  const track = new Float64Array(3 * nFrames);
  let x = 0;
  for (let f = 0; f < nFrames; f++) {
    const swing = Math.max(0, (((f / rate / step) % 1) - stand) / (1 - stand));
    if (swing > 0) x += 120 / rate;
    const y = 3 + 18 * 4 * swing * (1 - swing) + 1.2 * next();
    track.set([x + 0.15 * next(), y, 0.3 * next()], 3 * f);
    if (next() < 0.012) track.fill(NaN, 3 * f, 3 * f + 3);
  }
  return track;
}

// prettier-ignore
const CASES = [
  [1, 400, 120, [[4, 35], [98, 119], [170, 204], [254, 287], [338, 371]]],
  [2, 400, 60, [[1, 13], [43, 61], [85, 94], [97, 104], [127, 146], [169, 188], [211, 230], [253, 264],
    [295, 314], [337, 356], [379, 398]]],
  [3, 300, 30, [[0, 10], [22, 31], [43, 52], [64, 73], [85, 94], [106, 115], [127, 136], [148, 157],
    [169, 172], [190, 199], [211, 220], [232, 241], [253, 262], [274, 283], [295, 300]]],
  [4, 600, 100, [[1, 38], [75, 108], [142, 178], [212, 248], [282, 295], [296, 318], [352, 388], [422, 458],
    [492, 528], [562, 600]]],
  [5, 5, 120, []],
  [6, 500, 250, [[0, 108], [179, 224], [230, 284], [375, 403], [404, 459]]],
];

for (const [seed, nFrames, rate, runs] of CASES) {
  test(`contacts of a foot with gaps, ${nFrames} frames at ${rate}/s`, () => {
    assert.deepEqual(runsOf(foot(seed, nFrames, rate), rate, 1), runs);
  });
}

test("a foot that is nowhere does not stand", () => {
  assert.deepEqual(runsOf(new Float64Array(300).fill(NaN), 120, 1), []);
  assert.deepEqual(runsOf(new Float64Array(0), 120, 1), []);
});

test("names of feet", () => {
  const feet = ["lfoot", "LeftToeBase", "Bip01 R Toe0", "foot_L", "Kim:LHEE", "mixamorig:RightFoot"];
  for (const name of feet) assert.ok(isFoot(name), name);
  for (const name of ["lfemur", "LANK", "football", "alfoot", "Foot"]) assert.ok(!isFoot(name), name);
});

/** A clip of a foot, and of a head that is above it along z. */
function clipOf(track, facts) {
  const nFrames = track.length / 3;
  const points = ["head", "lfoot"].map((name, joint) => ({ name, joint, side: "middle" }));
  const all = { nFrames, rate: 120, unitCm: 1, upAxis: null, points, joints: points, ...facts };
  return {
    facts: all,
    positions: async (from, to) =>
      Float32Array.from({ length: 6 * (to - from) }, (_, i) => {
        const [f, k] = [from + Math.floor(i / 6), i % 6];
        return track[3 * f + (k % 3)] + (k === 2 ? 160 : 0);
      }),
  };
}

/** y and z change places. */
const lying = (track) => track.map((_, i) => track[i % 3 === 0 ? i : i % 3 === 1 ? i + 1 : i - 1]);

test("contacts of a clip: up is guessed; units; a window of a long one; what cannot be said", async () => {
  const [seed, nFrames, rate, runs] = CASES[0];
  const track = lying(foot(seed, nFrames, rate));
  const all = { from: 100, to: 200 };
  const found = await contactsOf(clipOf(track), all);
  assert.deepEqual(found, {
    from: 0,
    to: nFrames,
    why: "",
    feet: [{ point: 1, name: "lfoot", side: "middle", runs }],
  });
  const halves = await contactsOf(clipOf(track.map((x) => x / 2), { unitCm: 2 }), { ...all, up: 2 });
  assert.deepEqual(halves.feet[0].runs, runs);
  assert.deepEqual((await contactsOf(clipOf(track), { ...all, up: 0 })).feet[0].runs.length > 0, true);

  const long = clipOf(track, { nFrames: 2 ** 20 });
  const part = await contactsOf(long, { ...all, up: 2 });
  assert.deepEqual([part.from, part.to], [100, 200]);
  const own = runsOf(foot(seed, nFrames, rate).subarray(300, 600), 120, 1);
  assert.deepEqual(part.feet[0].runs, own.map(([a, b]) => [a + 100, b + 100]));
  assert.match((await contactsOf(long, { from: 0, to: 2 ** 20 })).why, /too many/);

  const none = await contactsOf(clipOf(track, { unitCm: null }), all);
  assert.deepEqual([none.feet, /unit/.test(none.why)], [[], true]);
  const points = [{ name: "head", joint: 0 }];
  assert.match((await contactsOf(clipOf(track, { points, joints: points }), all)).why, /no joint/);
});

test("parts between gaps are looked at by themselves, on one floor", () => {
  const track = foot(1, 400, 120);
  assert.deepEqual(contactsIn(track, 120, 1, [[0, 400]]), runsOf(track, 120, 1));
  const found = contactsIn(track, 120, 1, [[0, 180], [180, 400]]);
  assert.ok(found.every(([a, b]) => b <= 180 || a >= 180));
  assert.deepEqual(found.map(([a]) => a).includes(180), true);
});
