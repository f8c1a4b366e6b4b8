// The points of a C3D, for pages that nobody serves. Integers or floats of the three byte orders;
// what the file says of itself is believed as docs/reference/readers-binary.md, "C3D",
// believes it, but for files that contradict themselves.

import { Order, findParameters } from "../../../js/c3d-parameters.js";
import { SourceError, clipOf, skeletonOf } from "./lines.js";

const BLOCK = 512;
const MAGIC = 0x50;
const UNITS = { mm: 0.1, cm: 1, m: 100, in: 2.54 };
const AXES = { "+X": 1, X: 1, "+Y": 2, Y: 2, "+Z": 3, Z: 3, "-X": 4, "-Y": 5, "-Z": 6 };
const TX = 1;

/**
 * @param {Uint8Array} bytes
 * @param {string} name of the file
 * @throws {SourceError}
 */
export function readC3d(bytes, name) {
  const file = headOf(bytes);
  const { order, nPoints, nFrames, parameters } = file;
  const labels = parameters.texts("POINT", "LABELS").map((label) => String.fromCharCode(...label));
  const joints = Array.from({ length: nPoints }, (_, i) => ({
    name: labels[i] || `point ${i + 1}`,
    parent: -1,
    offset: [0, 0, 0],
    channels: [0, 1, 2].map((k) => ({ kind: TX + k })),
  }));
  if (joints.length === 0) throw new SourceError("no points");
  const skeleton = skeletonOf({
    intrinsic: false,
    angleUnit: 0,
    unitCm: UNITS[parameters.text("POINT", "UNITS").toLowerCase()] ?? null,
    upAxis: AXES[parameters.text("POINT", "Y_SCREEN").toUpperCase()] ?? 0,
    joints,
  });
  const { values, mask } = pointsOf(bytes, file, nFrames, order);
  const clip = clipOf({
    name: name.replace(/\.[^.]*$/, ""),
    skeleton,
    values,
    mask,
    rate: file.rate,
    format: "c3d",
    path: name,
  });
  const firstTime = file.rate ? (file.first - 1) / file.rate : 0;
  return { ...clip, firstFrame: file.first, clock: { firstTime, times: null } };
}

function headOf(bytes) {
  if (bytes.length < 2 * BLOCK || bytes[1] !== MAGIC)
    throw new SourceError("byte 0: not a C3D file");
  const start = (bytes[0] - 1) * BLOCK;
  const processor = bytes[start + 3];
  if (![84, 85, 86].includes(processor))
    throw new SourceError(`byte ${start + 3}: processor ${processor}`);
  const order = new Order(processor);
  const parameters = findParameters(bytes, new Uint8Array(0), bytes.length, order);
  const scale = parameters.number("POINT", "SCALE") ?? order.float(bytes, 12);
  const dataBlock = parameters.count("POINT", "DATA_START") || order.word(bytes, 16);
  const nPoints = order.word(bytes, 2) || (parameters.count("POINT", "USED") ?? 0);
  const nAnalog = order.word(bytes, 4);
  const size = scale < 0 ? 4 : 2;
  const stride = size * (4 * nPoints + nAnalog);
  const data = (dataBlock - 1) * BLOCK;
  const room = stride > 0 && data > 0 ? Math.max(0, Math.floor((bytes.length - data) / stride)) : 0;
  const first = order.word(bytes, 6);
  const declared = Math.max(
    order.word(bytes, 8) - first + 1,
    parameters.count("POINT", "FRAMES") ?? 0,
    parameters.count("POINT", "LONG_FRAMES") ?? 0,
  );
  const rate = parameters.number("POINT", "RATE") || order.float(bytes, 20);
  return {
    order,
    parameters,
    scale: Math.abs(scale) || 1,
    size,
    stride,
    data,
    nPoints,
    nFrames: declared > room || declared === 0xffff ? room : Math.max(0, declared),
    first: first || 1,
    rate: rate > 0 && rate < 1e5 ? Math.round(rate * 1000) / 1000 : null,
  };
}

function pointsOf(bytes, { size, stride, data, nPoints, scale }, nFrames, order) {
  const values = new Float64Array(nFrames * nPoints * 3);
  const mask = new Uint8Array(values.length);
  const signed = (at) => (order.word(bytes, at) << 16) >> 16;
  let out = 0;
  for (let frame = 0; frame < nFrames; frame++) {
    let at = data + frame * stride;
    for (let point = 0; point < nPoints; point++, at += 4 * size, out += 3) {
      const word = (k) =>
        size === 4 ? order.float(bytes, at + 4 * k) : scale * signed(at + 2 * k);
      const isValid = size === 4 ? order.float(bytes, at + 12) >= 0 : signed(at + 6) >= 0;
      for (let k = 0; k < 3; k++) {
        values[out + k] = word(k);
        mask[out + k] = isValid ? 1 : 0;
      }
    }
  }
  return { values, mask: mask.includes(0) ? mask : null };
}
