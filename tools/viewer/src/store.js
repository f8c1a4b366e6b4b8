// What the page shows, as one object of values that parts watch. README.md lists the keys.

/** A set of named values; whoever watches one is called when it changes. */
export class Store {
  #values;
  #watchers = new Map();

  constructor(values = {}) {
    this.#values = { ...values };
  }

  get(key) {
    return this.#values[key];
  }

  /** Sets values, then calls those that watch any of them, each once. */
  set(changes) {
    const called = new Set();
    for (const [key, value] of Object.entries(changes)) {
      if (Object.is(this.#values[key], value)) continue;
      this.#values[key] = value;
      for (const watcher of this.#watchers.get(key) ?? []) called.add(watcher);
    }
    for (const watcher of called) watcher(this);
  }

  /**
   * Calls `watcher(store)` now and whenever one of the keys changes.
   *
   * @returns {() => void} ends it
   */
  watch(keys, watcher) {
    for (const key of keys) {
      if (!this.#watchers.has(key)) this.#watchers.set(key, new Set());
      this.#watchers.get(key).add(watcher);
    }
    watcher(this);
    return () => keys.forEach((key) => this.#watchers.get(key).delete(watcher));
  }
}
