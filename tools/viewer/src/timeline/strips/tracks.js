// Where a few points are in frames of a clip: fetched in pieces, and kept.

import { isGapAfter, timeOf } from "../../ui/times.js";

const PIECE = 1024; // frames
const MOST_PIECES = 512;

/** x, y, z of chosen points of a clip, by frame. */
export class Tracks {
  #pieces = new Map();

  constructor(engine, clip, points) {
    Object.assign(this, { engine, clip, points });
  }

  /** x, y, z of the k-th point in a frame into `out`; NaN where it is not known yet, or missing. */
  at(k, frame, out) {
    const piece = this.#pieces.get(Math.floor(frame / PIECE));
    const at = ((frame % PIECE) * this.points.length + k) * 3;
    for (let i = 0; i < 3; i++) out[i] = piece ? piece[at + i] : NaN;
    return out;
  }

  /**
   * Units a second of the k-th point, of a frame and the one before, or behind where frames are missing
   * before it; a frame lasts 1 where no time is known.
   */
  speed(k, frame) {
    const { clip } = this;
    const isFirst = frame === 0 || isGapAfter(clip, frame - 1);
    if (isFirst && isGapAfter(clip, frame)) return NaN;
    const other = isFirst ? frame + 1 : frame - 1;
    const [a, b] = [this.at(k, frame, A), this.at(k, other, B)];
    const seconds = clip.times ? Math.abs(timeOf(clip, frame) - timeOf(clip, other)) : 1 / (clip.rate ?? 1);
    return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / seconds;
  }

  /**
   * Fetches what some frames need; `isOver()` ends it, `onPiece()` is called now and then.
   *
   * @returns {Promise<boolean>} whether all of it is here; false where it is too much
   */
  async fetch(from, to, { isOver = () => false, onPiece = () => {} } = {}) {
    const first = Math.floor(Math.max(0, from - 1) / PIECE);
    const last = Math.floor((to - 1) / PIECE);
    if (last - first >= MOST_PIECES) return false;
    let nNew = 0;
    for (let piece = first; piece <= last; piece++) {
      if (this.#pieces.has(piece)) continue;
      const start = piece * PIECE;
      const end = Math.min(this.clip.nFrames, start + PIECE);
      const places = await this.engine.positions(this.clip, start, end);
      this.#keep(piece, places, end - start);
      if (isOver()) return false;
      if (++nNew % 8 === 0) onPiece();
    }
    return true;
  }

  #keep(piece, places, nFrames) {
    const n = this.points.length;
    const size = this.clip.points.length * 3;
    const kept = new Float32Array(nFrames * n * 3);
    for (let f = 0; f < nFrames; f++) {
      for (let k = 0; k < n; k++) {
        const at = f * size + this.points[k] * 3;
        for (let i = 0; i < 3; i++) kept[(f * n + k) * 3 + i] = places[at + i];
      }
    }
    this.#pieces.set(piece, kept);
    if (this.#pieces.size > MOST_PIECES) this.#pieces.delete(this.#pieces.keys().next().value);
  }
}

const A = new Float64Array(3);
const B = new Float64Array(3);
