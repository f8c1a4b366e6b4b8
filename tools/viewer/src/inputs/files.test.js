import assert from "node:assert/strict";
import { test } from "node:test";
import { droppedFiles } from "./files.js";

const file = (name) => ({ isFile: true, isDirectory: false, name, file: (resolve) => resolve({ name }) });

/** A folder as browsers give it: some entries at a time, and none when there are no more. */
function folder(name, entries, { perTime = 2, breaksAt = Infinity } = {}) {
  let at = 0;
  const readEntries = (resolve, reject) => {
    if (at >= breaksAt) return reject(new Error("gone"));
    resolve(entries.slice(at, (at += perTime)));
  };
  return { isFile: false, isDirectory: true, name, createReader: () => ({ readEntries }) };
}

/** The same by handles. */
const handle = (name, members) => ({
  kind: members ? "directory" : "file",
  name,
  ...(members ? { values: async function* () { yield* members; } } : { getFile: async () => ({ name }) }),
});

function dropped(...entries) {
  const items = entries.map((entry) => ({
    kind: "file",
    webkitGetAsEntry: () => entry,
    getAsFile: () => ({ name: entry.name }),
  }));
  return droppedFiles({ items, files: [] });
}

const names = ({ files }) => files.map(({ name }) => name);

test("files of folders, in the order of their names", async () => {
  const deep = folder("b", [file("2.bvh"), file("1.bvh")]);
  const found = await dropped(file("z.mcz"), folder("takes", [file("c.mcz"), deep, file("a.amc")]));
  assert.deepEqual(names(found), ["z.mcz", "a.amc", "1.bvh", "2.bvh", "c.mcz"]);
  assert.equal(found.nLeft, 0);
});

test("handles are taken where there are some, entries where they are refused", async () => {
  const entry = folder("takes", [file("e.mcz")]);
  const top = handle("takes", [handle("b.mcz"), handle("a", [handle("x.mcz")])]);
  const item = (given) => ({
    kind: "file",
    webkitGetAsEntry: () => entry,
    getAsFileSystemHandle: given,
  });
  const items = [item(async () => top), item(() => Promise.reject(new Error("not allowed")))];
  assert.deepEqual(names(await droppedFiles({ items })), ["x.mcz", "b.mcz", "e.mcz"]);
});

test("what cannot be read is left out, and counted", async () => {
  const broken = { ...file("x.bvh"), file: (_, reject) => reject(new Error("gone")) };
  const half = folder("half", [file("1.mcz"), file("2.mcz")], { perTime: 1, breaksAt: 1 });
  const found = await dropped(folder("a", [broken, half]));
  assert.deepEqual(names(found), ["1.mcz"]);
  assert.equal(found.nLeft, 2);
});

test("folders without an end, and more files than are taken", async () => {
  const endless = folder("x", []);
  endless.createReader = () => {
    let isOver = false;
    return { readEntries: (resolve) => (resolve(isOver ? [] : [endless]), (isOver = true)) };
  };
  assert.equal((await dropped(endless)).nLeft, 1);
  const many = Array.from({ length: 20_003 }, (_, k) => file(`${k}.mcz`));
  const { files, nLeft } = await dropped(folder("m", many, { perTime: 100 }));
  assert.deepEqual([files.length, nLeft], [20_000, 3]);
});

test("files that are no entries; text is no file", async () => {
  const plain = { name: "a.mcz" };
  const items = [
    { kind: "file", webkitGetAsEntry: () => null, getAsFile: () => plain },
    { kind: "string", getAsFile: () => null },
  ];
  assert.deepEqual((await droppedFiles({ items, files: [] })).files, [plain]);
  assert.deepEqual((await droppedFiles({ files: [plain] })).files, [plain]);
});

test("the folder of each file is kept, and of two dropped ones of one name both", async () => {
  const found = await dropped(file("z.amc"), folder("s", [folder("in", [file("a.amc")])]), folder("s", [file("b.amc")]));
  assert.deepEqual(
    found.files.map((one) => found.folders.get(one)),
    ["", "1:s/in", "2:s"],
  );
});
