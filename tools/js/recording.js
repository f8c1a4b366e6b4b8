// What the source of a clip says of a recording beside its numbers: of a C3D its events, the names
// and units of points and analog channels, and what analog words mean. All of it lies in the
// template of the source; no frame is decoded for it.

import { Order, decodedTexts, findParameters, trimmed } from "./c3d-parameters.js";
import { c3dLayout } from "./source-c3d.js";

const KEY = 12345; // says that labels of events in the header have four characters
const WORD_OF_KEY = 298;
const WORD_OF_COUNT = 300;
const TIMES_AT = 304;
const LABELS_AT = 396;
const RATE_AT = 20; // where a header has the frame rate
const SAME_RATE = 1e-5; // relative: frame rates that differ by less are one
const MOST_EVENTS = 18; // in a header
const LABEL_SIZE = 4;
const TURN_WORDS = 17; // of a rotation

/** The lists of outputs, and the parameters of their units. */
const UNITS_OF = {
  ANGLES: "ANGLE_UNITS",
  FORCES: "FORCE_UNITS",
  MOMENTS: "MOMENT_UNITS",
  POWERS: "POWER_UNITS",
  SCALARS: "SCALAR_UNITS",
};

/**
 * @typedef {object} Event
 * @property {string} label
 * @property {number} time in seconds, as the file says it: frame number 1 is at 0
 * @property {string} context the side or sort: "Left", "Right", "General"; "" while unknown
 * @property {string} subject
 * @property {string} description
 */

/**
 * @typedef {object} Recording
 * @property {number} firstFrame number of the first frame of the source
 * @property {string} unit of coordinates; "" while unknown
 * @property {{name: string, description: string, unit: string, groups: string[]}[]} points in file
 *   order; `groups` the lists of outputs that have it, none for a point
 * @property {{name: string, description: string, unit: string, offset: number, scale: number}[]}
 *   analog a value is (word - offset) * scale * generalScale
 * @property {number} generalScale
 * @property {number | null} analogRate samples a second
 * @property {Event[]} events
 */

/**
 * The recording that the source of a clip tells of.
 *
 * @param {{format: number, template: {data: Uint8Array}, detail: Uint8Array}} source of CLIP, a C3D
 * @param {number | null} rate of the clip, which corrects that of the source
 * @returns {Recording}
 * @throws {import("./errors.js").Refused}
 */
export function c3dRecording(source, rate = null) {
  const { template, detail, head } = c3dLayout(source);
  const order = new Order(template.processor);
  const { points, channels, subframes, word, rotations, ratio, gap } = template;
  const frame = word * (4 * points + channels * subframes);
  const turns = 4 * TURN_WORDS * rotations * ratio;
  const tailAt = head.length + gap.length + detail.nFrames * (frame + turns);
  const tail = new Uint8Array(template.tail.length + detail.tail.length);
  tail.set(template.tail);
  tail.set(detail.tail, template.tail.length);
  const parameters = findParameters(head, tail, tailAt, order);
  const corrected = correction(parameters, head, order, rate);
  const events = eventsOf(parameters, head);
  const analogRate = parameters.number("ANALOG", "RATE");
  return {
    firstFrame: detail.first,
    unit: parameters.text("POINT", "UNITS"),
    points: pointsOf(parameters, points),
    analog: analogOf(parameters, channels),
    generalScale: parameters.numbers("ANALOG", "GEN_SCALE")[0] ?? 1,
    analogRate: analogRate && analogRate / corrected,
    events: events.map((event) => ({ ...event, time: event.time * corrected })),
  };
}

/** By what times are multiplied where the rate of the clip corrects that of the source. */
function correction(parameters, head, order, rate) {
  const stated = parameters.number("POINT", "RATE") || order.float(head, RATE_AT);
  if (!rate || !(stated >= 1e-6 && stated <= 1e9)) return 1;
  return Math.abs(stated / rate - 1) <= SAME_RATE ? 1 : stated / rate;
}

/**
 * What analog words mean.
 *
 * @param {Recording} recording
 * @param {Float64Array | BigInt64Array} words rows x channels
 * @returns {Float64Array} in the units of the channels
 */
export function analogValues({ analog, generalScale }, words) {
  const out = new Float64Array(words.length);
  const n = analog.length;
  for (let i = 0; i < words.length; i++) {
    const { offset, scale } = analog[i % n];
    out[i] = (Number(words[i]) - offset) * scale * generalScale;
  }
  return out;
}

function pointsOf(parameters, n) {
  const labels = parameters.texts("POINT", "LABELS").slice(0, n);
  const keys = labels.map((label) => label.join());
  const groups = new Map();
  for (const group of Object.keys(UNITS_OF)) {
    for (const key of new Set(parameters.texts("POINT", group).map((label) => label.join()))) {
      if (key !== "") groups.set(key, [...(groups.get(key) ?? []), group]);
    }
  }
  const names = namesOf(decodedTexts(labels), n, "point");
  const descriptions = decodedTexts(parameters.texts("POINT", "DESCRIPTIONS"));
  const unit = parameters.text("POINT", "UNITS");
  return names.map((name, i) => {
    const own = groups.get(keys[i]) ?? [];
    const units = new Set(own.map((group) => parameters.text("POINT", UNITS_OF[group])));
    const ofOutput = units.size === 1 ? [...units][0] : "";
    const description = descriptions[i] ?? "";
    return { name, description, unit: own.length > 0 ? ofOutput : unit, groups: own };
  });
}

function analogOf(parameters, n) {
  const column = (name) => decodedTexts(parameters.texts("ANALOG", name));
  const names = namesOf(column("LABELS"), n, "channel");
  const [descriptions, units] = [column("DESCRIPTIONS"), column("UNITS")];
  const format = column("FORMAT")[0] ?? "";
  const isUnsigned = format.toUpperCase() === "UNSIGNED";
  const offsets = parameters.numbers("ANALOG", "OFFSET");
  const scales = parameters.numbers("ANALOG", "SCALE");
  return names.map((name, i) => ({
    name,
    description: descriptions[i] ?? "",
    unit: units[i] ?? "",
    offset: offsetOf(offsets[i] ?? 0, isUnsigned),
    scale: scales[i] ?? 1,
  }));
}

/** As the words, an offset has no sign where they have none; -32768 is 32768 always. */
function offsetOf(number, isUnsigned) {
  return number < 0 && (isUnsigned || number === -0x8000) ? number + 0x10000 : number;
}

function namesOf(labels, n, what) {
  return Array.from({ length: n }, (_, i) => labels[i] || `${what} ${i + 1}`);
}

/** The events of the group EVENT, else those of the header. */
function eventsOf(parameters, head) {
  let times = parameters.numbers("EVENT", "TIMES");
  const dims = parameters.get("EVENT", "TIMES")?.dims ?? [];
  if (dims.length > 1 && dims[0] === 2) {
    // Minutes and seconds; some files hold seconds alone.
    const pairs = times;
    const seconds = (i) => 60 * pairs[2 * i] + pairs[2 * i + 1];
    times = Array.from({ length: pairs.length >> 1 }, (_, i) => seconds(i));
  }
  times = times.slice(0, parameters.count("EVENT", "USED") ?? times.length);
  if (times.length === 0) return eventsOfHeader(parameters.order, head);
  const column = (name) => decodedTexts(parameters.texts("EVENT", name));
  const [labels, contexts] = [column("LABELS"), column("CONTEXTS")];
  const [subjects, descriptions] = [column("SUBJECTS"), column("DESCRIPTIONS")];
  return times.map((time, i) => ({
    label: labels[i] ?? "",
    time,
    context: contexts[i] ?? "",
    subject: subjects[i] ?? "",
    description: descriptions[i] ?? "",
  }));
}

function eventsOfHeader(order, head) {
  if (order.word(head, WORD_OF_KEY) !== KEY) return [];
  const n = Math.min(order.word(head, WORD_OF_COUNT), MOST_EVENTS);
  const at = (i) => LABELS_AT + LABEL_SIZE * i;
  const parts = Array.from({ length: n }, (_, i) => head.subarray(at(i), at(i) + LABEL_SIZE));
  return decodedTexts(parts.map(trimmed)).map((label, i) => {
    const time = order.float(head, TIMES_AT + 4 * i);
    return { label, time, context: "", subject: "", description: "" };
  });
}
