// SPEC.md, "Codec 0: raw".

import { ByteReader } from "../bytes.js";
import { Refused } from "../errors.js";
import { halvesOf } from "../int64.js";

export const id = 0;
export const name = "raw";
export const version = 0;
export const decodes = "ordinals";

const MAX_WIDTH = 8;

/**
 * @param {Uint8Array} header of the codec: empty
 * @param {object} layout of the signal
 * @returns {RawDecoder}
 * @throws {Refused}
 */
export function open(header, layout) {
  if (header.length !== 0) throw new Refused("raw: a header, which is empty");
  if (layout.nResolutions !== 1) throw new Refused(`raw: ${layout.nResolutions} resolutions`);
  return new RawDecoder(layout);
}

class RawDecoder {
  constructor(layout) {
    this.layout = layout;
    this.decodes = decodes;
    this.alone = true; // lead, tail and freshness mean nothing
  }

  /**
   * @param {object[]} segments a run of one signal
   * @returns {BigInt64Array} ordinals, row after row
   * @throws {Refused}
   */
  decode(segments) {
    const nChannels = this.layout.channels.length;
    const nRows = segments.reduce((sum, segment) => sum + segment.nRows, 0);
    const ordinals = new BigInt64Array(nRows * nChannels);
    let firstRow = 0;
    for (const segment of segments) {
      this.layout.groups.forEach((columns, group) => {
        const reader = new ByteReader(segment.streams[0][group], "raw");
        for (const column of columns) {
          decodeChannel(reader, segment.nRows, ordinals, firstRow * nChannels + column, nChannels);
        }
        reader.end();
      });
      firstRow += segment.nRows;
    }
    return ordinals;
  }
}

/** Writes a channel's ordinals as pairs of u32, added with carry: faster than BigInt. */
function decodeChannel(reader, nRows, ordinals, start, stride) {
  const leastLow = reader.u32();
  const leastHigh = reader.u32();
  const width = reader.u8();
  if (width > MAX_WIDTH) reader.refuse(`offsets of ${width} bytes`);
  const offsets = reader.take(nRows * width);
  const words = halvesOf(ordinals);
  const nLow = Math.min(width, 4);
  let at = 0;
  let word = 2 * start;
  for (let row = 0; row < nRows; row++, word += 2 * stride) {
    let low = 0;
    let high = 0;
    for (let i = 0; i < nLow; i++) low |= offsets[at++] << (8 * i);
    for (let i = 4; i < width; i++) high |= offsets[at++] << (8 * (i - 4));
    const sum = leastLow + (low >>> 0);
    words[word] = sum;
    words[word + 1] = leastHigh + high + (sum > 0xffffffff ? 1 : 0);
  }
}
