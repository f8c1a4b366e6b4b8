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
import { OpenClip } from "./clip.js";
import { openFile } from "./open.js";

/** Names of errors, which the build shortens. */
const NAMES = new Map([
  [AccessError, "AccessError"],
  [LimitExceeded, "LimitExceeded"],
  [Refused, "Refused"],
  [Unsupported, "Unsupported"],
]);

const files = new Map();
const clips = new Map();
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

  rows: (id, from, to) => found(files, id, "file").rows(from, to),

  async clip(id, index) {
    const reader = await found(files, id, "file").clip(index);
    const clip = new OpenClip(reader, { fileId: id, index });
    clips.set(clip.key, clip);
    await clip.prepare();
    return clip.facts;
  },

  positions: (key, from, to) => found(clips, key, "clip").positions(from, to),

  curves: (key, wanted) => curvesOf(found(clips, key, "clip"), wanted),

  contacts: (key, wanted) => contactsOf(found(clips, key, "clip"), wanted),

  errors: (a, b, progress) =>
    errorsBetween(found(clips, a, "clip"), found(clips, b, "clip"), progress),

  source: (key) => found(clips, key, "clip").sourceBytes(),

  close(id) {
    files.delete(id);
    for (const [key, clip] of clips) if (clip.facts.fileId === id) clips.delete(key);
  },
};

function found(map, key, what) {
  const item = map.get(key);
  if (item === undefined) throw new Error(`this ${what} is closed`);
  return item;
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
