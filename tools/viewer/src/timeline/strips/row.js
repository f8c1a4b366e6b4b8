// What all strips have: a name with the value of a frame, a canvas, keys, and time below the pointer.

import { fill, inNextPicture, make } from "../../ui/dom.js";
import { sized } from "../../ui/canvas.js";
import { count, figure, frameNumber } from "../../ui/text.js";
import { moved, zoomed } from "./window.js";

const CLICK = 4; // pixels that a pointer may move and still have clicked

/** One strip. `painter` has `paint(view)`, `describe()`, `valueAt(frame)`; optionally `click(frame, view)`, `key(event)`. */
export class Row {
  constructor(shared, { name, className, painter, close }) {
    Object.assign(this, { shared, painter });
    this.value = make("output", { class: "value" });
    this.scale = make("div", { class: "scale", "aria-hidden": "true" });
    this.canvas = make("canvas", {
      role: "slider",
      tabindex: "0",
      "aria-valuemin": "0",
      "aria-orientation": "horizontal",
    });
    this.element = make(
      "div",
      { class: `strip ${className}` },
      make("div", { class: "strip-head" }, make("span", { class: "name", title: name }, name), close, this.value),
      this.scale,
      this.canvas,
    );
    this.name = name;
    this.draw = inNextPicture(() => this.#draw());
    this.#listen();
    this.say();
  }

  /** The frame of a place on the canvas. */
  frameAt(x) {
    const { from, to } = this.shared.window();
    return from + (x / Math.max(1, this.canvas.clientWidth)) * (to - from);
  }

  #draw() {
    if (!this.element.isConnected || !this.canvas.clientWidth) return;
    const { from, to } = this.shared.window();
    const { context, width, height } = sized(this.canvas);
    const x = (frame) => ((frame - from) / Math.max(1e-9, to - from)) * width;
    this.painter.paint({ context, width, height, from, to, x, colors: this.shared.colors() });
    const ends = this.painter.scale?.();
    if (ends) fill(this.scale, ends.toReversed().map((end) => make("span", {}, figure(end, 3))));
    this.say();
  }

  /** Tells the value of the frame, or of the one below the pointer. */
  say() {
    const { store } = this.shared.page;
    const clip = store.get("shown") ?? { nFrames: 0 };
    const { nFrames } = clip;
    const valueOf = (frame) => this.painter.valueAt(Math.max(0, Math.min(nFrames - 1, Math.floor(frame))));
    const frame = Math.floor(store.get("frame"));
    const text = valueOf(frame);
    const hovered = this.shared.hovered();
    const seen = hovered === null ? text : valueOf(hovered);
    if (this.value.textContent !== seen) this.value.textContent = seen;
    this.canvas.setAttribute("aria-label", `${this.name}. ${this.painter.describe()}`);
    this.canvas.setAttribute("aria-valuemax", String(Math.max(0, nFrames - 1)));
    this.canvas.setAttribute("aria-valuenow", String(frame));
    this.canvas.setAttribute("aria-valuetext", `frame ${count(frameNumber(clip, frame))}${text ? `, ${text}` : ""}`);
  }

  #listen() {
    const { canvas, shared } = this;
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.#key(event));
    canvas.addEventListener("pointermove", (event) => {
      if (this.#pinch(event)) this.pressed = null;
      else if (!this.pressed) shared.hover(this.frameAt(event.offsetX));
      else this.#drag(event);
    });
    canvas.addEventListener("pointerleave", () => shared.hover(null));
    canvas.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch") {
        shared.pinch.press(event.pointerId, event.offsetX, (x) => this.frameAt(x));
      }
      this.pressed = { x: event.offsetX, window: shared.window(), isPan: event.shiftKey || event.button === 1, isClick: true };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", (event) => this.#release(event));
    canvas.addEventListener("pointercancel", ({ pointerId }) => {
      shared.pinch.release(pointerId);
      this.pressed = null;
    });
  }

  /** Zooms by two fingers; whether the pointer is one of two. */
  #pinch({ pointerId, offsetX }) {
    const { pinch } = this.shared;
    const window = pinch.move(pointerId, offsetX, this.canvas.clientWidth, this.shared.nFrames());
    if (window !== null) this.shared.setWindow(window);
    return pinch.has(pointerId);
  }

  #drag({ offsetX }) {
    const { x, window, isPan } = this.pressed;
    if (Math.abs(offsetX - x) > CLICK) this.pressed.isClick = false;
    if (this.pressed.isClick) return;
    if (isPan) {
      const frames = ((x - offsetX) / this.canvas.clientWidth) * (window.to - window.from);
      this.shared.setWindow(moved(window, frames, this.shared.nFrames()));
    } else this.shared.goTo(this.frameAt(offsetX));
  }

  #release({ pointerId, offsetX }) {
    const { pinch } = this.shared;
    const wasClick = this.pressed?.isClick && !pinch.has(pointerId);
    pinch.release(pointerId);
    this.pressed = null;
    if (!wasClick) return;
    const frame = this.frameAt(offsetX);
    const slack = (this.shared.window().to - this.shared.window().from) * (8 / this.canvas.clientWidth);
    if (!this.painter.click?.(frame, slack)) this.shared.goTo(frame);
  }

  #wheel(event) {
    event.preventDefault();
    const { shared } = this;
    const window = shared.window();
    const unit = event.deltaMode === 1 ? 16 : 1;
    const isPan = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (isPan) {
      const pixels = (event.deltaX || event.deltaY) * unit;
      const frames = (pixels / this.canvas.clientWidth) * (window.to - window.from);
      shared.setWindow(moved(window, frames, shared.nFrames()));
    } else {
      const factor = Math.exp(Math.max(-100, Math.min(100, event.deltaY * unit)) * 0.004);
      shared.setWindow(zoomed(window, factor, this.frameAt(event.offsetX), shared.nFrames()));
    }
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!this.painter.key?.(event) && !this.#move(event)) return;
    event.preventDefault();
    event.stopPropagation();
    this.shared.hover(null);
  }

  #move({ key, shiftKey }) {
    const { shared } = this;
    const window = shared.window();
    const frame = Math.floor(shared.page.store.get("frame"));
    const tenth = (window.to - window.from) / 10;
    const n = shared.nFrames();
    const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[key];
    if (way && shiftKey) shared.setWindow(moved(window, way * tenth, n));
    else if (way) shared.goTo(frame + way);
    else if (key === "PageUp" || key === "PageDown") shared.goTo(frame + (key === "PageUp" ? tenth : -tenth));
    else if (key === "Home" || key === "End") shared.goTo(key === "Home" ? 0 : n - 1);
    else if (key === "+" || key === "=") shared.setWindow(zoomed(window, 0.5, frame, n));
    else if (key === "-") shared.setWindow(zoomed(window, 2, frame, n));
    else if (key === "0") shared.setWindow({ from: 0, to: n });
    else return false;
    return true;
  }
}
