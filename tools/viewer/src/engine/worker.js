// The worker: files, clips and numbers, asked for by messages { id, method, args }, answered by
// { id, result }, { id, error } and, on the way, { id, progress }.

import {
  AccessError,
  LimitExceeded,
  Refused,
  Unsupported,
  annexFrom,
  setAnnex,
} from "../../../js/mcz.js";
import { contactsOf } from "./contacts.js";
import { curvesOf } from "./curves.js";
import { errorsBetween } from "./distances.js";
import { Clips } from "./clips.js";
import { neighborsOf } from "./neighbors.js";
import { openFile } from "./open.js";

/** Names of errors, which the build shortens. */
const NAMES = new Map([
  [AccessError, "AccessError"],
  [LimitExceeded, "LimitExceeded"],
  [Refused, "Refused"],
  [Unsupported, "Unsupported"],
]);

const files = new Map();
const clips = new Clips(files);
let nFiles = 0;

const METHODS = {
  /** Tables by name, or the address of the folder where they are. */
  setAnnex(tables) {
    if (typeof tables === "string") {
      setAnnex(annexFrom(tables));
      return;
    }
    setAnnex((name) => {
      if (!tables.has(name)) throw new Error(`no ${name}`);
      return tables.get(name);
    });
  },

  async open(where, options) {
    const { name } = options;
    const file = await openFile(where, options);
    const id = ++nFiles;
    files.set(id, file);
    return { id, name, size: file.size, nClips: file.nClips, damage: file.damage };
  },

  rows: (id, from, to) => fileOf(id).rows(from, to),

  async clip(id, index) {
    fileOf(id);
    return (await clips.open(id, index)).facts;
  },

  positions: async (key, from, to) => (await clips.get(key)).positions(from, to),

  curves: async (key, wanted) => curvesOf(await clips.get(key), wanted),

  contacts: async (key, wanted) => contactsOf(await clips.get(key), wanted),

  neighbors: async (key) => neighborsOf(await clips.get(key)),

  errors: async (a, b, progress) => errorsBetween(await clips.get(a), await clips.get(b), progress),

  source: async (key) => (await clips.get(key)).sourceBytes(),

  close(id) {
    files.delete(id);
    clips.close(id);
  },
};

function fileOf(id) {
  const file = files.get(id);
  if (file === undefined) throw new Error("this file is closed");
  return file;
}

/** The buffers of typed arrays that nobody here needs any more. */
function buffersOf(result) {
  const values = ArrayBuffer.isView(result) ? [result] : Object.values(result ?? {});
  const views = values.filter(
    (value) => value instanceof Float32Array || value instanceof Int32Array,
  );
  return views.map(({ buffer }) => buffer);
}

self.addEventListener("message", async ({ data: { id, method, args } }) => {
  const progress = (done) => self.postMessage({ id, progress: done });
  try {
    const result = await METHODS[method](...args, progress);
    self.postMessage({ id, result }, buffersOf(result));
  } catch (error) {
    const name = NAMES.get(error.constructor) ?? error.name;
    self.postMessage({ id, error: { name, message: error.message } });
  }
});
