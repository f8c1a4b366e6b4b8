// Words on the picture: the name under the pointer, all names, the lengths of the floor, the scale
// of colors. All of them are text.

import { Vector3 } from "three";
import { printable } from "../ui/text.js";
import { scaleGradient } from "./colors.js";

const NEAR = 16; // pixels from the pointer

export class Labels {
  constructor(element) {
    this.point = add(element, "div", "point-label");
    this.note = add(element, "div", "stage-note");
    this.scale = add(element, "div", "stage-scale");
    this.files = [add(element, "div", "stage-file"), add(element, "div", "stage-file")];
    this.loading = add(element, "p", "stage-loading");
    this.loading.setAttribute("role", "status");
    this.names = add(element, "canvas", "stage-names");
    this.names.setAttribute("aria-hidden", "true");
    const bar = document.createElement("i");
    bar.style.background = scaleGradient();
    this.ends = document.createElement("span");
    this.scale.append(bar, this.ends);
    const hidden = [this.point, this.note, this.scale, this.loading, ...this.files];
    for (const one of hidden) one.hidden = true;
  }

  /** @param {string | null} name of the file that is being opened */
  setLoading(name) {
    this.loading.hidden = name === null;
    this.loading.textContent = name === null ? "" : `Loading ${printable(name, 80)} …`;
  }

  /**
   * The names below the figures.
   *
   * @param {{text: string, color: string, x: number, y: number}[]} figures none, or two
   */
  setFiles(figures) {
    this.files.forEach((label, k) => {
      const figure = figures[k];
      label.hidden = figure === undefined;
      if (figure === undefined) return;
      const text = printable(figure.text, 60);
      if (label.textContent !== text) label.textContent = text;
      label.style.borderColor = figure.color;
      label.style.transform = `translate(${Math.round(figure.x)}px, ${Math.round(figure.y)}px) translateX(-50%)`;
    });
  }

  setNote(text) {
    if (text === this.noteText) return;
    this.noteText = text;
    this.note.hidden = text === "";
    this.note.textContent = text;
  }

  /** @param {string[] | null} texts from left to right; null: colors mean no numbers */
  setScale(texts) {
    this.scale.hidden = texts === null;
    if (texts === null) return;
    const ends = texts.map((text) => {
      const end = document.createElement("b");
      end.textContent = text;
      return end;
    });
    this.ends.replaceChildren(...ends);
  }

  /** @param {{text: string, x: number, y: number} | null} what */
  setPoint(what) {
    this.point.hidden = what === null;
    if (what === null) return;
    this.point.textContent = what.text;
    this.point.style.transform = `translate(${Math.round(what.x + 14)}px, ${Math.round(what.y - 30)}px)`;
  }

  /** Draws the names of points, or removes them. */
  drawNames(points, projected, { isOn, width, height, color, halo }) {
    const context = this.names.getContext("2d");
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    if (!isOn) {
      if (this.names.width > 1) this.names.width = this.names.height = 1;
      return;
    }
    this.names.width = Math.round(width * ratio);
    this.names.height = Math.round(height * ratio);
    context.scale(ratio, ratio);
    context.font = "11px system-ui, sans-serif";
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = halo;
    context.fillStyle = color;
    const taken = [];
    points.forEach(({ name }, index) => {
      const x = projected[3 * index] + 7;
      const y = projected[3 * index + 1] + 4;
      if (Number.isNaN(x) || projected[3 * index + 2] > 1) return;
      if (taken.some(([a, b]) => Math.abs(a - x) < 60 && Math.abs(b - y) < 11)) return;
      taken.push([x, y]);
      context.strokeText(name.slice(0, 40), x, y);
      context.fillText(name.slice(0, 40), x, y);
    });
  }
}

function add(element, tag, name) {
  const child = document.createElement(tag);
  child.className = name;
  element.append(child);
  return child;
}

const v = new Vector3();

/**
 * Where points are on the page: x and y in pixels of the canvas, and depth (beyond 1: behind).
 *
 * @param {Float32Array} out three numbers a point; NaN where a point is nowhere
 */
export function project(places, camera, { width, height, offset }, out) {
  for (let k = 0; k < places.length; k += 3) {
    v.set(places[k] + offset[0], places[k + 1] + offset[1], places[k + 2] + offset[2]).project(
      camera,
    );
    out[k] = ((v.x + 1) / 2) * width;
    out[k + 1] = ((1 - v.y) / 2) * height;
    out[k + 2] = v.z;
  }
  return out;
}

/** The point that is nearest to x, y, of those that are near; -1: none. */
export function nearest(projected, x, y, near = NEAR) {
  let best = -1;
  let least = near;
  for (let k = 0; k < projected.length; k += 3) {
    const away = Math.hypot(projected[k] - x, projected[k + 1] - y) + projected[k + 2];
    if (projected[k + 2] > 1 || !(away < least)) continue;
    least = away;
    best = k / 3;
  }
  return best;
}
