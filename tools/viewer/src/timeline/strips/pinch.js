// Two fingers on the strips, on one or on two of them: each stays on its frame, and the window follows.

import { pinched } from "./window.js";

export class Pinch {
  #fingers = new Map(); // x of each, by the id of its pointer
  #frames = null; // below the two fingers as both came
  #taken = new Set(); // fingers that were one of two: they do nothing else until they go

  /** A finger comes; `frameAt(x)` gives the frame of a place. */
  press(id, x, frameAt) {
    this.#fingers.set(id, x);
    const isPair = this.#fingers.size === 2; // with more nothing is meant that we know
    this.#frames = isPair ? [...this.#fingers.values()].map(frameAt) : null;
    if (this.#fingers.size > 1) this.#taken = new Set(this.#fingers.keys());
  }

  /** Whether a finger zooms, or did so. */
  has(id) {
    return this.#taken.has(id);
  }

  /** A finger moves; the window that follows, or null. */
  move(id, x, width, nFrames) {
    if (!this.#fingers.has(id)) return null;
    this.#fingers.set(id, x);
    if (this.#frames === null) return null;
    return pinched(this.#frames, [...this.#fingers.values()], width, nFrames);
  }

  release(id) {
    this.#fingers.delete(id);
    this.#taken.delete(id);
    this.#frames = null;
  }
}
