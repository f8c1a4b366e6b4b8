// The list of clips: files, folders, search, what is shown and what it is compared with.

import { compareClip, showClip } from "../actions.js";
import { button, fill, icon, later, make, put } from "../../ui/dom.js";
import { count, counted, printable, summary } from "../../ui/text.js";
import { Tree } from "../../ui/tree.js";
import { search } from "./search.js";
import { Section } from "./section.js";

const ROW_HEIGHT = 44;
const LONG = 30; // letters of a name that takes two lines, so that the statistics go

export function mountClips(element, page) {
  new Clips(element, page);
}

class Clips {
  #sections = [];
  #closed = new Set(); // ids of files whose rows are folded away
  #found = null;
  #stop = () => {};

  constructor(element, page) {
    this.page = page;
    this.tree = new Tree({ label: "Clips", rowHeight: ROW_HEIGHT });
    this.status = make("p", { class: "quiet", role: "status" });
    this.input = make("input", { type: "search", placeholder: "Search", "aria-label": "Search clips" });
    this.input.maxLength = 500;
    this.input.addEventListener("input", later(() => this.#search(), 120));
    this.input.addEventListener("keydown", (event) => this.#searchKey(event));
    put(
      element,
      make("div", { class: "search" }, icon("search"), this.input),
      this.tree.element,
      this.status,
    );
    page.store.watch(["files"], () => this.#files());
    page.store.watch(["shown"], () => this.#reveal());
    page.store.watch(["shown", "compared"], () => this.#show());
  }

  #searchKey(event) {
    if (event.key === "ArrowDown" || event.key === "Enter") {
      event.preventDefault();
      this.tree.reveal(this.#found ? 0 : this.tree.active, { takesFocus: true });
    } else if (event.key === "Escape" && this.input.value) {
      event.stopPropagation();
      this.input.value = "";
      this.#search();
    }
  }

  #files() {
    const files = this.page.store.get("files");
    const isNested = files.length > 1;
    const kept = new Map(this.#sections.map((section) => [section.file.id, section]));
    this.#sections = files.map((file) => {
      const level = isNested && file.nClips > 1 ? 2 : 1;
      const old = kept.get(file.id);
      if (old?.level === level) return old;
      const onChange = () => (this.#reveal(), this.#show());
      return new Section(this.page.engine, file, { level, onChange });
    });
    for (const [id, section] of kept) if (!files.some((file) => file.id === id)) section.close();
    this.#search();
  }

  #search() {
    this.#stop();
    const text = this.input.value.trim();
    this.#found = text ? [] : null;
    this.#say();
    this.#show();
    if (!text) return this.#reveal();
    const total = this.#sections.reduce((sum, { file }) => sum + file.nClips, 0);
    this.#stop = search(this.#sections, text, (found, nSeen) => {
      this.#found = found;
      const progress = nSeen < total ? ` of ${count(nSeen)} searched` : ` of ${count(total)}`;
      this.status.textContent = `${count(found.length)} found${progress}`;
      this.#show();
    });
  }

  #say() {
    const total = this.#sections.reduce((sum, { file }) => sum + file.nClips, 0);
    const tooMany = this.#sections.some(({ hasFolders }) => !hasFolders);
    const note = tooMany ? "; too many for folders" : "";
    this.status.textContent = total ? `${counted(total, "clip")}${note}` : "No file is open.";
  }

  /** Scrolls to the clip that is shown, once: when it changes, or when its row came. */
  #reveal() {
    const shown = this.page.store.get("shown");
    if (!shown || this.#found || this.revealed === shown.key) return;
    const section = this.#sections.find(({ file }) => file.id === shown.fileId);
    if (!section) return;
    section.uncover(shown.name);
    const place = section.place(shown.index);
    if (place < 0) return;
    this.revealed = shown.key;
    const model = this.#model();
    this.tree.show(model);
    this.tree.reveal(model.start(section) + place);
  }

  #show() {
    this.tree.show(this.#model());
  }

  #model() {
    const { page } = this;
    const shown = page.store.get("shown");
    const compared = page.store.get("compared");
    const is = (clip, section, row) => clip?.fileId === section.file.id && clip.index === row.index;
    const named = (section, item) =>
      section.file.nClips === 1 ? section.file.name : this.#found ? item.row.name : item.label;
    const clipItem = (section, item) => {
      const isShown = is(shown, section, item.row);
      const isCompared = is(compared, section, item.row);
      return {
        ...item,
        key: `${section.file.id}/${item.row.index}`,
        stamp: `${isShown}${isCompared}${item.row.nFrames}${item.label}${item.alias}`,
        section,
        label: named(section, item),
        isOpen: null,
        isCurrent: isShown,
        isSelected: isShown,
        isCompared,
      };
    };
    const folderItem = (section, item) => ({
      ...item,
      key: `${section.file.id}:${item.folder.path}`,
      stamp: `${item.isOpen}${item.folder.nClips}`,
      section,
      isFolder: true,
    });
    const parts = this.#found ? [this.#foundPart(clipItem)] : this.#parts(clipItem, folderItem);
    return {
      length: parts.reduce((sum, { length }) => sum + length, 0),
      start: (section) => startOf(parts, section),
      item: (index) => itemOf(parts, index),
      fill: (row, item) => this.#fill(row, item),
      toggle: (item, isOpen) => this.#toggle(item, isOpen),
      activate: (item) => showClip(page, item.section.file.id, item.row.index),
      key: (item, event) => this.#key(item, event),
    };
  }

  #foundPart(clipItem) {
    const found = this.#found;
    return {
      length: found.length,
      item: (i) =>
        clipItem(found[i].section, {
          level: 1,
          row: found[i].row,
          label: found[i].row.name,
          alias: found[i].alias,
        }),
    };
  }

  #parts(clipItem, folderItem) {
    const parts = [];
    for (const section of this.#sections) {
      const isOpen = !this.#closed.has(section.file.id);
      if (section.level === 2) parts.push(headPart(section, isOpen));
      if (section.level === 2 && !isOpen) continue;
      parts.push({
        section,
        length: section.length,
        item: (i) => {
          const item = section.item(i);
          return item.folder ? folderItem(section, item) : clipItem(section, item);
        },
      });
    }
    return parts;
  }

  #toggle(item, isOpen) {
    if (item.folder) item.section.toggle(item.folder.path, isOpen);
    else if (isOpen) this.#closed.delete(item.section.file.id);
    else this.#closed.add(item.section.file.id);
    this.#show();
  }

  #key(item, event) {
    if (event.key !== "C" || item.isFolder) return false;
    this.#compare(item);
    return true;
  }

  #compare(item) {
    if (item.isCompared) compareClip(this.page, null);
    else compareClip(this.page, item.section.file.id, item.row.index);
  }

  #fill(row, item) {
    if (item.isFolder) {
      const n = item.folder?.nClips ?? item.section.file.nClips;
      fill(
        row,
        make("span", { class: "caret" }, icon("caret")),
        make("span", { class: "name", title: item.label }, item.label),
        make("small", { class: "quiet" }, count(n)),
      );
      return;
    }
    const own = item.row.nFrames === undefined ? "…" : summary(item.row);
    const facts = item.alias ? `also named ${printable(item.alias, 200)}` : own;
    const isLong = !item.alias && item.label.length > LONG;
    fill(
      row,
      make(
        "span",
        { class: "two-lines" },
        make("span", { class: isLong ? "name long" : "name", title: `${item.label}\n${facts}` }, item.label || "(no name)"),
        !isLong && make("small", { class: "quiet" }, facts),
      ),
      !item.isCurrent &&
        button({
          label: item.isCompared ? `Stop comparing with ${item.label}` : `Compare with ${item.label}`,
          icon: "compare",
          class: "small compare",
          tabindex: "-1",
          "aria-pressed": String(Boolean(item.isCompared)),
          onClick: () => this.#compare(item),
        }),
    );
  }
}

function headPart(section, isOpen) {
  const item = {
    key: `file ${section.file.id}`,
    stamp: `${isOpen}`,
    level: 1,
    section,
    label: section.file.name,
    isFolder: true,
    isOpen,
  };
  return { length: 1, item: () => item };
}

function startOf(parts, section) {
  let start = 0;
  for (const part of parts) {
    if (part.section === section) return start;
    start += part.length;
  }
  return 0;
}

function itemOf(parts, index) {
  let at = index;
  for (const part of parts) {
    if (at < part.length) return part.item(at);
    at -= part.length;
  }
  throw new RangeError(`no row ${index}`);
}
