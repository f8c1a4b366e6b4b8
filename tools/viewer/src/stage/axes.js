// From the axes and units of a file to those of the picture: y up, z to the viewer, and a figure of
// usual size. All turns are cyclic, so that left stays left.

/** Axes of a file that become x, y and z, by the one that points up (0 x, 1 y, 2 z). */
const ORDERS = [
  [2, 0, 1],
  [0, 1, 2],
  [1, 2, 0],
];

export const FIGURE = 1.7; // units of the picture that a figure is high

/** The axis that points up: chosen by hand, or the file's, or guessed. */
export function upOf(clip, chosen) {
  return chosen ?? clip.upAxis ?? clip.upGuess ?? 1;
}

/** How the places of a clip become places of the picture. */
export class Axes {
  constructor(up, scale) {
    this.up = up;
    this.scale = scale;
    this.order = ORDERS[up];
  }

  /**
   * @param {ArrayLike<number>} places x, y, z of each point, in units of the file
   * @param {Float32Array} out the same of the picture
   */
  apply(places, out) {
    const { scale } = this;
    const [a, b, c] = this.order;
    for (let k = 0; k < out.length; k += 3) {
      out[k] = places[k + a] * scale;
      out[k + 1] = places[k + b] * scale;
      out[k + 2] = places[k + c] * scale;
    }
    return out;
  }
}

/**
 * The places between two frames.
 *
 * @param {number} part 0 at the first, 1 at the second
 */
export function between(first, second, part, out) {
  for (let k = 0; k < out.length; k++) {
    const x = first[k];
    const y = second[k];
    out[k] = Number.isNaN(y) ? x : x + (y - x) * part;
  }
  return out;
}
