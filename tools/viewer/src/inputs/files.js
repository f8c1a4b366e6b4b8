// Files that were dropped, with those in folders, and which of them belong together.

const MOST_FILES = 20_000;

/** @returns {Promise<File[]>} those of folders as well, each with `path` */
export async function droppedFiles({ items, files }) {
  const entries = [...(items ?? [])].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (entries.length === 0) return [...files];
  const found = [];
  for (const entry of entries) await walk(entry, found);
  return found;
}

async function walk(entry, found) {
  if (found.length >= MOST_FILES) return;
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    file.path = entry.fullPath;
    found.push(file);
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    // Browsers give some entries at a time, and none when there are no more.
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return;
    for (const one of some) await walk(one, found);
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
