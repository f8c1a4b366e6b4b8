// The places of a clip's points, in blocks that the page holds: at once where a block is there,
// later where it has to be asked for.

import { Lru } from "./lru.js";

const BLOCK_BYTES = 128 * 1024;
const HELD = 96 * 2 ** 20; // bytes
const MOST_ASKED = 2; // blocks at a time: what is wanted may change before they come
const AHEAD = 3; // blocks

export class Poses {
  #engine;
  #blocks = new Lru(HELD);
  #asked = new Set();
  #wanted = [];
  #failed = new Set();

  /** @param {() => void} onArrival called when another block is there */
  constructor(engine, clip, onArrival) {
    this.#engine = engine;
    this.clip = clip;
    this.onArrival = onArrival;
    this.stride = clip.points.length * 3;
    const size = Math.floor(BLOCK_BYTES / 4 / Math.max(1, this.stride));
    this.blockFrames = Math.max(8, Math.min(256, 2 ** Math.floor(Math.log2(Math.max(1, size)))));
    this.fault = null;
  }

  /**
   * The places in a frame, and those in frames after it are fetched.
   *
   * @param {number} frame an integer
   * @param {number} [ahead] blocks that are wanted after it (before it if negative)
   * @returns {Float32Array | null} x, y, z of each point; null where they are not there yet
   */
  at(frame, ahead = 1) {
    const block = Math.floor(frame / this.blockFrames);
    this.#want(block, ahead);
    return this.held(frame);
  }

  /** As `at`, but nothing is fetched. */
  held(frame) {
    const places = this.#blocks.get(Math.floor(frame / this.blockFrames));
    if (places === undefined) return null;
    const start = (frame % this.blockFrames) * this.stride;
    return places.subarray(start, start + this.stride);
  }

  /** Resolves to the places in a frame. */
  async get(frame) {
    const there = this.held(frame);
    if (there !== null) return there;
    await this.#fetch(Math.floor(frame / this.blockFrames));
    return this.held(frame);
  }

  close() {
    this.#wanted = [];
    this.onArrival = () => {};
  }

  #want(block, ahead) {
    const last = Math.floor((this.clip.nFrames - 1) / this.blockFrames);
    const step = Math.sign(ahead) || 1;
    const blocks = [block];
    for (let i = 1; i <= Math.min(AHEAD, Math.abs(ahead)); i++) blocks.push(block + i * step);
    this.#wanted = blocks.filter((b) => b >= 0 && b <= last && this.#isDue(b));
    this.#ask();
  }

  #isDue(block) {
    return !this.#blocks.has(block) && !this.#asked.has(block) && !this.#failed.has(block);
  }

  #ask() {
    while (this.#asked.size < MOST_ASKED && this.#wanted.length > 0) {
      const block = this.#wanted.shift();
      if (this.#isDue(block)) this.#fetch(block);
    }
  }

  async #fetch(block) {
    const from = block * this.blockFrames;
    const to = Math.min(this.clip.nFrames, from + this.blockFrames);
    this.#asked.add(block);
    try {
      const places = await this.#engine.positions(this.clip, from, to);
      this.#blocks.set(block, places, places.byteLength);
    } catch (error) {
      this.fault = error;
      this.#failed.add(block);
    }
    this.#asked.delete(block);
    this.onArrival();
    this.#ask();
  }
}
