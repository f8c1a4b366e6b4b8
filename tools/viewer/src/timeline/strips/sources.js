// What can be shown as curves, and where their numbers come from.
//
// A source is { id, name, unit, series: [{ label }], load({ from, to, width }, isOver, onPiece) };
// load gives for each of the series { least, most }, `width` numbers each, or null if it is over.

import { rangeOf } from "./ranges.js";
import { Tracks } from "./tracks.js";

const MOST_POINTS = 4;
const MOST_CURVES = 6;
const MOST_SOURCES = 100;
const AXES = ["x", "y", "z"];

/** The sources of a clip for selected points; speed of one that moves where none is selected. */
export function sourcesOf(engine, clip, selection) {
  const wanted = selection.length ? selection : [clip.lead ?? 0];
  const points = clip.points.length ? wanted.slice(0, MOST_POINTS) : [];
  const sources = [];
  if (points.length) {
    const tracks = new Tracks(engine, clip, points);
    sources.push(speed(clip, tracks), ...points.map((point) => position(engine, clip, point)));
  }
  const signals = (clip.signals ?? []).map((signal, index) => ({ signal, index }));
  signals.sort((a, b) => isDull(a.signal) - isDull(b.signal)); // others keep their order
  for (const { signal, index } of signals) {
    const all = index === 0 ? ofJoints(clip, points) : signal.channels.map((_, column) => column);
    const groups = grouped(all, ({ unit }) => unit, signal.channels);
    for (const columns of groups) {
      sources.push(ofSignal(engine, clip, { signal, index, columns, isAll: groups.length === 1 }));
      if (sources.length > MOST_SOURCES) return sources;
    }
  }
  return sources;
}

/** What a camera system says of its markers comes after what was measured. */
const isDull = ({ name }) => /^residuals?$/i.test(name);

/** Columns that follow each other and have the same unit, at most `MOST_CURVES` together. */
function grouped(columns, keyOf, channels) {
  const groups = [];
  for (const column of columns) {
    const last = groups.at(-1);
    const isLike = last && keyOf(channels[last[0]]) === keyOf(channels[column]);
    if (isLike && last.length < MOST_CURVES) last.push(column);
    else groups.push([column]);
  }
  return groups;
}

/** Columns of the channels that the joints of these points have; of none those of the first. */
function ofJoints(clip, points) {
  const { channels } = clip.signals[0];
  const joints = new Set(points.map((point) => clip.points[point].joint));
  const columns = channels.map((_, column) => column);
  return joints.size ? columns.filter((column) => joints.has(channels[column].joint)) : columns;
}

function ofSignal(engine, clip, { signal, index, columns, isAll }) {
  const labels = columns.map((column) => channelName(clip, signal.channels[column], index));
  const range = isAll ? "" : `: ${labels[0]}${labels.length > 1 ? " …" : ""}`;
  return {
    id: `signal ${index} ${columns.join(",")}`,
    // Where nothing has a place, channels are all there is, and each strip is chosen by itself.
    kind: index === 0 && clip.points.length > 0 ? "channels" : "analog",
    name: index === 0 ? `Channels${range}` : `${signal.name}${range}`,
    unit: same(columns.map((column) => signal.channels[column].unit)),
    series: columns.map((column, k) => ({ label: labels[k], signal: index, column })),
    perFrame: signal.samplesPerFrame,
    load: (window) => loaded(engine, clip, { columns, signal: index, ...window }),
  };
}

function channelName(clip, { name, joint }, index) {
  const of = index === 0 && Number.isInteger(joint) ? clip.joints?.[joint]?.name : null;
  return of && !name.includes(of) ? `${of} ${name}` : name;
}

const same = (units) => (units.every((unit) => unit === units[0]) ? String(units[0] ?? "") : "");

function position(engine, clip, point) {
  const { name } = clip.points[point];
  const columns = [0, 1, 2].map((axis) => 3 * point + axis);
  return {
    id: `position ${point}`,
    kind: "position",
    name: `Position of ${name}`,
    unit: clip.unitCm ? "cm" : "units",
    series: columns.map((column, axis) => ({ label: AXES[axis], signal: "positions", column })),
    perFrame: 1,
    async load(window) {
      const ranges = await loaded(engine, clip, { columns, signal: "positions", ...window });
      return ranges.map((range) => scaled(range, clip.unitCm ?? 1));
    },
  };
}

function speed(clip, tracks) {
  const names = tracks.points.map((point) => clip.points[point].name);
  const factor = (clip.unitCm ?? 100) / 100;
  return {
    id: `speed ${tracks.points.join(",")}`,
    kind: "speed",
    name: `Speed${names.length === 1 ? ` of ${names[0]}` : ""}`,
    unit: `${clip.unitCm ? "m" : "units"}/${clip.rate ? "s" : "frame"}`,
    series: names.map((label) => ({ label })),
    perFrame: 1,
    async load({ from, to, width }, isOver, onPiece) {
      const now = () =>
        tracks.points.map((_, k) => rangeOf((f) => tracks.speed(k, f) * factor, { from, to, width }));
      const isAll = await tracks.fetch(from, to, { isOver, onPiece: () => onPiece(now()) });
      return isAll ? now() : null;
    },
  };
}

async function loaded(engine, clip, wanted) {
  const { least, most, width } = await engine.curves(clip, wanted);
  return wanted.columns.map((_, k) => ({
    least: least.subarray(k * width, (k + 1) * width),
    most: most.subarray(k * width, (k + 1) * width),
  }));
}

const scaled = ({ least, most }, factor) => ({
  least: least.map((x) => x * factor),
  most: most.map((x) => x * factor),
});

/** Mean and greatest distance to the compared clip, in mm where units are known. */
export function errorSource(errors) {
  const factor = errors.unit === "cm" ? 10 : 1;
  const of = (values) => (window) => rangeOf((f) => (f < values.length ? values[f] * factor : NaN), window);
  const [max, mean] = [of(errors.max), of(errors.mean)];
  return {
    id: "error",
    kind: "error",
    name: "Error",
    unit: errors.unit === "cm" ? "mm" : "units",
    factor,
    series: [{ label: "max" }, { label: "mean" }],
    perFrame: 1,
    load: async (window) => [max(window), mean(window)],
  };
}
