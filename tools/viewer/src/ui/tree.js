// A tree of rows of which only those in view are elements: it may have a million.

import { inNextPicture, make } from "./dom.js";

const MOST_PIXELS = 12_000_000; // browsers lose rows of elements that are much higher
const BEYOND = 6; // rows made above and below what is seen
const TYPING_MS = 700; // letters typed within make one word

/**
 * Rows with roving focus: arrows, Home, End, Page Up and Down, letters, Enter, Space.
 *
 * `model` has `length`; `item(i)`: `{ key, level, label, isOpen, isSelected, isCurrent }`, where
 * `isOpen` is null of a leaf; `fill(row, item)`, which puts content in a row; `activate(item, event)`,
 * `toggle(item, isOpen)`; optionally `key(item, event)`, true where it took the key, and
 * `find(prefix, from)`, the row that begins with the letters, or -1.
 */
export class Tree {
  #model = { length: 0 };
  #rows = new Map();
  #active = 0;
  #height;
  #typed = "";
  #typedAt = 0;

  constructor({ label, rowHeight, isMultiple = false }) {
    this.#height = rowHeight;
    this.space = make("div", { class: "tree-space", role: "presentation" });
    this.element = make(
      "div",
      { class: "tree", role: "tree", "aria-label": label, "aria-multiselectable": isMultiple && "true" },
      this.space,
    );
    this.draw = inNextPicture(() => this.#draw());
    this.element.addEventListener("scroll", this.draw, { passive: true });
    this.element.addEventListener("keydown", (event) => this.#key(event));
    this.element.addEventListener("click", (event) => this.#click(event));
    new ResizeObserver(this.draw).observe(this.element);
  }

  get active() {
    return this.#active;
  }

  /** Shows another model, or the same one changed. */
  show(model) {
    this.#model = model;
    this.#active = Math.min(this.#active, Math.max(0, model.length - 1));
    this.draw();
  }

  /** Scrolls a row into view, and makes it the one that takes the focus. */
  reveal(index, { takesFocus = false } = {}) {
    if (!this.#model.length) return;
    this.#active = Math.max(0, Math.min(this.#model.length - 1, index));
    const { clientHeight } = this.element;
    const top = this.#top(this.#active);
    const shown = this.element.scrollTop;
    this.#size();
    if (top < shown) this.#scrollTo(this.#active, 0);
    else if (top + this.#height > shown + clientHeight) {
      this.#scrollTo(this.#active, clientHeight - this.#height);
    }
    this.#draw();
    if (takesFocus) this.#rows.get(this.#active)?.focus({ preventScroll: true });
  }

  #pixels() {
    return Math.min(this.#model.length * this.#height, MOST_PIXELS);
  }

  // Where all rows fit, a pixel is a pixel. Otherwise the scroll bar says which row is on top.
  #isScaled() {
    return this.#model.length * this.#height > MOST_PIXELS;
  }

  #first() {
    const { scrollTop, clientHeight } = this.element;
    if (!this.#isScaled()) return scrollTop / this.#height;
    const room = this.#pixels() - clientHeight;
    return (scrollTop / room) * (this.#model.length - clientHeight / this.#height);
  }

  /** Pixels from the top of the space to a row, as it is scrolled now. */
  #top(index) {
    if (!this.#isScaled()) return index * this.#height;
    return this.element.scrollTop + (index - this.#first()) * this.#height;
  }

  #scrollTo(index, offset) {
    if (!this.#isScaled()) {
      this.element.scrollTop = index * this.#height - offset;
      return;
    }
    const { clientHeight } = this.element;
    const room = this.#pixels() - clientHeight;
    const first = index - offset / this.#height;
    this.element.scrollTop = (first / (this.#model.length - clientHeight / this.#height)) * room;
  }

  #size() {
    this.space.style.height = `${this.#pixels()}px`;
  }

  #draw() {
    this.#size();
    const { length } = this.#model;
    const first = Math.max(0, Math.floor(this.#first()) - BEYOND);
    const n = Math.ceil(this.element.clientHeight / this.#height) + 2 * BEYOND;
    const wanted = new Set();
    for (let i = first; i < Math.min(length, first + n); i++) wanted.add(i);
    if (length) wanted.add(this.#active); // it keeps the focus wherever it is
    for (const [index, row] of this.#rows) {
      if (wanted.has(index)) continue;
      row.remove();
      this.#rows.delete(index);
    }
    for (const index of [...wanted].sort((a, b) => a - b)) this.#place(index);
  }

  #place(index) {
    let row = this.#rows.get(index);
    if (!row) {
      row = make("div", { class: "tree-row", role: "treeitem" });
      row.style.height = `${this.#height}px`;
      this.#rows.set(index, row);
      const next = [...this.space.children].find((other) => Number(other.dataset.index) > index);
      this.space.insertBefore(row, next ?? null);
    }
    const item = this.#model.item(index);
    row.dataset.index = index;
    row.tabIndex = index === this.#active ? 0 : -1;
    row.style.transform = `translateY(${this.#top(index)}px)`;
    row.style.setProperty("--level", Math.min(item.level, 12));
    row.setAttribute("aria-level", item.level);
    row.setAttribute("aria-setsize", item.setSize ?? this.#model.length);
    row.setAttribute("aria-posinset", item.place ?? index + 1);
    attribute(row, "aria-expanded", item.isOpen);
    attribute(row, "aria-selected", item.isSelected ?? null);
    attribute(row, "aria-current", item.isCurrent ? "true" : null);
    if (row.mczKey !== item.key || row.mczStamp !== item.stamp) {
      row.mczKey = item.key;
      row.mczStamp = item.stamp;
      this.#model.fill(row, item);
    }
  }

  #click(event) {
    const row = event.target.closest(".tree-row");
    if (!row || event.target.closest("button, a, input")) return;
    this.#active = Number(row.dataset.index);
    const item = this.#model.item(this.#active);
    this.draw();
    row.focus({ preventScroll: true });
    const isCaret = event.target.closest(".caret");
    if (item.isOpen !== null && item.isOpen !== undefined && (isCaret || item.isFolder)) {
      this.#model.toggle(item, !item.isOpen);
    } else this.#model.activate(item, event);
  }

  #key(event) {
    if (event.target.closest("button, input") || !this.#model.length) return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (this.#take(event)) {
      event.preventDefault();
      event.stopPropagation();
    }
  }

  /** Whether a key was for the tree. */
  #take(event) {
    const index = this.#active;
    const item = this.#model.item(index);
    const go = (to) => (this.reveal(to, { takesFocus: true }), true);
    const page = Math.max(1, Math.floor(this.element.clientHeight / this.#height) - 1);
    if (this.#model.key?.(item, event)) return true;
    switch (event.key) {
      case "ArrowDown":
        return go(index + 1);
      case "ArrowUp":
        return go(index - 1);
      case "PageDown":
        return go(index + page);
      case "PageUp":
        return go(index - page);
      case "Home":
        return go(0);
      case "End":
        return go(this.#model.length - 1);
      case "ArrowRight":
        if (item.isOpen === false) this.#model.toggle(item, true);
        else if (item.isOpen) go(index + 1);
        return true;
      case "ArrowLeft":
        if (item.isOpen) this.#model.toggle(item, false);
        else go(this.#parent(index));
        return true;
      case "Enter":
      case " ":
        if (item.isFolder) this.#model.toggle(item, !item.isOpen);
        else this.#model.activate(item, event);
        return true;
      default:
        return this.#type(event.key);
    }
  }

  #parent(index) {
    const { level } = this.#model.item(index);
    for (let i = index - 1; i >= Math.max(0, index - 50_000); i--) {
      if (this.#model.item(i).level < level) return i;
    }
    return index;
  }

  /** Goes to the next row that begins with what is typed. */
  #type(letter) {
    if (!/^[\p{L}\p{N}\p{P}\p{S}]$/u.test(letter) || "/?".includes(letter)) return false;
    const now = performance.now();
    this.#typed = (now - this.#typedAt < TYPING_MS ? this.#typed : "") + letter.toLowerCase();
    this.#typedAt = now;
    const from = this.#active + (this.#typed.length === 1 ? 1 : 0);
    const found = this.#find(this.#typed, from);
    if (found >= 0) this.reveal(found, { takesFocus: true });
    return true;
  }

  #find(prefix, from) {
    if (this.#model.find) return this.#model.find(prefix, from);
    const n = Math.min(this.#model.length, 100_000);
    for (let k = 0; k < n; k++) {
      const index = (from + k) % this.#model.length;
      if (this.#model.item(index).label.toLowerCase().startsWith(prefix)) return index;
    }
    return -1;
  }
}

function attribute(element, name, value) {
  if (value === null || value === undefined) element.removeAttribute(name);
  else element.setAttribute(name, String(value));
}
