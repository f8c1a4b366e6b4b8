// SPEC.md, "Codec 128: lossless": streams of groups, with constants and copies.

import { ByteReader } from "./bytes.js";
import { Refused } from "./errors.js";
import { CODED, CONSTANT, COPY, readHead } from "./heads.js";

/** Decodes a run of segments. */
export class SignalDecoder {
  /**
   * @param {{name: string, rules: object, decoder: (ordinals: BigInt64Array) => object}} codec what
   *     heads it has, and what decodes the coded channels of a group
   * @param {object} layout of the signal
   * @param {object[]} segments with their streams
   */
  constructor(codec, layout, segments) {
    this.codec = codec;
    this.layout = layout;
    this.segments = segments;
    this.nChannels = layout.channels.length;
    const nRows = segments.reduce((sum, segment) => sum + segment.nRows, 0);
    this.ordinals = new BigInt64Array(nRows * this.nChannels);
    this.bits = codec.decoder(this.ordinals);
  }

  /** @returns {BigInt64Array} the ordinals of all rows, row after row */
  decode() {
    let row = 0;
    for (const segment of this.segments) {
      this.decodeSegment(segment, row);
      row += segment.nRows;
    }
    return this.ordinals;
  }

  decodeSegment({ streams, nRows }, firstRow) {
    const { grids } = this.layout;
    const groups = this.layout.groups.map((columns, g) => {
      const reader = new ByteReader(streams[0][g], `${this.codec.name} stream of group ${g}`);
      const bits = this.decoderOf(reader);
      const heads = columns.map((column) => readHead(reader, grids[column], column, this.codec.rules));
      return { columns, heads, reader, bits };
    });
    const heads = groups.flatMap((group) => group.heads);
    const copies = heads.filter(({ kind }) => kind === COPY);
    const sources = copies.map((copy) => sourceOf(copy, groups, this.codec.name));
    for (const { column, ordinal } of heads.filter(({ kind }) => kind === CONSTANT)) {
      this.eachRow(firstRow, nRows, column, () => ordinal);
    }
    for (const group of groups) this.decodeBits(group, nRows, firstRow);
    copies.forEach(({ column }, i) => {
      const from = sources[i] - column;
      this.eachRow(firstRow, nRows, column, (at) => this.ordinals[at + from]);
    });
  }

  /** What decodes the coded channels of a group, whose stream is at its beginning. */
  decoderOf() {
    return this.bits;
  }

  /** Sets a column to what `ordinalAt` says, which is given the index in `ordinals`. */
  eachRow(firstRow, nRows, column, ordinalAt) {
    const start = firstRow * this.nChannels + column;
    const end = start + nRows * this.nChannels;
    for (let at = start; at < end; at += this.nChannels) this.ordinals[at] = ordinalAt(at);
  }

  decodeBits({ heads, reader, bits }, nRows, firstRow) {
    const coded = heads.filter(({ kind }) => kind === CODED);
    if (coded.length === 0) {
      reader.end();
      return;
    }
    const first = firstRow * this.nChannels;
    bits.decodeGroup(coded, reader.rest(), nRows, this.nChannels, first, reader.what);
  }
}

/** The column that a copy repeats. */
function sourceOf({ group, channel }, groups, name) {
  const from = groups[group]?.heads[channel];
  if (!from || from.kind === COPY) {
    const why = from ? "which is a copy itself" : "which there is not";
    throw new Refused(`${name}: a copy of channel ${channel} of group ${group}, ${why}`);
  }
  return from.column;
}
