// What strips draw on their canvases.

import { count, figure, frameNumber } from "../../ui/text.js";
import { frameAtTime, runsBetweenGaps, timeOf } from "../../ui/times.js";
import { niceStep } from "./window.js";

/** Boundaries of segments, lightly, and frames that are lost, hatched. */
export function paintGround({ context, width, height, from, to, x, colors }, clip) {
  const { segments = [], lost = [] } = clip;
  context.strokeStyle = colors.line;
  context.lineWidth = 1;
  if (segments.length < width / 3 || to - from < clip.nFrames / 10) {
    context.beginPath();
    for (const [start] of segments) {
      if (start <= from || start >= to) continue;
      const at = Math.round(x(start)) + 0.5;
      context.moveTo(at, 0);
      context.lineTo(at, height);
    }
    context.stroke();
  }
  for (const [start, end] of lost) {
    if (end > from && start < to) hatch(context, x(start), Math.max(2, x(end) - x(start)), height, colors.fault);
  }
}

function hatch(context, left, width, height, color) {
  context.save();
  context.beginPath();
  context.rect(left, 0, width, height);
  context.clip();
  context.globalAlpha = 0.16;
  context.fillStyle = color;
  context.fill();
  context.globalAlpha = 0.7;
  context.strokeStyle = color;
  context.beginPath();
  for (let at = Math.max(left - height, -height); at < Math.min(left + width, 8192); at += 6) {
    context.moveTo(at, height);
    context.lineTo(at + height, 0);
  }
  context.stroke();
  context.restore();
}

/** A course: a band from least to greatest where there are more frames than pixels. */
export function paintCourse({ context, x }, course, y, { color, width = 1.25, alpha = 1 }) {
  const { least, most, from, to } = course;
  const n = least.length;
  const step = (to - from) / n;
  // Where a frame has many pixels, its value stands in the middle of them, as the playhead does.
  const shift = step < 1 ? (1 - step) / 2 : 0;
  context.save();
  context.globalAlpha = alpha;
  context.strokeStyle = context.fillStyle = color;
  context.lineWidth = width;
  context.lineJoin = "round";
  context.beginPath();
  let isOpen = false;
  let last = 0;
  // With fewer frames than pixels most columns are empty; they are bridged up to one frame.
  const bridge = Math.max(1, Math.ceil(1 / step));
  for (let i = 0; i < n; i++) {
    if (Number.isNaN(least[i])) continue;
    const at = x(from + (i + 0.5) * step + shift);
    if (isOpen && i - last <= bridge) context.lineTo(at, y(most[i]));
    else context.moveTo(at, y(most[i]));
    if (most[i] !== least[i]) context.lineTo(at, y(least[i]));
    else if (!isOpen || i - last > bridge) context.lineTo(at + 0.5, y(most[i]));
    isOpen = true;
    last = i;
  }
  context.stroke();
  context.restore();
}

/** A line at zero. */
export function paintZero({ context, width, colors }, [least, most], y) {
  if (least >= 0 || most <= 0) return;
  context.strokeStyle = colors.line;
  context.beginPath();
  context.moveTo(0, Math.round(y(0)) + 0.5);
  context.lineTo(width, Math.round(y(0)) + 0.5);
  context.stroke();
}

/** Text on a shade of the ground, so that curves do not cross it. */
export function label(context, text, x, y, colors, color = colors.quiet) {
  context.lineWidth = 3;
  context.strokeStyle = colors.surface;
  context.lineJoin = "round";
  context.strokeText(text, x, y);
  context.fillStyle = color;
  context.fillText(text, x, y);
}

/** Round seconds along the top, with their frames; frames alone where the rate is unknown. */
export function paintRuler(view, clip) {
  const { context, width, height, x, colors } = view;
  context.font = "10px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.strokeStyle = colors.line;
  context.beginPath();
  for (const { frame, text } of rulerMarks(view, clip)) {
    const at = Math.round(x(frame)) + 0.5;
    context.moveTo(at, height - 5);
    context.lineTo(at, height);
    if (at + 4 + context.measureText(text).width > width) continue;
    label(context, text, at + 4, height / 2, colors);
  }
  context.lineWidth = 1;
  context.strokeStyle = colors.quiet;
  context.stroke();
}

const APART = 90; // pixels between two marks, about

/** The marks of the ruler: `{ frame, text }`, frames from <= frame < to; none where frames are missing. */
export function rulerMarks(view, clip) {
  return timeOf(clip, 0) === null ? numberMarks(view, clip) : timeMarks(view, clip);
}

function numberMarks({ from, to, width }, clip) {
  const first = frameNumber(clip, 0);
  const step = Math.max(1, niceStep(to - from, width / APART));
  const marks = [];
  for (let k = Math.ceil((from + first) / step); k * step - first < to; k++) {
    const frame = k * step - first;
    marks.push({ frame, text: numberText(clip, frame) });
  }
  return marks;
}

/** Round seconds, run after run of frames without a gap. */
function timeMarks({ from, to, width }, clip) {
  const usual = clip.times ? clip.step : 1 / clip.rate;
  const step = niceStep((to - from) * usual, width / APART);
  const marks = [];
  for (const [start, end] of runsBetweenGaps(clip, from, to)) {
    const stop = clip.times ? timeOf(clip, end - 1) + usual : timeOf(clip, to);
    for (let k = Math.ceil(timeOf(clip, start) / step - 1e-9); k * step < stop; k++) {
      const frame = frameAtTime(clip, k * step);
      if (frame === null || frame < Math.max(from, start) || !(frame < Math.min(to, end))) continue;
      const text = [`${figure(k * step)} s`, numberText(clip, frame)].filter(Boolean).join(" · ");
      marks.push({ frame, text });
    }
  }
  return marks;
}

/** The number of a frame, "" between two of them. */
function numberText(clip, frame) {
  const isWhole = Math.abs(frame - Math.round(frame)) < 1e-6;
  return isWhole ? count(frameNumber(clip, Math.round(frame))) : "";
}

/** From a value to pixels from the top. */
export function scaleOf([least, most], height, margin = 4) {
  const length = most - least || 1;
  return (value) => height - margin - ((value - least) / length) * (height - 2 * margin);
}
