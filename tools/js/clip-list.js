// The clips of a file as a list whose entries are made when they are looked at.

import { codecLabel } from "./codecs.js";
import { rateOf } from "./ranged-clip.js";

/**
 * @typedef {object} ListedClip
 * @property {number} index
 * @property {string} name
 * @property {number} nFrames
 * @property {{numerator: number, denominator: number}} frameRate numerator 0: unknown
 * @property {number | null} rate frames a second; null: unknown
 * @property {string[]} codecs one a signal, the motion first
 * @property {number} nChannels of the motion
 * @property {string} skeletonId in hexadecimal
 * @property {number} bytes of its segments
 * @property {string[]} aliases paths that are copies of its source
 */

const INDEX = /^(?:0|[1-9][0-9]{0,8})$/;

/** The list: `length`, `[i]`, `at(i)`, `slice(a, b)`, `indexOf(name)`, and a loop over it. */
class ClipList {
  constructor({ rows, aliases }) {
    this.rows = rows;
    this.length = rows.length;
    this.aliases = new Map();
    for (const { name, of, target } of aliases.values()) {
      if (of !== 0) continue;
      if (!this.aliases.has(target)) this.aliases.set(target, []);
      this.aliases.get(target).push(name);
    }
  }

  /** @returns {import("./clip-list.js").ListedClip | undefined} */
  at(index) {
    const row = this.rows.at(index < 0 ? this.length + index : index);
    if (row === undefined) return undefined;
    return {
      index: index < 0 ? this.length + index : index,
      name: row.name,
      nFrames: row.nFrames,
      frameRate: row.frameRate,
      rate: rateOf(row.frameRate),
      codecs: row.signals.map(codecLabel),
      nChannels: row.signals[0].nChannels,
      skeletonId: row.skeletonId,
      bytes: row.bytes,
      aliases: this.aliases.get(row.name) ?? [],
    };
  }

  /** @returns {import("./clip-list.js").ListedClip[]} plain objects, which may be sent from a worker to its page */
  slice(start = 0, end = this.length) {
    const out = [];
    for (let i = start; i < Math.min(end, this.length); i++) out.push(this.at(i));
    return out;
  }

  /** The index of the clip of a name; -1 without one. */
  indexOf(name) {
    return this.rows.indexOf(name);
  }

  *[Symbol.iterator]() {
    for (let i = 0; i < this.length; i++) yield this.at(i);
  }
}

/**
 * @param {import("./directory.js").Directory} directory
 * @returns {ClipList}
 */
export function clipList(directory) {
  return new Proxy(new ClipList(directory), {
    get(list, key) {
      if (typeof key === "string" && INDEX.test(key)) return list.at(Number(key));
      const value = list[key];
      return typeof value === "function" ? value.bind(list) : value;
    },
  });
}
