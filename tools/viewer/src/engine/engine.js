// The engine as the page sees it: README.md, "The engine". A worker does the work.

import text from "worker:engine/worker.js";

export class Engine {
  #worker;
  #waiting = new Map();
  #nCalls = 0;

  /** Called with a clip and what is wrong with it, when that shows as its frames are decoded. */
  onDamage = () => {};

  constructor() {
    const address = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    this.#worker = new Worker(address);
    this.#worker.addEventListener("message", ({ data }) => this.#answer(data));
    this.#worker.addEventListener("error", (event) =>
      this.#fail(event.message || "the worker ended"),
    );
  }

  setAnnex(tables) {
    return this.#call("setAnnex", [tables]);
  }

  open(where, options) {
    return this.#call("open", [where, options]);
  }

  rows(id, from, to) {
    return this.#call("rows", [id, from, to]);
  }

  clip(id, index) {
    return this.#call("clip", [id, index]);
  }

  positions(clip, from, to) {
    return this.#ofClip(clip, this.#call("positions", [clip.key, from, to]));
  }

  curves(clip, wanted) {
    return this.#ofClip(clip, this.#call("curves", [clip.key, wanted]));
  }

  contacts(clip, wanted) {
    return this.#ofClip(clip, this.#call("contacts", [clip.key, wanted]));
  }

  neighbors(clip) {
    return this.#ofClip(clip, this.#call("neighbors", [clip.key]));
  }

  errors(shown, compared, onProgress) {
    return this.#call("errors", [shown.key, compared.key], onProgress);
  }

  source(clip) {
    return this.#call("source", [clip.key]);
  }

  close(id) {
    return this.#call("close", [id]);
  }

  async #ofClip(clip, call) {
    try {
      return await call;
    } catch (error) {
      if (error.name === "Refused") this.onDamage(clip, error);
      throw error;
    }
  }

  #call(method, args, onProgress = null) {
    return new Promise((resolve, reject) => {
      const id = ++this.#nCalls;
      this.#waiting.set(id, { resolve, reject, onProgress });
      this.#worker.postMessage({ id, method, args });
    });
  }

  #answer({ id, result, error, progress }) {
    const call = this.#waiting.get(id);
    if (call === undefined) return;
    if (progress !== undefined) {
      call.onProgress?.(progress);
      return;
    }
    this.#waiting.delete(id);
    if (error === undefined) call.resolve(result);
    else call.reject(Object.assign(new Error(error.message), { name: error.name }));
  }

  #fail(message) {
    for (const { reject } of this.#waiting.values()) reject(new Error(message));
    this.#waiting.clear();
  }
}
