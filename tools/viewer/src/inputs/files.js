// Files that were dropped, with those in folders, and which of them belong together.

const MOST_FILES = 20_000;
const MOST_DEPTH = 64; // folders within each other
const READ_HERE = ["mcz", "bvh", "c3d"]; // and amc, with its asf

/** The formats that are known, for people; with those that the server reads, where there is one. */
export const accepted = (suffixes = []) => [...new Set([".mcz", ".bvh", ".amc", ".asf", ".c3d", ...suffixes])];

/**
 * @returns {Promise<{files: File[], folders: Map<File, string>, nLeft: number}>} those of folders as
 *   well, folder by folder and in the order of their names; the folder of each that came in one; how
 *   many files and folders are left out
 */
export async function droppedFiles({ items, files }) {
  // What was dropped is there during the event alone, so all of it is taken before anything is awaited.
  const dropped = [...(items ?? [])].filter(({ kind }) => kind === "file").map(taken);
  if (dropped.length === 0) return { files: [...(files ?? [])], folders: new Map(), nLeft: 0 };
  const found = { files: [], folders: new Map(), nLeft: 0 };
  for (const [i, one] of (await Promise.all(dropped)).entries()) await walk(one, found, [], i);
  return found;
}

/** A file, or a folder: a handle where browsers have them, for entries are not read in pages of a disk. */
function taken(item) {
  const entry = item.webkitGetAsEntry?.() ?? null;
  if (entry === null || entry.isFile) return item.getAsFile();
  return item.getAsFileSystemHandle?.().catch(() => entry) ?? entry;
}

/** @param {string[]} path names of the folders around; of two that were dropped both may have one */
async function walk(one, found, path, nth) {
  if (one === null) return;
  if (found.files.length >= MOST_FILES || path.length > MOST_DEPTH) found.nLeft++;
  else if (isFolder(one)) {
    const within = [...path, path.length === 0 ? `${nth}:${one.name}` : one.name];
    for (const each of await membersOf(one, found)) await walk(each, found, within, nth);
  } else await take(one, found, path.join("/"));
}

const isFolder = ({ isDirectory = false, kind = "" }) => isDirectory || kind === "directory";

/** A file, of a folder by its handle or entry. */
async function take(one, found, folder) {
  try {
    const file = await fileOf(one);
    found.files.push(file);
    found.folders.set(file, folder);
  } catch {
    found.nLeft++;
  }
}

function fileOf(one) {
  if (one.getFile) return one.getFile();
  return one.isFile ? new Promise((resolve, reject) => one.file(resolve, reject)) : one;
}

/** What is in a folder, by name; of one that cannot be read what came before. */
async function membersOf(folder, found) {
  const members = [];
  try {
    for await (const one of folder.values?.() ?? entriesOf(folder)) members.push(one);
  } catch {
    found.nLeft++;
  }
  return members.sort((a, b) => (a.name < b.name ? -1 : 1));
}

/** Browsers give some entries at a time, and none when there are no more. */
async function* entriesOf(folder) {
  const reader = folder.createReader();
  for (;;) {
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return;
    yield* some;
  }
}

const extension = (name) => name.slice(name.lastIndexOf(".") + 1).toLowerCase();
const stem = (name) => name.slice(0, name.lastIndexOf("."));

/**
 * The motion files among files, each AMC with its ASF: that of the same name, of the subject, or
 * the only one; of the same folder, or else, where one alone will do, of another.
 *
 * @param {File[]} files
 * @param {{folders?: Map<File, string>, suffixes?: string[]}} more `folders`: of `droppedFiles`;
 *   `suffixes`: of files that the server reads, as ".trc"
 * @returns {{file: File, skeleton: File | null, nSkeletons: number}[]} `nSkeletons`: how many may be
 *   that of an AMC; it has none where they are several
 */
export function gathered(files, { folders = new Map(), suffixes = [] } = {}) {
  const skeletons = files.filter(({ name }) => extension(name) === "asf");
  const others = suffixes.map((suffix) => extension(suffix)).filter((kind) => kind !== "asf");
  const kinds = new Set([...READ_HERE, ...others]);
  return files.flatMap((file) => {
    const kind = extension(file.name);
    if (kind === "amc") return [{ file, ...skeletonOf(file, skeletons, folders) }];
    return kinds.has(kind) ? [{ file, skeleton: null, nSkeletons: 0 }] : [];
  });
}

function skeletonOf(file, skeletons, folders) {
  const near = skeletons.filter((one) => folders.get(one) === folders.get(file));
  const own = fitting(file, near);
  const found = own.length > 0 ? own : fitting(file, skeletons);
  return { skeleton: found.length === 1 ? found[0] : null, nSkeletons: found.length };
}

/** The skeletons that fit best by their names; the only one fits. */
function fitting(file, skeletons) {
  const own = stem(file.name);
  for (const name of [own, own.replace(/[_-][^_-]*$/, "")]) {
    const named = skeletons.filter((skeleton) => stem(skeleton.name) === name);
    if (named.length > 0) return named;
  }
  return skeletons.length === 1 ? skeletons : [];
}
