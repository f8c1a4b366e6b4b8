// Time while a clip plays: frames are left out where drawing is slow, time is not.

export const USUAL_RATE = 120; // frames a second, where a clip does not say

/** Frames a second that a clip plays with. */
export function rateOf(clip) {
  return clip?.rate > 0 && Number.isFinite(clip.rate) ? clip.rate : USUAL_RATE;
}

/**
 * The frame that is due.
 *
 * @param {{frame: number, time: number}} begun where playing began, and when (ms)
 * @param {number} now ms
 * @param {{rate: number, speed: number, nFrames: number, loop: boolean}} how
 * @returns {{frame: number, ended: boolean}}
 */
export function frameAt(begun, now, { rate, speed, nFrames, loop }) {
  const last = Math.max(0, nFrames - 1);
  const frame = begun.frame + (Math.max(0, now - begun.time) / 1000) * rate * speed;
  if (frame <= last) return { frame, ended: false };
  if (!loop || last === 0) return { frame: last, ended: true };
  return { frame: frame % nFrames > last ? last : frame % nFrames, ended: false };
}

/** Plays what is shown as long as the store says so. */
export class Clock {
  #store;
  #begun = null;
  #set = null; // the frame that the clock itself has set

  constructor(store) {
    this.#store = store;
    store.watch(["playing"], () => this.#start());
    store.watch(["speed", "loop", "shown"], () => this.#restart());
  }

  #start() {
    const { playing, frame, shown } = this.#values();
    if (!playing) {
      this.#begun = null;
      if (!Number.isInteger(frame)) this.#store.set({ frame: Math.floor(frame) });
      return;
    }
    const isAtEnd = shown !== null && frame >= shown.nFrames - 1;
    if (isAtEnd) this.#store.set({ frame: 0 });
    this.#restart();
    requestAnimationFrame((now) => this.#step(now));
  }

  #restart() {
    const { frame, playing } = this.#values();
    if (!playing) return;
    this.#set = frame;
    this.#begun = { frame, time: performance.now() };
  }

  #step(now) {
    const { playing, frame, shown, speed, loop } = this.#values();
    if (!playing || this.#begun === null) return;
    if (shown === null || shown.nFrames === 0) {
      this.#store.set({ playing: false });
      return;
    }
    if (frame !== this.#set) this.#restart(); // somebody else has set it
    const due = frameAt(this.#begun, now, {
      rate: rateOf(shown),
      speed,
      loop,
      nFrames: shown.nFrames,
    });
    this.#set = due.frame;
    this.#store.set({ frame: due.frame });
    if (due.ended) this.#store.set({ playing: false });
    else requestAnimationFrame((next) => this.#step(next));
  }

  #values() {
    const names = ["playing", "frame", "shown", "speed", "loop"];
    return Object.fromEntries(names.map((name) => [name, this.#store.get(name)]));
  }
}
