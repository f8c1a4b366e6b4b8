// Which color each point has: by side, by error, by speed.

import { Color } from "three";
import { matched, stepOf } from "../engine/distances.js";
import { roundUp, scaleColor } from "./colors.js";

/** Colors of a theme as numbers. */
export function palette(theme) {
  const names = ["left", "right", "center", "ghost", "chosen", "gone"];
  return Object.fromEntries(names.map((name) => [name, new Color(theme[name]).toArray()]));
}

export const bySide = (points, colors) => (point) => colors[points[point].side];
export const alike = (color) => () => color;

/** By a number of each point, from 0 to `most`. */
export function byNumber(numbers, most, nothing) {
  const color = new Color();
  const out = numbers.map ? Array.from(numbers, (number) => colorOf(number)) : [];
  function colorOf(number) {
    if (!Number.isFinite(number)) return nothing;
    const [r, g, b] = scaleColor(number / most);
    return color.setRGB(r, g, b, "srgb").toArray();
  }
  return (point) => out[point];
}

/** Distances of the points of two actors in one frame. */
export class PointErrors {
  constructor(shown, compared) {
    this.shown = shown;
    this.compared = compared;
    this.pairs = matched(shown.clip.points, compared.clip.points);
    this.step = stepOf(shown.clip, compared.clip);
    const known = shown.clip.unitCm !== null && compared.clip.unitCm !== null;
    this.unit = known ? "mm" : "units";
    this.factor = (known ? 10 * shown.clip.unitCm : 1) / shown.axes.scale;
    this.ofShown = new Float32Array(shown.clip.points.length).fill(NaN);
    this.ofCompared = new Float32Array(compared.clip.points.length).fill(NaN);
    this.most = 0;
  }

  /** The points of the compared clip that are those of the shown one. */
  others(points) {
    return this.pairs.flatMap(([i, j]) => (points.includes(i) ? [j] : []));
  }

  /** Measures where both are now. */
  measure() {
    const a = this.shown.places;
    const b = this.compared.places;
    for (const [i, j] of this.pairs) {
      const distance =
        this.factor *
        Math.hypot(a[3 * i] - b[3 * j], a[3 * i + 1] - b[3 * j + 1], a[3 * i + 2] - b[3 * j + 2]);
      this.ofShown[i] = this.ofCompared[j] = distance;
      if (distance > this.most) this.most = distance;
    }
  }

  /** The number that has the last color: of all frames where these are known, else of those seen. */
  scaleEnd(errors) {
    const total = errors?.total?.max;
    const known = errors?.unit === "cm" ? 10 * total : total;
    return roundUp(Number.isFinite(known) && known > 0 ? known : this.most);
  }
}
