// Which feet stand in a frame, asked for before it is drawn: a picture never waits for it.

const AROUND = 4000; // frames before and after, of a clip that is too long to be looked at as a whole

/** The contacts of a clip around the frame that is shown. */
export class Standing {
  #found = null;
  #asked = null; // what was asked for last

  /** @param {() => void} onArrival called when they have come */
  constructor(engine, clip, onArrival) {
    Object.assign(this, { engine, clip, onArrival });
  }

  /** @returns {{point: number, side: string}[]} feet that stand; none while that is not known */
  at(frame, up) {
    const { nFrames } = this.clip;
    const at = Math.max(0, Math.min(nFrames - 1, Math.floor(frame)));
    const about = Math.round(at / AROUND) * AROUND;
    const isThere = this.#found?.up === up && at >= this.#found.from && at < this.#found.to;
    if (!isThere) this.#ask({ up, from: Math.max(0, about - AROUND), to: Math.min(nFrames, about + AROUND) });
    if (!isThere) return [];
    return this.#found.feet.filter(({ runs }) => runs.some(([a, b]) => at >= a && at < b));
  }

  async #ask(wanted) {
    const key = `${wanted.up} ${wanted.from}`;
    if (this.#asked === key) return;
    this.#asked = key;
    try {
      const found = await this.engine.contacts(this.clip, wanted);
      if (this.#asked !== key) return;
      this.#found = { ...found, up: wanted.up };
      this.onArrival();
    } catch {
      // What is wrong with the clip is told where its frames are shown.
    }
  }
}
