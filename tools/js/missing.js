// What is needed and not read yet. Parsers and codecs are synchronous; who reads by ranges lets
// them throw this, gets what is missing, and asks again.

import { Unsupported } from "./errors.js";

/** Something that can be had, but not at once. To a reader that cannot wait it is unsupported. */
export class Missing extends Unsupported {
  /**
   * @param {string} what named in messages
   * @param {() => Promise<void>} load gets it, so that it is there when it is asked for again
   */
  constructor(what, load) {
    super(`${what} is needed and is not read yet`);
    this.load = load;
  }
}

/**
 * Does something synchronous again and again until nothing is missing.
 *
 * @template T
 * @param {() => T} work without effects before it throws
 * @returns {Promise<T>}
 */
export async function supplied(work) {
  for (;;) {
    let missing;
    try {
      return work();
    } catch (error) {
      if (!(error instanceof Missing)) throw error;
      missing = error;
    }
    await missing.load();
  }
}
