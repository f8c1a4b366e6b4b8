// When feet stand: a foot is low and slow. A guess for the eye; `mcz diff` measures.

import { Tracks } from "./tracks.js";

const FEET = /foot|toe|ankle|heel|(?:^|:)[lr](?:ank|hee|toe|mt5)$/i;
const MOST_FEET = 8;
const MOST_FRAMES = 60_000; // of longer clips, contacts are found within the window alone
const SLOW = 0.16; // of the figure's height a second
const LOW = 0.055; // of the figure's height above the lowest place of the foot

export const feetOf = (clip) =>
  clip.points.flatMap(({ name }, index) => (FEET.test(name) ? [index] : [])).slice(0, MOST_FEET);

/** Frames in which feet stand: `{ name, side, isStanding: Uint8Array }` for frames of the window. */
export class Contacts {
  constructor(engine, clip) {
    Object.assign(this, { engine, clip, feet: feetOf(clip), height: null });
    this.tracks = new Tracks(engine, clip, this.feet);
  }

  async between(from, to, { up, isOver }) {
    if (!this.feet.length || !this.clip.rate || to - from > MOST_FRAMES) return [];
    this.height ??= heightOf(await this.engine.positions(this.clip, 0, 1), up);
    if (!(this.height > 0) || !(await this.tracks.fetch(from, to, { isOver }))) return [];
    return this.feet.map((point, k) => {
      const { name, side } = this.clip.points[point];
      return { name, side, isStanding: this.#standing(k, { from, to, up }) };
    });
  }

  #standing(k, { from, to, up }) {
    const place = new Float64Array(3);
    let floor = Infinity;
    for (let f = from; f < to; f++) {
      const height = this.tracks.at(k, f, place)[up];
      if (height < floor) floor = height;
    }
    const isStanding = new Uint8Array(to - from);
    for (let f = from; f < to; f++) {
      const isLow = this.tracks.at(k, f, place)[up] - floor < LOW * this.height;
      isStanding[f - from] = isLow && this.tracks.speed(k, f) < SLOW * this.height ? 1 : 0;
    }
    return isStanding;
  }
}

function heightOf(places, up) {
  let [least, most] = [Infinity, -Infinity];
  for (let at = up; at < places.length; at += 3) {
    if (places[at] < least) least = places[at];
    if (places[at] > most) most = places[at];
  }
  return most - least;
}

/** Runs of ones: pairs of frames from <= f < to. */
export function runsOf(flags, first) {
  const runs = [];
  let start = -1;
  for (let i = 0; i <= flags.length; i++) {
    if (flags[i] === 1 && start < 0) start = i;
    if (flags[i] !== 1 && start >= 0) {
      runs.push([first + start, first + i]);
      start = -1;
    }
  }
  return runs;
}
