// BVH, for pages that nobody serves: the skeleton and its motion, as the engine reads a clip.

import { SourceError, clipOf, numberOf, shown, skeletonOf, textOf, valueOf } from "./lines.js";
import { frameRate } from "./rates.js";

const KINDS = {
  xposition: 1,
  yposition: 2,
  zposition: 3,
  xrotation: 4,
  yrotation: 5,
  zrotation: 6,
  xscale: 7,
  yscale: 8,
  zscale: 9,
};
const MOST_JOINTS = 4096;
const MOST_CHANNELS = 16384;

/**
 * @param {Uint8Array} bytes
 * @param {string} name of the file
 * @throws {SourceError} with the number of the line
 */
export function readBvh(bytes, name) {
  const reader = new Reader(textOf(bytes));
  const joints = reader.hierarchy();
  const { rate, values, declared } = reader.motion(
    joints.reduce((sum, { channels }) => sum + channels.length, 0),
  );
  decidePositions(joints, values);
  const skeleton = skeletonOf({ intrinsic: true, joints });
  const clip = clipOf({ name: stem(name), skeleton, values, rate, format: "bvh", path: name });
  if (clip.nFrames !== declared) {
    clip.metadata.push([
      "source-note",
      `${declared} frames are declared, ${clip.nFrames} are there`,
    ]);
  }
  return clip;
}

const stem = (name) => name.replace(/\.[^.]*$/, "");

class Reader {
  #text;
  #word = /[{}]|[^\s{}]+/g;

  constructor(text) {
    this.#text = text;
  }

  #next() {
    const match = this.#word.exec(this.#text);
    if (match === null) this.#word.lastIndex = this.#text.length;
    return match === null ? "" : match[0];
  }

  #refuse(message) {
    let line = 1;
    const end = Math.max(0, this.#word.lastIndex - 1);
    for (
      let at = this.#text.indexOf("\n");
      at >= 0 && at < end;
      at = this.#text.indexOf("\n", at + 1)
    )
      line++;
    throw new SourceError(`line ${line}: ${message}`);
  }

  hierarchy() {
    if (this.#next().toUpperCase() !== "HIERARCHY")
      this.#refuse("no HIERARCHY section at the start; not a BVH file");
    const joints = [];
    const open = []; // { joint, end }: joint -1 for an end site's parent
    for (;;) {
      const word = this.#next();
      switch (word.toUpperCase()) {
        case "ROOT":
        case "JOINT":
        case "END":
          open.push(this.#begin(word.toUpperCase(), joints, open.at(-1)));
          break;
        case "OFFSET":
          if (open.length === 0) this.#refuse("OFFSET outside of a joint");
          open.at(-1).offset(this.#vector());
          break;
        case "CHANNELS":
          if (open.length === 0 || open.at(-1).isEnd) this.#refuse("CHANNELS outside of a joint");
          joints[open.at(-1).index].channels = this.#channels();
          break;
        case "}":
          if (open.pop() === undefined) this.#refuse("} without {");
          break;
        case "MOTION":
          if (open.length > 0) this.#refuse("MOTION inside of a joint");
          if (joints.length === 0) this.#refuse("no joint");
          return joints;
        default:
          this.#refuse(
            word === ""
              ? "the file ends in its HIERARCHY"
              : `${shown(word)} in the HIERARCHY section`,
          );
      }
    }
  }

  #begin(kind, joints, above) {
    const start = this.#word.lastIndex;
    const brace = this.#text.indexOf("{", start);
    const line = this.#text.slice(start, brace < 0 ? start : brace);
    if (brace < 0 || line.trim().includes("\n")) this.#refuse(`no { after ${kind}`);
    this.#word.lastIndex = brace + 1;
    if (kind === "END") {
      if (above === undefined) this.#refuse("an end site without a joint");
      const { tails } = joints[above.index];
      return { isEnd: true, index: above.index, offset: (vector) => tails.push(vector) };
    }
    const joint = {
      name: line.trim(),
      parent: above?.index ?? -1,
      offset: [0, 0, 0],
      tails: [],
      channels: [],
    };
    joints.push(joint);
    if (joints.length > MOST_JOINTS) this.#refuse(`more than ${MOST_JOINTS} joints`);
    return { isEnd: false, index: joints.length - 1, offset: (vector) => (joint.offset = vector) };
  }

  #vector() {
    return [0, 1, 2].map(() => {
      const word = this.#next();
      const number = numberOf(word);
      if (Number.isNaN(number)) this.#refuse(`expected a number, not ${shown(word)}`);
      return number;
    });
  }

  #channels() {
    const word = this.#next();
    if (!/^\d{1,6}$/.test(word) || Number(word) > MOST_CHANNELS)
      this.#refuse(`CHANNELS ${shown(word)}: not a count`);
    return Array.from({ length: Number(word) }, () => {
      const name = this.#next();
      if (name === "" || name === "{" || name === "}")
        this.#refuse("fewer channels than CHANNELS states");
      const kind = KINDS[name.toLowerCase()] ?? 0;
      return kind === 0 ? { kind, name } : { kind };
    });
  }

  /** Frames, frame time and rows. Rows that are there count, not those that are declared. */
  motion(nChannels) {
    const head = /\s*Frames:\s*(\S+)\s+Frame\s+Time:\s*(\S+)[^\n]*/iy;
    head.lastIndex = this.#word.lastIndex;
    const match = head.exec(this.#text);
    if (match === null) this.#refuse("Frames: and Frame Time: must follow MOTION");
    this.#word.lastIndex = head.lastIndex;
    const values = this.#numbers(head.lastIndex);
    const whole = nChannels === 0 ? 0 : Math.floor(values.length / nChannels);
    return {
      rate: frameRate(match[2]),
      declared: numberOf(match[1]),
      values: values.subarray(0, whole * nChannels),
    };
  }

  #numbers(start) {
    const text = this.#text;
    let values = new Float64Array(Math.max(16, (text.length - start) >> 3));
    let n = 0;
    let at = start;
    for (;;) {
      while (at < text.length && text.charCodeAt(at) <= 32) at++;
      if (at >= text.length) return values.subarray(0, n);
      let end = at;
      while (end < text.length && text.charCodeAt(end) > 32) end++;
      const word = text.slice(at, end);
      const value = valueOf(word);
      if (value === null) {
        this.#word.lastIndex = end;
        this.#refuse(`expected a number, not ${shown(word)}`);
      }
      if (n === values.length) {
        const grown = new Float64Array(2 * n);
        grown.set(values);
        values = grown;
      }
      values[n++] = value;
      at = end;
    }
  }
}

/**
 * Position channels replace the offset of a joint where their values are nearer to it than to 0: of
 * a root by its first frame, of all others together by the majority of them.
 */
function decidePositions(joints, values) {
  const width = joints.reduce((sum, { channels }) => sum + channels.length, 0);
  const others = [];
  let votes = 0;
  let column = 0;
  for (const joint of joints) {
    const moved = joint.channels.flatMap(({ kind }, i) =>
      kind >= 1 && kind <= 3 ? [[kind - 1, column + i]] : [],
    );
    column += joint.channels.length;
    if (moved.length === 0 || values.length === 0) continue;
    const isRoot = joint.parent < 0;
    const { toOffset, toZero } = distances(
      moved,
      joint.offset,
      values,
      isRoot ? width : values.length,
      width,
    );
    if (isRoot) joint.positionsAdd = !(toOffset < toZero);
    else {
      others.push(joint);
      votes += Number(toOffset < toZero) - Number(toZero < toOffset);
    }
  }
  for (const joint of others) joint.positionsAdd = votes <= 0;
}

function distances(moved, offset, values, end, width) {
  let toOffset = 0;
  let toZero = 0;
  for (let row = 0; row < end; row += width) {
    for (const [axis, column] of moved) {
      toOffset += Math.abs(values[row + column] - offset[axis]);
      toZero += Math.abs(values[row + column]);
    }
  }
  return { toOffset, toZero };
}
