// All that is known of the clip that is shown.

import { fileOf } from "./actions.js";
import { choice, facts, fill, make, put } from "../ui/dom.js";
import { runsBetweenGaps, timeOf } from "../ui/times.js";
import { count, counted, duration, figure, lostText, secondsOf, size } from "../ui/text.js";

const AXES = ["x", "y", "z"];
const MOST_ROWS = 200;
const MOST_DEPTH = 4;

export function mountInfo(panel, { store }) {
  const body = make("div");
  const up = choice({
    name: "up",
    legend: "Up axis",
    choices: [["file", "The file's"], ...AXES.map((axis, k) => [String(k), axis])],
    value: "file",
    onChange: (value) => store.set({ up: value === "file" ? null : Number(value) }),
  });
  put(panel, body, up.element);
  store.watch(["up"], () => up.set(store.get("up") === null ? "file" : String(store.get("up"))));
  store.watch(["shown", "files"], () => {
    const clip = store.get("shown");
    up.element.hidden = !clip;
    if (clip) fill(body, sections(clip, fileOf(store, clip)));
    else fill(body, make("p", { class: "quiet" }, "Open a file, or drop one on the page."));
  });
}

function sections(clip, file) {
  return [
    part("Clip", clipFacts(clip)),
    part("Skeleton", skeletonFacts(clip)),
    part("Signals", signalFacts(clip)),
    part("Source", rowsOf(clip.source)),
    part("Quality", rowsOf(clip.quality)),
    part("Metadata", rowsOf(clip.metadata)),
    part("Damage", damageFacts(clip, file)),
    part("File", [
      ["Name", file?.name],
      ["Size", file && size(file.size)],
      ["Clips", file && count(file.nClips)],
    ]),
  ];
}

function part(title, rows) {
  const list = facts(rows);
  return list.childElementCount > 0 && make("section", {}, make("h2", {}, title), list);
}

function clipFacts(clip) {
  const seconds = secondsOf(clip);
  return [
    ["Name", clip.name || "(no name)"],
    ...aliasFacts(clip.aliases ?? []),
    ["Frames", count(clip.nFrames)],
    ["Duration", seconds === null ? "unknown: no frame rate" : duration(seconds)],
    ["Frame rate", clip.rate ? `${figure(clip.rate, 6)} frames/s` : "none"],
    ["First frame", clip.firstFrame ? count(clip.firstFrame) : null],
    ["Time", timeFacts(clip)],
    ["Codec", clip.codec],
    ["Bytes", clip.bytes && size(clip.bytes)],
    ["Segments", clip.segments?.length ? count(clip.segments.length) : null],
    ["Events", clip.events?.length ? count(clip.events.length) : null],
  ];
}

/** "1 s to 3.09 s, 1 gap", where that is more than the duration tells. */
function timeFacts(clip) {
  const first = timeOf(clip, 0);
  if (clip.nFrames === 0 || first === null || (first === 0 && !clip.times)) return null;
  const gaps = runsBetweenGaps(clip, 0, clip.nFrames).length - 1;
  const range = `${figure(first, 6)} s to ${figure(timeOf(clip, clip.nFrames - 1), 6)} s`;
  return gaps ? `${range}, ${counted(gaps, "gap")}` : range;
}

/** Paths of files that are copies of the clip's source. */
function aliasFacts(aliases) {
  const rows = aliases.slice(0, MOST_ROWS).map((name, k) => [k === 0 ? "Also named" : "", name]);
  return aliases.length > MOST_ROWS ? [...rows, ["", `and ${count(aliases.length - MOST_ROWS)} more`]] : rows;
}

function skeletonFacts(clip) {
  const { points, bones, isMarkers, channels, unitCm, upAxis, isDown, upGuess } = clip;
  const n = points.length;
  const lines = counted(bones.length, isMarkers ? "line" : "bone");
  const guess = Number.isInteger(upGuess) ? `; taken as ${AXES[upGuess]}` : "";
  const up = isDown ? `-${AXES[upAxis]}, shown upside down` : AXES[upAxis];
  return [
    ["Name", clip.skeleton],
    ["Joints", clip.joints && count(clip.joints.length)],
    ["Points", isMarkers ? `${counted(n, "marker")}, ${lines}` : `${counted(n, "point")}, ${lines}`],
    ["Channels", Array.isArray(channels) ? count(channels.length) : channels && count(channels)],
    ["Length unit", unitCm ? `${figure(unitCm)} cm` : "not stated in the file"],
    ["Up", up ?? `not stated in the file${guess}`],
  ];
}

function signalFacts({ signals }) {
  return (signals ?? []).slice(0, MOST_ROWS).map((signal) => {
    const n = Array.isArray(signal.channels) ? signal.channels.length : signal.nChannels;
    const rate = signal.samplesPerFrame > 1 ? `, ${signal.samplesPerFrame} a frame` : "";
    const codec = signal.codec ? `, ${signal.codec}` : "";
    return [signal.name, `${n === undefined ? "" : counted(n, "channel")}${rate}${codec}`];
  });
}

function damageFacts(clip, file) {
  const damage = file?.damage;
  const lines = Array.isArray(damage) ? damage : damage ? [damage] : [];
  return [
    ["Clip", lostText(clip, MOST_ROWS) || null],
    ...lines
      .slice(0, MOST_ROWS)
      .map((line) => ["File", typeof line === "object" ? facts(rowsOf(line)) : String(line)]),
  ];
}

/** Rows of any value that is of names and values; of a list its members by number. */
function rowsOf(value, depth = 0) {
  if (value === null || value === undefined) return [];
  if (typeof value !== "object") return [["", described(value)]];
  const entries = value instanceof Map || isPairs(value) ? [...value] : Object.entries(value);
  const rows = entries.slice(0, MOST_ROWS).map(([key, held]) => {
    const name = Array.isArray(value) && !isPairs(value) ? `${Number(key) + 1}` : words(key);
    if (/size$|bytes$/i.test(key) && Number.isSafeInteger(held)) return [name, size(held)];
    if (held === null || typeof held !== "object") return [name, described(held)];
    if (ArrayBuffer.isView(held)) return [name, `${counted(held.length, "number")}`];
    if (Array.isArray(held) && held.every((x) => x === null || typeof x !== "object")) {
      return [name, held.slice(0, MOST_ROWS).map(described).join(", ")];
    }
    return [name, depth < MOST_DEPTH ? facts(rowsOf(held, depth + 1)) : "…"];
  });
  if (entries.length > MOST_ROWS) rows.push(["", `and ${count(entries.length - MOST_ROWS)} more`]);
  return rows;
}

const isPairs = (value) =>
  Array.isArray(value) &&
  value.length > 0 &&
  value.every((pair) => Array.isArray(pair) && pair.length === 2 && typeof pair[0] === "string");

const described = (value) =>
  typeof value === "number"
    ? figure(value, 6)
    : typeof value === "boolean"
      ? value
        ? "yes"
        : "no"
      : value === null || value === undefined
        ? "–"
        : String(value);

/** "meanErrorCm" and "mean_error_cm" as "mean error cm". */
const words = (key) =>
  String(key)
    .slice(0, 400)
    .replace(/([a-z])([A-Z])/g, (_, a, b) => `${a} ${b.toLowerCase()}`)
    .replaceAll("_", " ");
