// A file of any format that is read here: an .mcz by its first bytes, others by their names.

import { readAmc } from "../inputs/acclaim.js";
import { readBvh } from "../inputs/bvh.js";
import { readC3d } from "../inputs/c3d.js";
import { openMcz } from "./mcz-file.js";

const SIGNATURE = [0x89, 0x4d, 0x43, 0x5a]; // of an .mcz

const READERS = {
  bvh: ({ bytes }, name) => readBvh(bytes, name),
  amc: ({ bytes, skeleton }, name) => readAmc(bytes, skeleton, name),
  c3d: ({ bytes }, name) => readC3d(bytes, name),
};

/**
 * @param {object} where `{ url, headers }`, `{ blob }` or `{ bytes }`; of an AMC also `skeleton`, the
 *   blob of its ASF
 * @param {{name: string, salvage: boolean}} options
 */
export async function openFile(where, options) {
  const kind = options.name.slice(options.name.lastIndexOf(".") + 1).toLowerCase();
  if (!Object.hasOwn(READERS, kind) || (await isMcz(where))) return openMcz(where, options);
  const bytes = where.bytes ?? (await whole(where.blob));
  const skeleton = where.skeleton ? await whole(where.skeleton) : null;
  const clip = READERS[kind]({ bytes, skeleton }, options.name);
  return {
    size: bytes.length,
    nClips: 1,
    damage: [],
    rows: () => [rowOf(clip, bytes.length)],
    clip: async () => clip,
  };
}

/** What a server or a page made of a file is an .mcz, and has the name of the file that was given. */
async function isMcz({ url, bytes, blob }) {
  if (url) return true;
  const head = bytes ? bytes.subarray(0, 4) : await whole(blob.slice(0, 4));
  return SIGNATURE.every((byte, k) => head[k] === byte);
}

const whole = async (blob) => new Uint8Array(await blob.arrayBuffer());

function rowOf({ name, nFrames, rate, signals }, bytes) {
  return { index: 0, name, nFrames, rate, codecs: [], nChannels: signals[0].channels.length, bytes };
}
