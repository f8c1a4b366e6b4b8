// Strips under the timeline: curves, errors and marks, all of the same part of the clip's time.

import { palette } from "../../ui/canvas.js";
import { button, fill, inNextPicture, make, put, toggle } from "../../ui/dom.js";
import { frameNumber } from "../../ui/text.js";
import { popover } from "../../ui/popover.js";
import { CurveStrip } from "./curve-strip.js";
import { ErrorStrip } from "./error-strip.js";
import { MarksStrip } from "./marks-strip.js";
import { paintRuler } from "./paint.js";
import { Pinch } from "./pinch.js";
import { Row } from "./row.js";
import { sourcesOf } from "./sources.js";
import { clamped, moved } from "./window.js";

const MOST_ANALOG = 2; // strips of analog channels that are there from the beginning

export function mountStrips(element, page) {
  return new Strips(element, page);
}

class Strips {
  #rows = new Map(); // by id of source
  #window = { from: 0, to: 1 };
  #hovered = null;
  #colors = null;
  #kinds = new Map(); // what was chosen or taken away by hand
  #clip = null;

  constructor(element, page) {
    this.page = page;
    this.pinch = new Pinch();
    this.list = make("div", { class: "strip-list" });
    this.playhead = make("div", { class: "playhead", "aria-hidden": "true" });
    this.menu = popover({ label: "Curves to show", shown: "Curves", icon: "curves", id: "curves-menu" });
    const all = button({
      label: "Show all of the clip's time",
      shown: "All",
      class: "small",
      onClick: () => this.setWindow({ from: 0, to: this.nFrames() }),
    });
    this.ruler = this.#ruler();
    this.ruler.element.querySelector(".strip-head").replaceChildren(this.menu.element, all);
    put(element, make("div", { class: "strip-board" }, this.ruler.element, this.list, this.playhead));
    this.element = element;
    this.#watch();
  }

  // What rows use.
  window = () => this.#window;
  hovered = () => this.#hovered;
  nFrames = () => this.#clip?.nFrames ?? 0;
  width = () => Math.floor(this.ruler.canvas.clientWidth);
  colors = () => (this.#colors ??= palette(this.element));

  hover(frame) {
    this.#hovered = frame;
    for (const row of this.#rows.values()) row.say();
  }

  goTo(frame) {
    const to = Math.max(0, Math.min(this.nFrames() - 1, Math.floor(frame)));
    this.page.store.set({ playing: false, frame: to });
  }

  setWindow({ from, to }) {
    this.#window = clamped(from, to, this.nFrames());
    for (const { painter } of this.#rows.values()) painter.load();
    this.draw();
  }

  draw() {
    this.ruler.draw();
    for (const row of this.#rows.values()) row.draw();
    this.#placePlayhead();
  }

  #watch() {
    const { store } = this.page;
    const lay = inNextPicture(() => this.#lay());
    store.watch(["shown"], () => this.#take(store.get("shown")));
    store.watch(["selection", "errors", "contacts", "up"], lay);
    store.watch(["frame"], () => this.#follow());
    store.watch(["theme"], () => {
      this.#colors = null;
      requestAnimationFrame(() => ((this.#colors = null), this.draw()));
    });
    new ResizeObserver(() => this.setWindow(this.#window)).observe(this.ruler.canvas);
  }

  #take(clip) {
    const isSameLength = clip && this.#clip?.nFrames === clip.nFrames;
    this.#clip = clip;
    this.element.classList.toggle("empty", !clip);
    if (!isSameLength) this.#window = { from: 0, to: Math.max(1, clip?.nFrames ?? 1) };
    for (const id of [...this.#rows.keys()]) this.#close(id);
    this.#lay();
  }

  /** Makes the rows that are wanted, and takes away the others. */
  #lay() {
    const { store, engine } = this.page;
    const clip = this.#clip;
    if (!clip) return void fill(this.list);
    const sources = sourcesOf(engine, clip, store.get("selection"));
    const wanted = this.#wanted(sources);
    const ids = new Set(wanted.map(({ id }) => id));
    for (const id of [...this.#rows.keys()]) if (!ids.has(id)) this.#close(id);
    for (const one of wanted) if (!this.#rows.has(one.id)) this.#open(one);
    this.list.append(...wanted.map(({ id }) => this.#rows.get(id).element));
    this.#fillMenu(sources);
    store.set({ curves: sources.filter(({ id }) => ids.has(id)) });
    this.draw();
  }

  #wanted(sources) {
    const { store } = this.page;
    const clip = this.#clip;
    const wanted = [];
    const errors = store.get("errors");
    if (errors) wanted.push({ id: errorId(errors), name: "Error", make: () => new ErrorStrip(this, errors) });
    if (MarksStrip.isWanted(clip, store)) {
      const key = `${store.get("contacts")}${store.get("up")}`;
      wanted.push({ id: `marks ${key}`, name: "Marks", make: () => new MarksStrip(this) });
    }
    let nAnalog = 0;
    for (const source of sources) {
      const isFirst = source.kind === "speed" || (source.kind === "analog" && nAnalog++ < MOST_ANALOG);
      if (!(this.#kinds.get(kindOf(source)) ?? isFirst)) continue;
      const { id, name } = source;
      wanted.push({ id: id, name, source, make: () => new CurveStrip(this, source) });
    }
    return wanted;
  }

  #open({ id, name, source, make: made }) {
    const painter = made();
    const close =
      source &&
      button({ label: `Remove: ${name}`, icon: "close", class: "small", onClick: () => this.#choose(source, false) });
    const className = painter instanceof MarksStrip ? "marks" : "curves";
    const row = new Row(this, { name, className, painter, close });
    painter.row = row;
    const legend = painter.legend?.();
    if (legend) row.element.querySelector(".strip-head").append(legend);
    this.#rows.set(id, row);
  }

  #close(id) {
    const row = this.#rows.get(id);
    row.painter.close();
    row.element.remove();
    this.#rows.delete(id);
  }

  #choose(source, isShown) {
    this.#kinds.set(kindOf(source), isShown);
    this.#lay();
  }

  #fillMenu(sources) {
    const { store } = this.page;
    const seen = new Set();
    const boxes = sources
      .filter((source) => !seen.has(kindOf(source)) && seen.add(kindOf(source)))
      .map((source) => {
        const value = [...this.#rows.keys()].some((id) => id === source.id);
        return toggle({ text: nameOf(source), value, onChange: (on) => this.#choose(source, on) }).element;
      });
    const contacts = toggle({
      text: "Foot contacts",
      value: store.get("contacts"),
      onChange: (on) => store.set({ contacts: on }),
    });
    // A box keeps the focus when the list is made again.
    const boxesBefore = [...this.menu.body.querySelectorAll("input")];
    const at = boxesBefore.indexOf(document.activeElement);
    fill(this.menu.body, boxes, contacts.element);
    if (at >= 0) this.menu.body.querySelectorAll("input")[at]?.focus();
  }

  #ruler() {
    const painter = {
      paint: (view) => this.#clip && paintRuler(view, this.#clip),
      describe: () => {
        const { from, to } = this.#window;
        const number = (frame) => frameNumber(this.#clip ?? {}, frame);
        return `Frames ${number(from)} to ${number(Math.ceil(to) - 1)} are shown. Plus and minus zoom, Shift and arrows move.`;
      },
      valueAt: () => "",
      load() {},
    };
    return new Row(this, { name: "Time", className: "ruler", painter });
  }

  /** Moves the line of the frame, and the window where the frame has left it. */
  #follow() {
    const { from, to } = this.#window;
    const frame = this.page.store.get("frame");
    if (this.#clip && to - from < this.#clip.nFrames && (frame < from || frame >= to)) {
      const by = frame >= to && this.page.store.get("playing") ? frame - from : frame - (from + to) / 2;
      this.setWindow(moved(this.#window, by, this.#clip.nFrames));
    }
    this.#placePlayhead();
    if (!this.page.store.get("playing") || ++this.ticks % 6 === 0) {
      for (const row of [this.ruler, ...this.#rows.values()]) row.say();
    }
  }

  ticks = 0;

  #placePlayhead() {
    const { canvas } = this.ruler;
    const { from, to } = this.#window;
    const share = (Math.floor(this.page.store.get("frame")) + 0.5 - from) / Math.max(1, to - from);
    const isSeen = this.#clip && share >= 0 && share <= 1;
    this.playhead.hidden = !isSeen;
    if (isSeen) {
      this.playhead.style.transform = `translateX(${canvas.offsetLeft + share * canvas.clientWidth}px)`;
    }
  }
}

/** Strips that are chosen together: the positions of whichever points are selected are one. */
const kindOf = (source) => (source.kind === "analog" ? source.id : source.kind);

const nameOf = (source) =>
  ({ speed: "Speed", position: "Position of selected points", channels: "Channels of selected joints" })[
    source.kind
  ] ?? source.name;

let nErrors = 0;
const ERROR_IDS = new WeakMap();

function errorId(errors) {
  if (!ERROR_IDS.has(errors)) ERROR_IDS.set(errors, `error ${++nErrors}`);
  return ERROR_IDS.get(errors);
}
