// Colors that also people see apart who do not see all colors (Okabe and Ito), light and dark.

const LIGHT = {
  left: "#0072b2",
  right: "#d55e00",
  center: "#59636e",
  ghost: "#8b5cc4",
  chosen: "#c2187a",
  gone: "#c3c9cf",
  skyTop: "#dfe7ef",
  skyLow: "#fbfcfd",
  ground: "#eef1f4",
  grid: "#7d8a97",
  shadow: 0.42,
  ambient: 1.75,
  sun: 2.1,
};

const DARK = {
  left: "#4fb0ea",
  right: "#f2923c",
  center: "#b4bec8",
  ghost: "#bb96f0",
  chosen: "#ff7fc4",
  gone: "#4a525b",
  skyTop: "#0f1318",
  skyLow: "#222a33",
  ground: "#1a2027",
  grid: "#7f8e9d",
  shadow: 0.6,
  ambient: 1.35,
  sun: 2.0,
};

export function themeOf(isDark) {
  return isDark ? DARK : LIGHT;
}

/** From little to much, as "viridis" turned round at the end so that much is warm: cividis to red. */
const SCALE = [
  [0x2b, 0x5c, 0x9e],
  [0x3d, 0x9d, 0xb3],
  [0xa6, 0xc9, 0x6a],
  [0xf2, 0xc1, 0x4e],
  [0xe6, 0x6b, 0x32],
  [0xb5, 0x17, 0x2f],
];

/**
 * A color of the scale.
 *
 * @param {number} part 0 to 1
 * @returns {number[]} red, green, blue, 0 to 1
 */
export function scaleColor(part, out = [0, 0, 0]) {
  const at = Math.max(0, Math.min(1, part || 0)) * (SCALE.length - 1);
  const low = Math.min(SCALE.length - 2, Math.floor(at));
  for (let k = 0; k < 3; k++) {
    out[k] = (SCALE[low][k] + (SCALE[low + 1][k] - SCALE[low][k]) * (at - low)) / 255;
  }
  return out;
}

/** The same for CSS, from left to right. */
export function scaleGradient() {
  return `linear-gradient(to right, ${SCALE.map((color) => `rgb(${color.join(" ")})`).join(", ")})`;
}

/** The next round number that is not less: 1, 2 or 5 times a power of ten. */
export function roundUp(value) {
  if (!(value > 0) || !Number.isFinite(value)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  const step = [1, 2, 5, 10].find((times) => times * power >= value * (1 - 1e-9));
  return Number((step * power).toPrecision(6));
}
