// SPEC.md, "Registry" and the table of "Codecs".

import { Refused, Unsupported } from "./errors.js";

/** Roles of signals. */
export const MOTION = 1;
export const TIMES = 2;
export const RESIDUALS = 3;
export const ANALOG = 4;
export const OUTPUTS = 5;
export const ROTATIONS = 6;

/** Whether a channel is a plain scalar: of kind 0 or of one beyond the registry. */
export const isScalar = ({ kind }) => kind === 0 || kind > 17; // SKEL-07

/** The units of times, and how many of them are a second. */
export const TIMES_PER_SECOND = new Map([["s", 1], ["ms", 1e3], ["us", 1e6], ["ns", 1e9]]);

/** Source formats: what each is a source of, and the kind of its template. */
const SOURCE_FORMATS = new Map([
  [1, { name: "asf", of: "skeleton", kind: "text" }],
  [2, { name: "amc", of: "clip", kind: "text" }],
  [3, { name: "bvh", of: "clip", kind: "text" }],
  [4, { name: "c3d", of: "clip", kind: "c3d" }],
  [5, { name: "c3d-outputs", of: "clip", kind: "c3d" }],
  [6, { name: "trc", of: "clip", kind: "table" }],
  [7, { name: "mot", of: "clip", kind: "table" }],
  [8, { name: "sto", of: "clip", kind: "table" }],
  [9, { name: "motive", of: "clip", kind: "table" }],
  [10, { name: "vicon", of: "clip", kind: "table" }],
  [11, { name: "csv", of: "clip", kind: "table" }],
  [12, { name: "npy", of: "clip", kind: "arrays" }],
  [13, { name: "npz", of: "clip", kind: "arrays" }],
  [14, { name: "pickle", of: "clip", kind: "arrays" }],
  [16, { name: "mvnx", of: "clip", kind: "table" }],
  [17, { name: "torch", of: "clip", kind: "arrays" }],
]);

/** Names of the source formats that this decoder restores. */
export const SOURCE_FORMAT_NAMES = [...SOURCE_FORMATS.values()].map((format) => format.name);

/**
 * Checks a statement about a source: its format is that of its SRCE, and a source of such a thing.
 * A format that this decoder does not know may be anything; it is unsupported when it is restored.
 *
 * @param {number} format as stated
 * @param {{format: number}} template the SRCE
 * @param {"clip" | "skeleton"} of
 * @param {string} what named in messages
 * @throws {Refused}
 */
export function checkSourceFormat(format, template, of, what) {
  const isRead = template.format !== null; // who reads by ranges checks the others later
  if (isRead && format !== template.format) {
    throw new Refused(`${what}: source format ${format}, that of its SRCE is ${template.format}`);
  }
  const known = SOURCE_FORMATS.get(format);
  if (known && known.of !== of) {
    throw new Refused(`${what}: ${known.name} is no source of a ${of}`);
  }
}

/** The name of a source format, or its id where this decoder does not know it. */
export function sourceFormatLabel(format) {
  return SOURCE_FORMATS.get(format)?.name ?? `format ${format}`;
}

/** Whether a source format, given by its id, is one of C3D files. */
export const isC3d = (format) => SOURCE_FORMATS.get(format)?.kind === "c3d";

/**
 * @param {number} format id of a source format
 * @returns {"text" | "c3d" | "table" | "arrays"} the kind of its template
 * @throws {Unsupported} where it is not known
 */
export function sourceKind(format) {
  if (!SOURCE_FORMATS.has(format)) throw new Unsupported(`source format ${format}`);
  return SOURCE_FORMATS.get(format).kind;
}
