// The pointer on the picture: names of points under it, points that are chosen by a click.

import { figure } from "../ui/text.js";
import { nearest } from "./labels.js";

const CLICK = 5; // pixels that a pointer may move in a click
const TOUCH = 28; // pixels from a finger

/** @param {HTMLCanvasElement} canvas @param {object} stage see stage.js */
export function listenToPointer(canvas, stage) {
  let down = null;
  canvas.addEventListener("pointermove", (event) => event.buttons === 0 && hover(stage, event));
  canvas.addEventListener("pointerleave", () => stage.labels.setPoint(null));
  canvas.addEventListener("pointerdown", (event) => {
    down = event;
    stage.labels.setPoint(null);
  });
  canvas.addEventListener("pointerup", (event) => {
    if (down === null) return;
    const moved = Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY);
    if (moved < CLICK && event.button === 0) choose(stage, event);
    down = null;
  });
  canvas.addEventListener("dblclick", () => stage.page.store.set({ view: { name: "fit" } }));
}

function pointAt(stage, event) {
  if (!stage.shown?.body) return { point: -1 };
  const box = stage.view.canvas.getBoundingClientRect();
  const x = event.clientX - box.left;
  const y = event.clientY - box.top;
  const near = event.pointerType === "touch" ? TOUCH : undefined;
  return { x, y, point: nearest(stage.projected(), x, y, near) };
}

function hover(stage, event) {
  const { x, y, point } = pointAt(stage, event);
  stage.labels.setPoint(point < 0 ? null : { x, y, text: nameOf(stage, point) });
}

function nameOf({ shown, page, pointErrors }, point) {
  const { name } = shown.clip.points[point];
  if (page.store.get("colors") !== "error" || pointErrors === null) return name;
  const error = pointErrors.ofShown[point];
  return Number.isFinite(error) ? `${name}: ${figure(error, 3)} ${pointErrors.unit}` : name;
}

function choose(stage, event) {
  const { store } = stage.page;
  const { point } = pointAt(stage, event);
  const chosen = store.get("selection");
  const adds = event.shiftKey || event.ctrlKey || event.metaKey;
  if (point < 0) {
    if (!adds && chosen.length > 0) store.set({ selection: [] });
    return;
  }
  const others = adds ? chosen.filter((one) => one !== point) : [];
  const isOff = chosen.includes(point) && (adds || chosen.length === 1);
  store.set({ selection: isOff ? others : [...others, point] });
}
