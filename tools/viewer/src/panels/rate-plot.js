// Rate and distortion: a point for each try, bytes to the right, mean error upwards, both as logarithms.

import { fill, inNextPicture, make, put } from "../ui/dom.js";
import { palette, sized } from "../ui/canvas.js";
import { count, figure, size } from "../ui/text.js";

const LEFT = 44;
const BELOW = 22;
const RADIUS = 4;

export class RatePlot {
  #tries = [];

  constructor() {
    this.canvas = make("canvas", { class: "plot", role: "img" });
    this.table = make("table");
    this.details = make("details", {}, make("summary", {}, "As a table"), this.table);
    this.element = put(make("section", {}, make("h2", {}, "Bytes and mean error")), this.canvas, this.details);
    this.draw = inNextPicture(() => this.#draw());
    new ResizeObserver(this.draw).observe(this.canvas);
  }

  show(tries) {
    this.#tries = tries;
    this.element.hidden = !tries.length;
    this.#fillTable();
    this.draw();
  }

  #fillTable() {
    const head = ["Codec", "Bytes", "Mean", "Greatest"].map((text) => make("th", { scope: "col" }, text));
    const rows = this.#tries.map(({ codec, label, bytes, mean, max, unit }) =>
      make(
        "tr",
        {},
        make("th", { scope: "row" }, `${codec}, ${label}`),
        make("td", {}, count(bytes)),
        make("td", {}, `${figure(mean, 3)} ${unit}`),
        make("td", {}, `${figure(max, 3)} ${unit}`),
      ),
    );
    fill(this.table, make("thead", {}, make("tr", {}, head)), make("tbody", {}, rows));
    const last = this.#tries.at(-1);
    const text = last ? `, the last ${size(last.bytes)} with ${figure(last.mean, 3)} ${last.unit}` : "";
    this.canvas.setAttribute("aria-label", `Bytes and mean error of ${count(this.#tries.length)} tries${text}`);
  }

  #draw() {
    if (!this.canvas.clientWidth || !this.#tries.length) return;
    const { context, width, height } = sized(this.canvas);
    const colors = palette(this.element);
    const shown = this.#tries.map((one) => ({ ...one, error: Math.max(one.mean, 1e-6) }));
    const x = axis(shown.map(({ bytes }) => bytes), LEFT, width - 8);
    const y = axis(shown.map(({ error }) => error), height - BELOW, 8);
    context.font = "10px system-ui, sans-serif";
    grid(context, { x, y, width, height, colors });
    const codecs = [...new Set(shown.map(({ codec }) => codec))];
    codecs.forEach((codec, k) => {
      const color = colors.lines[k % colors.lines.length];
      course(context, shown.filter((one) => one.codec === codec), { x, y, color });
      context.fillStyle = color;
      context.textAlign = "right";
      context.textBaseline = "top";
      context.fillText(codec, width - 10, 10 + 13 * k);
    });
    const last = shown.at(-1);
    context.strokeStyle = colors.ink;
    context.lineWidth = 1.5;
    context.beginPath();
    context.arc(x.at(last.bytes), y.at(last.error), RADIUS + 3, 0, 2 * Math.PI);
    context.stroke();
  }
}

/** A logarithmic axis from one pixel to another, with the marks that fall on it. */
function axis(values, from, to) {
  const low = Math.log10(Math.min(...values)) - 0.15;
  const high = Math.log10(Math.max(...values)) + 0.15;
  const marks = [];
  for (let power = Math.floor(low); power <= Math.ceil(high); power++) {
    for (const factor of high - low > 1.5 ? [1] : [1, 2, 5]) {
      const value = factor * 10 ** power;
      if (Math.log10(value) > low && Math.log10(value) < high) marks.push(value);
    }
  }
  return { at: (value) => from + ((Math.log10(value) - low) / (high - low)) * (to - from), marks };
}

function grid(context, { x, y, width, height, colors }) {
  context.strokeStyle = colors.line;
  context.fillStyle = colors.quiet;
  context.lineWidth = 1;
  context.beginPath();
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const mark of x.marks) {
    context.moveTo(x.at(mark), 4);
    context.lineTo(x.at(mark), height - BELOW);
    context.fillText(size(mark), x.at(mark), height - BELOW + 5);
  }
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const mark of y.marks) {
    context.moveTo(LEFT, y.at(mark));
    context.lineTo(width - 8, y.at(mark));
    context.fillText(figure(mark, 2), LEFT - 5, y.at(mark));
  }
  context.stroke();
}

function course(context, tries, { x, y, color }) {
  const points = tries.toSorted((a, b) => a.bytes - b.bytes);
  context.strokeStyle = context.fillStyle = color;
  context.lineWidth = 1.25;
  context.beginPath();
  for (const { bytes, error } of points) context.lineTo(x.at(bytes), y.at(error));
  context.stroke();
  for (const { bytes, error } of points) {
    context.beginPath();
    context.arc(x.at(bytes), y.at(error), RADIUS, 0, 2 * Math.PI);
    context.fill();
  }
}
