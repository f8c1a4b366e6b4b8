// A file of any format that is read here. What comes from a server or out of the page is an .mcz,
// whatever its name; what people choose is what its name says.

import { readAmc } from "../inputs/acclaim.js";
import { readBvh } from "../inputs/bvh.js";
import { readC3d } from "../inputs/c3d.js";
import { openMcz } from "./mcz-file.js";

const READERS = {
  bvh: ({ bytes }, name) => readBvh(bytes, name),
  amc: ({ bytes, skeleton }, name) => readAmc(bytes, skeleton, name),
  c3d: ({ bytes }, name) => readC3d(bytes, name),
};

/**
 * @param {object} where `{ url, headers }` or `{ bytes }` of an .mcz, or `{ blob }`; of an AMC also
 *   `skeleton`, the blob of its ASF
 * @param {{name: string, salvage?: boolean, isLater?: boolean}} options `isLater`: a file that is
 *   read as a whole is read when its clip is wanted
 */
export async function openFile(where, options) {
  const kind = options.name.slice(options.name.lastIndexOf(".") + 1).toLowerCase();
  if (!where.blob || !Object.hasOwn(READERS, kind)) return openMcz(where, options);
  const file = new WholeFile(where, READERS[kind], options.name);
  if (!options.isLater) await file.clip();
  return file;
}

/** A file of one clip, which is held as long as somebody needs it, and then read again. */
class WholeFile {
  #read;
  #held = null;
  #row = null;

  constructor({ blob, skeleton }, reader, name) {
    Object.assign(this, { size: blob.size, nClips: 1, damage: [] });
    this.#read = async () => {
      const bytes = await whole(blob);
      return reader({ bytes, skeleton: skeleton ? await whole(skeleton) : null }, name);
    };
  }

  async clip() {
    const held = this.#held?.deref();
    if (held !== undefined) return held;
    const clip = await this.#read();
    this.#held = new WeakRef(clip);
    this.#row ??= rowOf(clip, this.size);
    return clip;
  }

  async rows() {
    if (this.#row === null) await this.clip();
    return [this.#row];
  }
}

const whole = async (blob) => new Uint8Array(await blob.arrayBuffer());

function rowOf({ name, nFrames, rate, signals }, bytes) {
  return {
    index: 0,
    name,
    nFrames,
    rate,
    codecs: [],
    nChannels: signals[0].channels.length,
    bytes,
  };
}
