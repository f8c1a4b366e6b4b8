import assert from "node:assert/strict";
import { test } from "node:test";
import { readAmc } from "./acclaim.js";
import { readBvh } from "./bvh.js";
import { readC3d } from "./c3d.js";
import { accepted, gathered } from "./files.js";
import { valueOf } from "./lines.js";
import { frameRate } from "./rates.js";

const bytes = (text) => new TextEncoder().encode(text);

const BVH = `HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 1 -2 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -3 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.033333
1 2 3 4 5 6 7 8 9
1e1 2 3 4 5 6 7 8 -.9
`;

test("a BVH", async () => {
  const clip = readBvh(bytes(BVH), "walk.bvh");
  assert.equal(clip.name, "walk");
  assert.equal(clip.rate, 30);
  assert.equal(clip.nFrames, 2);
  const [hips, leg] = clip.skeleton.joints;
  assert.deepEqual([hips.name, leg.name, leg.parent, leg.firstColumn], ["Hips", "Left Leg", 0, 6]);
  assert.deepEqual(leg.tails, [[0, -3, 0]]);
  assert.deepEqual(
    hips.channels.map(({ kind }) => kind),
    [1, 2, 3, 6, 4, 5],
  );
  const { values } = await clip.read(0, 1, 2);
  assert.deepEqual([...values], [10, 2, 3, 4, 5, 6, 7, 8, -0.9]);
});

test("a BVH whose last row is not whole has the rows before it", () => {
  assert.equal(readBvh(bytes(BVH + "1 2 3"), "a.bvh").nFrames, 2);
});

const FAULTS = [
  ["nonsense", /line 1: no HIERARCHY/],
  [BVH.replace("OFFSET 1 -2 0", "OFFSET 1 two 0"), /line 8: expected a number, not "two"/],
  [BVH.replace("CHANNELS 3", "CHANNELS many"), /line 9: CHANNELS "many"/],
  [BVH.replace("8 9\n", "8 <b>\n"), /line 19: expected a number, not "<b>"/],
  [BVH.slice(0, 120), /line \d: /],
  [BVH.replace("Frame Time", "Time"), /Frame Time: must follow/],
  ["HIERARCHY\nMOTION\n", /line 2: no joint/],
];

test("what is wrong with a BVH is told with its line", () => {
  for (const [text, message] of FAULTS) {
    assert.throws(
      () => readBvh(bytes(text), "a.bvh"),
      (error) => error.name === "SourceError" && message.test(error.message),
      text.slice(0, 30),
    );
  }
});

const ASF = `:version 1.10
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    name shin
    direction 0 -1 0
    length 4
    axis 0 0 20 XYZ
    dof rx
  end
  begin
    name thigh
    direction 1 0 0
    length 3
    axis 0 0 0 ZYX
    dof rx rz
  end
:hierarchy
  begin
    root thigh
    thigh shin
  end
`;
const AMC =
  "#!x\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 1 2 3 4 5 6\nthigh 7 8\nshin 9\n2\nroot 0 0 0 0 0 0\nthigh 1 1\nshin 2\n";

test("an AMC with its ASF", async () => {
  const clip = readAmc(bytes(AMC), bytes(ASF), "a.amc");
  assert.deepEqual(
    clip.skeleton.joints.map(({ name, parent }) => [name, parent]),
    [
      ["root", -1],
      ["thigh", 0],
      ["shin", 1],
    ],
  );
  assert.deepEqual(clip.skeleton.joints[2].offset, [3, 0, 0]);
  assert.deepEqual(clip.skeleton.joints[2].tails, [[0, -4, 0]]);
  assert.equal(clip.skeleton.joints[1].axisOrder, 5);
  assert.ok(Math.abs(clip.skeleton.unitCm - 5.6444) < 1e-4);
  assert.equal(clip.rate, null);
  assert.deepEqual([...(await clip.read(0, 0, 1)).values], [1, 2, 3, 4, 5, 6, 7, 8, 9]);
});

test("what is wrong with an AMC or an ASF is told with its line", () => {
  assert.throws(() => readAmc(bytes(AMC), null, "a.amc"), /needs its ASF/);
  assert.throws(
    () => readAmc(bytes(AMC.replace("shin 9", "fin 9")), bytes(ASF), "a"),
    /line 7: bone "fin"/,
  );
  assert.throws(
    () => readAmc(bytes(AMC.replace("shin 9", "shin")), bytes(ASF), "a"),
    /line 7: 0 values of 1/,
  );
  assert.throws(
    () => readAmc(bytes(AMC), bytes(ASF.replace("thigh shin", "thigh toe")), "a"),
    /line 28: "thigh" "toe": no such bone/,
  );
  assert.throws(
    () => readAmc(bytes(AMC), bytes(ASF.replace("angle deg", "angle turns")), "a"),
    /line 4: angle unit/,
  );
  assert.throws(() => readAmc(bytes(AMC), bytes("hello"), "a"), /not an ASF file/);
});

/** A C3D of one block of header, one of parameters and data: 2 points, 3 frames. */
function c3dOf({ floats, processor }) {
  const file = new Uint8Array(3 * 512);
  const view = new DataView(file.buffer);
  const little = processor !== 86;
  const word = (at, value) => view.setInt16(at, value, little);
  const float = (at, value) => {
    if (processor !== 85) return view.setFloat32(at, value, little);
    view.setFloat32(at, value * 4, true); // VAX: the exponent two greater, its halves turned round
    const [low, high] = [view.getUint16(at, true), view.getUint16(at + 2, true)];
    view.setUint16(at, value === 0 ? 0 : high, true);
    return view.setUint16(at + 2, low, true);
  };
  file.set([2, 0x50]);
  word(2, 2);
  word(6, 5);
  word(8, 7);
  float(12, floats ? -1 : 0.5);
  word(16, 3);
  float(20, 100);
  file.set([1, 0x50, 1, processor], 512);
  for (let i = 0; i < 6; i++) {
    for (let k = 0; k < 3; k++) {
      if (floats) float(1024 + 16 * i + 4 * k, 8 * i + k);
      else word(1024 + 8 * i + 2 * k, 2 * (8 * i + k));
    }
    const residual = i === 3 ? -1 : 0;
    if (floats) float(1024 + 16 * i + 12, residual);
    else word(1024 + 8 * i + 6, residual);
  }
  return file;
}

for (const processor of [84, 85, 86]) {
  for (const floats of [false, true]) {
    test(`a C3D of processor ${processor}, ${floats ? "floats" : "integers"}`, async () => {
      const clip = readC3d(c3dOf({ floats, processor }), "a.c3d");
      assert.deepEqual([clip.nFrames, clip.rate, clip.firstFrame], [3, 100, 5]);
      assert.deepEqual(
        clip.skeleton.joints.map(({ name }) => name),
        ["point 1", "point 2"],
      );
      const { values, mask } = await clip.read(0, 1, 2);
      assert.deepEqual([...values], [16, 17, 18, 24, 25, 26]);
      assert.deepEqual([...mask], [1, 1, 1, 0, 0, 0]);
    });
  }
}

test("what is no C3D is refused", () => {
  assert.throws(() => readC3d(new Uint8Array(10), "a.c3d"), /not a C3D file/);
  const bad = c3dOf({ floats: true, processor: 84 });
  bad[515] = 7;
  assert.throws(() => readC3d(bad, "a.c3d"), /processor 7/);
});

test("rates that frame times state with few digits", () => {
  const rates = {
    ".0083333": 120,
    0.033333: 30,
    0.04: 25,
    "4e-2": 25,
    "8.33333e-3": 120,
    0.0333667: 30000 / 1001,
    0.016683: 60000 / 1001,
    0.0417083: 24000 / 1001,
    0.01: 100,
    0.00809716: 1 / 0.00809716,
    0.016: 62,
    "0.016683350016683350": 59.94,
    "0.016683333333333333": 60000 / 1001,
    "0.02857959416976279": 34.99,
  };
  for (const [word, rate] of Object.entries(rates)) {
    const found = frameRate(word);
    assert.ok(Math.abs(found - rate) <= 1e-12 * rate, `${word}: ${found}`);
  }
  const none = ["0", "-0.01", "0x1", "", "nan", "1e-10", "1e10", `0.0${"1".repeat(70)}`];
  assert.deepEqual(none.map(frameRate), none.map(() => null));
});

test("values that are words, as other systems write them, and words that are none", () => {
  const good = ["1.", ".5", "+5", "-1e5", "1e999", "-Infinity", "1.#INF00"].map(valueOf);
  assert.deepEqual(good, [1, 0.5, 5, -1e5, Infinity, -Infinity, Infinity]);
  for (const word of ["nan", "-NaN", "nan(ind)", "-1.#IND", "1.#QNAN"]) assert.ok(Number.isNaN(valueOf(word)));
  for (const word of ["0x1F", "0b1", "1_0", "nan0", "1.#", "", "infx", "null"]) assert.equal(valueOf(word), null);
});

test("a value of a BVH that is no decimal number is refused by its line", () => {
  const bvh = (value) =>
    new TextEncoder().encode(
      `HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n}\nMOTION\nFrames: 1\nFrame Time: 0.016683\n${value}\n`,
    );
  assert.equal(readBvh(bvh("1"), "a.bvh").rate, 60000 / 1001);
  for (const word of ["0x1F", "\u00a01", "1\u2003"]) assert.throws(() => readBvh(bvh(word), "a.bvh"), /line 10/);
});

test("each AMC gets its ASF", () => {
  const file = (name) => ({ name });
  const found = gathered(
    ["02.asf", "02_01.amc", "walk.bvh", "x.txt", "05.asf", "05_3.amc", "99_1.amc"].map(file),
  );
  assert.deepEqual(
    found.map((one) => [one.file.name, one.skeleton?.name ?? null]),
    [
      ["02_01.amc", "02.asf"],
      ["walk.bvh", null],
      ["05_3.amc", "05.asf"],
      ["99_1.amc", null],
    ],
  );
});

test("an AMC gets the ASF of its folder; of several in other folders none", () => {
  const folders = new Map();
  const file = (path) => {
    const [folder, name] = path.split("/");
    const one = { name };
    folders.set(one, folder);
    return one;
  };
  const files = ["a/skel.asf", "a/walk.amc", "b/skel.asf", "b/walk.amc", "c/walk.amc", "d/skel_1.amc"].map(file);
  const found = gathered(files, { folders });
  assert.deepEqual(
    found.map(({ file: one, skeleton, nSkeletons }) => [folders.get(one), folders.get(skeleton) ?? null, nSkeletons]),
    [
      ["a", "a", 1],
      ["b", "b", 1],
      ["c", null, 0],
      ["d", null, 2],
    ],
  );
  const [alone] = gathered([file("a/skel.asf"), file("b/walk.amc")], { folders });
  assert.equal(folders.get(alone.skeleton), "a");
});

test("files that the server reads are taken where there is one", () => {
  const files = ["a.trc", "b.STO", "c.asf", "d.txt", "e.mcz"].map((name) => ({ name }));
  const names = (more) => gathered(files, more).map(({ file }) => file.name);
  assert.deepEqual(names(), ["e.mcz"]);
  assert.deepEqual(names({ suffixes: [".asf", ".trc", ".sto"] }), ["a.trc", "b.STO", "e.mcz"]);
  assert.deepEqual(accepted([".bvh", ".trc"]), [".mcz", ".bvh", ".amc", ".asf", ".c3d", ".trc"]);
});
