// Error over time: mean and greatest, with peaks to go to.

import { count, distance, frameNumber } from "../../ui/text.js";
import { CurveStrip } from "./curve-strip.js";
import { scaleOf } from "./paint.js";
import { peaksOf } from "./ranges.js";
import { errorSource } from "./sources.js";
import { whole } from "./window.js";

const MOST_PEAKS = 8;

export class ErrorStrip extends CurveStrip {
  constructor(shared, errors) {
    super(shared, errorSource(errors));
    this.errors = errors;
  }

  paint(view) {
    super.paint(view);
    const y = scaleOf(this.extent(), view.height);
    view.context.fillStyle = view.colors.fault;
    for (const frame of this.peaks(view)) {
      const [x, top] = [view.x(frame + 0.5), y(this.errors.max[frame] * this.source.factor)];
      view.context.beginPath();
      view.context.arc(x, Math.max(4, top), 3, 0, 2 * Math.PI);
      view.context.fill();
    }
  }

  color(k, colors) {
    return k === 0 ? colors.fault : colors.accent;
  }

  legendClass(k) {
    return k === 0 ? "fault" : "accent";
  }

  peaks(window = this.shared.window()) {
    const { from, to } = whole(window, this.errors.max.length);
    const apart = ((to - from) * 24) / Math.max(1, this.shared.width());
    return peaksOf(this.errors.max, { from, to, apart, most: MOST_PEAKS });
  }

  /** Goes to the greatest error about a frame, and selects the point that has it. */
  click(frame, slack) {
    const { max } = this.errors;
    const [from, to] = [Math.max(0, Math.floor(frame - slack)), Math.min(max.length, Math.ceil(frame + slack) + 1)];
    let best = -1;
    for (let f = from; f < to; f++) if (!(max[best] >= max[f]) && max[f] >= 0) best = f;
    if (best < 0) return false;
    this.goTo(best);
    return true;
  }

  goTo(frame) {
    const { store } = this.shared.page;
    const point = this.errors.worst[frame];
    store.set({ playing: false, frame, selection: point >= 0 ? [point] : [] });
    const { name } = this.clip.points[point] ?? {};
    const text = distance(this.errors.max[frame], this.errors.unit === "cm" ? 1 : null);
    if (name !== undefined) store.set({ message: { text: `Frame ${count(frameNumber(this.clip, frame))}: ${name}, ${text}`, isFault: false } });
  }

  key({ key }) {
    const frame = Math.floor(this.shared.page.store.get("frame"));
    const peaks = this.peaks();
    if (!peaks.length) return false;
    const inTime = peaks.toSorted((a, b) => a - b);
    if (key === "Enter") this.goTo(peaks[0]);
    else if (key === "n") this.goTo(inTime.find((f) => f > frame) ?? inTime[0]);
    else if (key === "p") this.goTo(inTime.findLast((f) => f < frame) ?? inTime.at(-1));
    else return false;
    return true;
  }

  describe() {
    const { total } = this.errors;
    if (!total || !(total.max >= 0)) return "No distances.";
    const unitCm = this.errors.unit === "cm" ? 1 : null;
    const name = this.clip.points[total.point]?.name ?? "";
    return (
      `Mean ${distance(total.mean, unitCm)}, greatest ${distance(total.max, unitCm)} ` +
      `in frame ${count(frameNumber(this.clip, total.frame))}, ${name}. Enter goes to the greatest, n and p to peaks.`
    );
  }
}
