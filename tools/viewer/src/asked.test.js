import assert from "node:assert/strict";
import { test } from "node:test";
import { compareClip, showClip } from "./asked.js";
import { openAll } from "./inputs.js";
import { showClip as showOfList } from "./panels/actions.js";
import { initial } from "./state.js";
import { Store } from "./store.js";

/** A page whose engine answers when it is told to. */
function stub() {
  const asked = new Map(); // by "file/index"
  const engine = {
    clip: (fileId, index) =>
      new Promise((resolve, reject) => {
        const key = `${fileId}/${index}`;
        asked.set(key, { done: () => resolve({ key, fileId, index, name: key }), fail: (text) => reject(new Error(text)) });
      }),
    open: (_, { name }) =>
      new Promise((resolve) => asked.set(name, { done: (id) => resolve({ id, name, nClips: 1, damage: [] }) })),
  };
  return { page: { store: new Store(initial()), engine }, asked };
}

const rest = () => new Promise((resolve) => setTimeout(resolve));

test("of two clips the one asked for last is shown, whichever comes first and whoever asked", async () => {
  for (const order of [["1/0", "1/1"], ["1/1", "1/0"]]) {
    const { page, asked } = stub();
    const both = [showClip(page, 1, 0, { isNew: true }), showOfList(page, 1, 1)];
    for (const key of order) {
      asked.get(key).done();
      await rest();
    }
    assert.deepEqual((await Promise.all(both)).map((clip) => clip?.key ?? null), [null, "1/1"]);
    assert.equal(page.store.get("shown").key, "1/1");
  }
});

test("what is wrong with a clip that is not wanted any more is not told", async () => {
  const { page, asked } = stub();
  const first = showClip(page, 1, 0);
  const second = showOfList(page, 1, 1);
  asked.get("1/0").fail("late");
  assert.equal(await first, null);
  asked.get("1/1").fail("bad");
  await second;
  assert.deepEqual(page.store.get("message"), { text: "bad", isFault: true });
  await assert.rejects(() => {
    const third = showClip(page, 1, 2);
    asked.get("1/2").fail("worse");
    return third;
  }, /worse/);
});

test("a file that is dropped first and opened last does not push the later one aside", async () => {
  const { page, asked } = stub();
  const slow = openAll(page, [{ name: "slow.mcz" }]);
  const fast = openAll(page, [{ name: "fast.mcz" }]);
  asked.get("fast.mcz").done(2);
  await rest();
  asked.get("2/0").done();
  await fast;
  asked.get("slow.mcz").done(1);
  await slow;
  assert.equal(page.store.get("shown").key, "2/0");
  assert.equal(page.store.get("files").length, 2);
  assert.equal(asked.has("1/0"), false);
});

test("of two clips the one compared last counts, and none where none is wanted any more", async () => {
  const { page, asked } = stub();
  const both = [compareClip(page, 1, 0), compareClip(page, 1, 1)];
  asked.get("1/1").done();
  asked.get("1/0").done();
  await Promise.all(both);
  assert.equal(page.store.get("compared").key, "1/1");
  const late = compareClip(page, 1, 2);
  await compareClip(page, null);
  asked.get("1/2").done();
  await late;
  assert.equal(page.store.get("compared"), null);
});

test("files of suffixes that the server says are sent to it", async (t) => {
  const { page } = stub();
  const sent = [];
  globalThis.document = { baseURI: "http://localhost/" };
  t.mock.method(globalThis, "fetch", async (url, { method, body }) => {
    sent.push([url, method, ...body.getAll("file").map(({ name }) => name)]);
    return { ok: true, json: async () => ({ url: "file/1", name: "made.mcz" }) };
  });
  t.after(() => delete globalThis.document);
  page.engine.open = async (where, { name }) => ({ id: 1, name, nClips: 0, damage: [], where });
  const files = ["a.trc", "b.xyz"].map((name) => new File(["x"], name));
  await openAll(page, files);
  assert.match(page.store.get("message").text, /No motion file there.*\.amc with its \.asf, \.c3d$/);
  page.store.set({ server: { canConvert: true, suffixes: [".trc"] } });
  await openAll(page, files);
  assert.deepEqual(sent, [["http://localhost/convert", "POST", "a.trc"]]);
  assert.equal(page.store.get("files")[0].where.url, "http://localhost/file/1");
});

