// One file's part of the list: its clips in folders, or, of very many, in their order.

import { Folders } from "./folders.js";
import { Rows } from "./rows.js";

const MOST_IN_FOLDERS = 50_000; // of more, names are not all fetched to find folders
const MOST_OPEN = 300; // of more, folders begin closed
const STEP = 1000;

/** `length` and `item(i)` of a file, as its rows come in. */
export class Section {
  #folders = new Folders();
  #flat = [];
  #turned = new Set(); // folders that are not as they begin
  #isGone = false;

  constructor(engine, file, { level, onChange }) {
    this.file = file;
    this.level = level;
    this.onChange = onChange;
    this.rows = new Rows(engine, file, onChange);
    this.hasFolders = file.nClips <= MOST_IN_FOLDERS;
    if (this.hasFolders) this.#load();
  }

  close() {
    this.#isGone = true;
  }

  get length() {
    return this.hasFolders ? this.#flat.length : this.file.nClips;
  }

  item(index) {
    if (this.hasFolders) return this.#flat[index];
    const row = this.rows.get(index);
    return { level: this.level, row: row ?? { index }, label: row?.name ?? "" };
  }

  isOpen(path) {
    return this.file.nClips <= MOST_OPEN !== this.#turned.has(path);
  }

  toggle(path, isOpen) {
    if (this.isOpen(path) === isOpen) return;
    if (this.#turned.has(path)) this.#turned.delete(path);
    else this.#turned.add(path);
    this.#lay();
  }

  /** Opens the folders of a name. */
  uncover(name) {
    if (!this.hasFolders) return;
    const parts = name.split("/").filter((part) => part !== "");
    for (let n = 1; n < parts.length; n++) this.toggle(parts.slice(0, n).join("/"), true);
  }

  /** Where a clip is, or -1. */
  place(clipIndex) {
    if (!this.hasFolders) return clipIndex;
    return this.#flat.findIndex(({ row }) => row?.index === clipIndex);
  }

  async #load() {
    const { nClips } = this.file;
    for (let from = 0; from < nClips && !this.#isGone; from += STEP) {
      const rows = await this.rows.between(from, from + STEP).catch(() => []);
      for (const row of rows) this.#folders.add(row);
      this.#lay();
      this.onChange();
    }
  }

  #lay() {
    this.#flat = this.#folders.flat((path) => this.isOpen(path), this.level);
  }
}
