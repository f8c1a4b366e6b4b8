// A strip of curves: of a few channels, of a point's position, of speeds, of errors.

import { later, make } from "../../ui/dom.js";
import { figure } from "../../ui/text.js";
import { paintCourse, paintGround, paintZero, scaleOf } from "./paint.js";
import { extentOf } from "./ranges.js";
import { whole } from "./window.js";

/** Draws a source of sources.js; fetches what the window needs. */
export class CurveStrip {
  #courses = null; // what was fetched, with its frames
  #asked = 0;

  constructor(shared, source) {
    Object.assign(this, { shared, source, clip: shared.page.store.get("shown") });
    this.load = later(() => this.#load(), 30);
    this.load();
  }

  close() {
    this.#asked++;
  }

  async #load() {
    const mine = ++this.#asked;
    const isOver = () => mine !== this.#asked;
    const { from, to } = whole(this.shared.window(), this.clip.nFrames);
    const width = Math.max(1, Math.min(4096, this.shared.width()));
    const take = (ranges) => {
      if (isOver() || !ranges) return;
      this.#courses = ranges.map((range) => ({ ...range, from, to }));
      this.row?.draw();
    };
    if (to <= from || this.shared.width() <= 0) return; // the panel is folded away
    try {
      take(await this.source.load({ from, to, width }, isOver, take));
    } catch (error) {
      if (!isOver()) this.error = error.message;
      this.row?.draw();
    }
  }

  extent() {
    const [least, most] = extentOf(this.#courses ?? []);
    if (this.source.kind === "error" || this.source.kind === "speed") return [0, most || 1];
    return least === most ? [least - 1, most + 1] : [least, most];
  }

  paint(view) {
    paintGround(view, this.clip);
    if (!this.#courses) return;
    const extent = this.extent();
    const y = scaleOf(extent, view.height);
    paintZero(view, extent, y);
    this.#courses.forEach((course, k) => {
      paintCourse(view, course, y, { color: this.color(k, view.colors) });
    });
  }

  /** The ends of its scale, which stand beside the curves; null while nothing was read. */
  scale() {
    return this.#courses && this.extent();
  }

  color(k, colors) {
    return colors.lines[k % colors.lines.length];
  }

  /** The value of each curve in a frame, as the pixels have it. */
  valueAt(frame) {
    if (this.error) return this.error;
    const values = (this.#courses ?? []).map(({ least, most, from, to }) => {
      const at = Math.min(least.length - 1, Math.floor(((frame - from) / (to - from)) * least.length));
      return Number.isNaN(least[at]) || at < 0 ? NaN : (least[at] + most[at]) / 2;
    });
    const unit = this.source.unit ? ` ${this.source.unit}` : "";
    if (values.length === 1) return `${figure(values[0], 3)}${unit}`;
    const shown = values.slice(0, 4).map((value, k) => `${this.source.series[k].label} ${figure(value, 3)}`);
    return shown.length ? `${shown.join("  ")}${unit}` : "";
  }

  describe() {
    if (this.error) return this.error;
    if (!this.#courses) return "Being read.";
    const unit = this.source.unit ? ` ${this.source.unit}` : "";
    return this.#courses
      .map((course, k) => {
        const [least, most] = extentOf([course]);
        return `${this.source.series[k].label}: ${figure(least, 3)} to ${figure(most, 3)}${unit}`;
      })
      .join("; ");
  }

  legendClass(k) {
    return `curve-${(k % 6) + 1}`;
  }

  /** Names of the curves in their colors. */
  legend() {
    const { series } = this.source;
    if (series.length < 2) return null;
    return make(
      "ul",
      { class: "legend", "aria-hidden": "true" },
      series.map(({ label }, k) => make("li", { class: this.legendClass(k), title: label }, label)),
    );
  }
}
