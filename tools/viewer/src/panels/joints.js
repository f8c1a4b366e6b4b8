// The points of the clip as a tree; those that are selected have trails and curves.

import { button, fill, icon, later, make, put } from "../ui/dom.js";
import { counted } from "../ui/text.js";
import { Tree } from "../ui/tree.js";
import { matcher } from "./clips/search.js";

const SIDES = { left: "L", right: "R" };

export function mountJoints(panel, page) {
  new Joints(panel, page.store);
}

class Joints {
  #clip = null;
  #children = [];
  #parents = [];
  #closed = new Set();
  #items = [];

  constructor(panel, store) {
    this.store = store;
    const isCoarse = matchMedia("(pointer: coarse)").matches;
    this.tree = new Tree({ label: "Points", rowHeight: isCoarse ? 44 : 28, isMultiple: true });
    this.input = make("input", { type: "search", placeholder: "Search", "aria-label": "Search points" });
    this.input.addEventListener("input", later(() => this.#lay(), 80));
    this.status = make("p", { class: "quiet", role: "status" });
    put(
      panel,
      make("div", { class: "search" }, icon("search"), this.input),
      make(
        "div",
        { class: "buttons" },
        button({ label: "Left points: select them", shown: "Left", onClick: () => this.#side("left") }),
        button({ label: "Right points: select them", shown: "Right", onClick: () => this.#side("right") }),
        button({ label: "None: no point is selected", shown: "None", onClick: () => this.#select([]) }),
      ),
      this.tree.element,
      this.status,
    );
    panel.classList.add("filled");
    store.watch(["shown"], () => this.#take(store.get("shown")));
    store.watch(["selection"], () => this.#mark());
  }

  #take(clip) {
    this.#clip = clip;
    this.#closed.clear();
    const n = clip?.points.length ?? 0;
    this.#parents = new Int32Array(n).fill(-1);
    this.#children = Array.from({ length: n }, () => []);
    // Lines between markers are no tree.
    for (const [a, b] of clip && !clip.isMarkers ? clip.bones : []) {
      if (b <= a || this.#parents[b] >= 0) continue;
      this.#parents[b] = a;
      this.#children[a].push(b);
    }
    this.#lay();
  }

  #lay() {
    const text = this.input.value.trim();
    const points = this.#clip?.points ?? [];
    this.#items = [];
    if (text) {
      const isWanted = matcher(text);
      points.forEach(({ name }, index) => {
        if (isWanted(name)) this.#items.push({ index, level: 1 });
      });
    } else {
      // A stack, not recursion: a chain of joints may be very long.
      const stack = points.map((_, i) => i).filter((i) => this.#parents[i] < 0);
      const waiting = stack.reverse().map((index) => ({ index, level: 1 }));
      while (waiting.length) {
        const item = waiting.pop();
        this.#items.push(item);
        if (this.#closed.has(item.index)) continue;
        for (const child of this.#children[item.index].toReversed()) {
          waiting.push({ index: child, level: item.level + 1 });
        }
      }
    }
    this.#mark();
  }

  #mark() {
    const chosen = new Set(this.store.get("selection"));
    const points = this.#clip?.points ?? [];
    const isFound = this.input.value.trim() !== "";
    this.status.textContent = points.length
      ? `${chosen.size} of ${counted(points.length, this.#clip.isMarkers ? "marker" : "point")} selected`
      : "";
    this.tree.show({
      length: this.#items.length,
      item: (i) => {
        const { index, level } = this.#items[i];
        const { name } = points[index];
        const isLeaf = isFound || this.#children[index].length === 0;
        const isSelected = chosen.has(index);
        const isOpen = isLeaf ? null : !this.#closed.has(index);
        const stamp = `${isSelected}${isOpen}`;
        return { key: `${this.#clip.key}/${index}`, stamp, level, label: name, isOpen, isSelected, index };
      },
      fill: (row, item) => this.#fill(row, item),
      toggle: ({ index }, isOpen) => {
        if (isOpen) this.#closed.delete(index);
        else this.#closed.add(index);
        this.#lay();
      },
      activate: ({ index }, event) => this.#choose(index, event.shiftKey),
    });
  }

  #fill(row, { index, label, isOpen, isSelected }) {
    const { side } = this.#clip.points[index];
    fill(
      row,
      isOpen === null ? make("span", { class: "caret none" }) : make("span", { class: "caret" }, icon("caret")),
      make("span", { class: `dot ${side}`, "aria-hidden": "true" }),
      make("span", { class: "name", title: label }, label || "(no name)"),
      SIDES[side] && make("small", { class: "quiet", title: side }, SIDES[side]),
      make("span", { class: "mark" }, isSelected && icon("check")),
    );
  }

  /** Selects a point or not; with `isDeep` all below it, too. */
  #choose(index, isDeep) {
    const chosen = new Set(this.store.get("selection"));
    const isChosen = !chosen.has(index);
    const waiting = [index];
    while (waiting.length) {
      const point = waiting.pop();
      if (isChosen) chosen.add(point);
      else chosen.delete(point);
      if (isDeep) waiting.push(...this.#children[point]);
    }
    this.#select([...chosen]);
  }

  #side(side) {
    const points = this.#clip?.points ?? [];
    this.#select(points.map((_, i) => i).filter((i) => points[i].side === side));
  }

  #select(selection) {
    this.store.set({ selection: selection.sort((a, b) => a - b) });
  }
}
