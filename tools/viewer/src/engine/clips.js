// The clips that are held in the worker: those used last. Others are opened again when they are wanted.

import { OpenClip } from "./clip.js";

const MOST = 4; // what is shown, what is compared, and those before them

export class Clips {
  #held = new Map(); // by key, what was used last at the end
  #opening = new Map();
  #nKeys = 0;

  /** @param {Map<number, object>} files opened ones, by id */
  constructor(files) {
    this.files = files;
  }

  get size() {
    return this.#held.size;
  }

  /** Opens a clip of a file, under a key of its own. */
  open(fileId, index) {
    return this.#open(`${fileId}/${index}/${this.#nKeys++}`);
  }

  /** The clip of a key, opened again where it is not held any more. */
  async get(key) {
    const clip = this.#held.get(key);
    if (clip === undefined) return this.#opening.get(key) ?? this.#open(key);
    this.#keep(key, clip);
    return clip;
  }

  /** Lets go of the clips of a file, which is closed. */
  close(fileId) {
    for (const [key, clip] of this.#held) if (clip.facts.fileId === fileId) this.#held.delete(key);
  }

  #open(key) {
    const opening = this.#opened(key).finally(() => this.#opening.delete(key));
    this.#opening.set(key, opening);
    return opening;
  }

  async #opened(key) {
    const [fileId, index] = key.split("/").map(Number);
    const file = this.files.get(fileId);
    if (file === undefined) throw new Error("this clip is closed");
    const clip = new OpenClip(await file.clip(index), { key, fileId, index });
    await clip.prepare();
    if (this.files.get(fileId) === file) this.#keep(key, clip);
    return clip;
  }

  #keep(key, clip) {
    this.#held.delete(key);
    this.#held.set(key, clip);
    for (const oldest of this.#held.keys()) {
      if (this.#held.size <= MOST) break;
      this.#held.delete(oldest);
    }
  }
}
