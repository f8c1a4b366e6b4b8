// What a slider turns: the codec's own dial, or a target that the writer searches for.

import { figure } from "../ui/text.js";

const TARGETS = new Map([
  ["mean_error_cm", { text: "Mean error, cm", least: 0.001, most: 10, start: 0.1 }],
  ["max_error_cm", { text: "Greatest error, cm", least: 0.01, most: 30, start: 1 }],
  ["kbps", { text: "kbit/s", least: 0.5, most: 2000, start: 20 }],
]);
const WIDE = 100; // times the default, up and down

/** Dials of a codec as api.json lists it: `{ name, text, meaning, least, most, start, valueAt, shareOf }`. */
export function dialsOf(codec, clip) {
  const parameters = new Map((codec.parameters ?? []).map((parameter) => [parameter.name, parameter]));
  const own = codec.dial?.parameter ?? codec.quality;
  const dials = [];
  if (parameters.has(own)) dials.push(ownDial(parameters.get(own), codec.dial ?? {}));
  for (const [name, target] of TARGETS) {
    if (!parameters.has(name)) continue;
    dials.push(logarithmic({ name, ...target, meaning: parameters.get(name).meaning }));
  }
  if (parameters.has("target_bytes") && clip?.bytes) {
    const meaning = parameters.get("target_bytes").meaning;
    const most = Math.max(1000, clip.bytes);
    const range = { least: Math.max(100, Math.round(most / 200)), most, start: Math.round(most / 4) };
    dials.push(logarithmic({ name: "target_bytes", text: "Bytes", meaning, isWhole: true, ...range }));
  }
  return dials;
}

function ownDial({ name, default: usual, meaning }, { low, high, whole }) {
  const isKnown = Number(usual) > 0;
  const start = isKnown ? Number(usual) : 0.2;
  const least = Math.max(low > 0 ? low : 0, start / WIDE, whole ? 1 : 0);
  const most = Math.min(high > 0 ? high : Infinity, start * WIDE);
  return logarithmic({ name, text: name, meaning, least, most, start, isWhole: Boolean(whole) });
}

/** A dial on which equal ways are equal ratios. */
function logarithmic({ least, most, isWhole, ...dial }) {
  const length = Math.log(most / least);
  return {
    ...dial,
    least,
    most,
    valueAt(share) {
      const value = least * Math.exp(share * length);
      return isWhole ? Math.round(value) : Number(figure(value, 3).replaceAll(",", ""));
    },
    shareOf: (value) => Math.max(0, Math.min(1, Math.log(Math.max(value, least) / least) / length)),
  };
}
