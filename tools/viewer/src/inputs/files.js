// Files that were dropped, with those in folders, and which of them belong together.

const MOST_FILES = 20_000;
const MOST_DEPTH = 64; // folders within each other

/**
 * @returns {Promise<{files: File[], nLeft: number}>} those of folders as well, folder by folder and
 *   in the order of their names; how many files and folders are left out
 */
export async function droppedFiles({ items, files }) {
  // What was dropped is there during the event alone, so all of it is taken before anything is awaited.
  const dropped = [...(items ?? [])].filter(({ kind }) => kind === "file").map(taken);
  if (dropped.length === 0) return { files: [...(files ?? [])], nLeft: 0 };
  const found = { files: [], nLeft: 0 };
  for (const one of await Promise.all(dropped)) await walk(one, found, 0);
  return found;
}

/** A file, or a folder: a handle where browsers have them, for entries are not read in pages of a disk. */
function taken(item) {
  const entry = item.webkitGetAsEntry?.() ?? null;
  if (entry === null || entry.isFile) return item.getAsFile();
  return item.getAsFileSystemHandle?.().catch(() => entry) ?? entry;
}

async function walk(one, found, depth) {
  if (one === null) return;
  if (found.files.length >= MOST_FILES || depth > MOST_DEPTH) found.nLeft++;
  else if (isFolder(one)) {
    for (const each of await membersOf(one, found)) await walk(each, found, depth + 1);
  } else await take(one, found);
}

const isFolder = ({ isDirectory = false, kind = "" }) => isDirectory || kind === "directory";

/** A file, of a folder by its handle or entry. */
async function take(one, found) {
  try {
    if (one.getFile) found.files.push(await one.getFile());
    else if (one.isFile) found.files.push(await new Promise((resolve, reject) => one.file(resolve, reject)));
    else found.files.push(one);
  } catch {
    found.nLeft++;
  }
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
 * the only one.
 *
 * @param {File[]} files
 * @returns {{file: File, skeleton: File | null}[]}
 */
export function gathered(files) {
  const skeletons = files.filter(({ name }) => extension(name) === "asf");
  return files.flatMap((file) => {
    const kind = extension(file.name);
    if (["mcz", "bvh", "c3d"].includes(kind)) return [{ file, skeleton: null }];
    return kind === "amc" ? [{ file, skeleton: skeletonOf(file, skeletons) }] : [];
  });
}

function skeletonOf(file, skeletons) {
  const own = stem(file.name);
  const subject = own.replace(/[_-][^_-]*$/, "");
  const named = (name) => skeletons.find((skeleton) => stem(skeleton.name) === name);
  return named(own) ?? named(subject) ?? (skeletons.length === 1 ? skeletons[0] : null);
}
