// What is wrong with a damaged file, in words, with the clips and frames that it is about.

import { lostFrames, storedFrames } from "./losses.js";

/**
 * @typedef {object} Loss
 * @property {string} text
 * @property {string | null} clip name of the clip that it is about
 * @property {string | null} signal
 * @property {[number, number] | null} frames a <= f < b of the clip that are lost
 * @property {[number, number] | null} bytes of the file
 */

export class Damage {
  constructor() {
    /** @type {Loss[]} */
    this.losses = [];
    this.orphans = null; // a run of segments whose clip is lost
  }

  add(text, { clip = null, signal = null, frames = null, bytes = null } = {}) {
    this.flush();
    this.losses.push({ text, clip, signal, frames, bytes });
  }

  /** A fault in the bytes from `start` up to `stop`, in a clip or in none. */
  fault(message, start, stop, clip) {
    const where = stop > start ? `bytes ${start} to ${stop}` : `byte ${start}`;
    this.add(`${where}: ${message}`, { clip: clip?.name ?? null, bytes: [start, stop] });
  }

  /** A segment whose clip is lost, perhaps with its name; those in a row are told together. */
  orphan(start, stop, clip) {
    if (this.orphans === null || this.orphans.clip !== clip) {
      this.flush();
      this.orphans = { clip, start, stop, n: 0 };
    }
    this.orphans.stop = stop;
    this.orphans.n++;
  }

  flush() {
    if (this.orphans === null) return;
    const { clip, start, stop, n } = this.orphans;
    this.orphans = null;
    const of = clip === null ? "a clip that is lost" : `clip ${clip}, which is lost`;
    this.add(`bytes ${start} to ${stop}: ${n} segments of ${of}`, { clip, bytes: [start, stop] });
  }

  /** A clip that ended without CEND. */
  noEnd({ name, nFrames, declared, open }) {
    const of = open ? "" : ` of ${declared}`;
    this.add(`clip ${name} has no end: ${nFrames}${of} frames are there`, { clip: name });
  }

  /** The frames that a clip has lost. */
  ofClip(clip) {
    for (const signal of clip.signals) {
      const stored = storedFrames(clip, signal.skip + signal.spare, clip.end !== null);
      for (const [a, b] of lostFrames(signal.segments, stored)) {
        const from = Math.max(0, a - signal.skip);
        const to = Math.min(clip.nFrames, b - signal.skip);
        if (from >= to) continue;
        const text = `clip ${clip.name}: frames ${from} to ${to - 1} of ${signal.name} are lost`;
        this.add(text, { clip: clip.name, signal: signal.name, frames: [from, to] });
      }
    }
  }
}
