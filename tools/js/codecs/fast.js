// SPEC.md, "Codec 1: fast".

import { ByteReader } from "../bytes.js";
import { Refused } from "../errors.js";
import { STEPS, readFastHead } from "../fast-heads.js";
import { numbersOf } from "../fast-numbers.js";
import { CODED, CONSTANT, COPY } from "../forms.js";
import { halvesOf, setHalves } from "../int64.js";
import { RiceReader, nextScale } from "../rice.js";

export const id = 1;
export const name = "fast";
export const version = 0;

const MAX_VALUES = 2 ** 23;
const MAX_ROWS = 4096;
const MAX_OTHER_GROUPS = 2;

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header the codec's header in CLIP
 * @param {{channels: object[], groups: number[][], grids: object[], nResolutions: number}} layout
 * @returns {{decodes: "ordinals", alone: true, decode: (segments: object[]) => BigInt64Array}}
 * @throws {Refused}
 */
export function open(header, layout) {
  if (header.length !== 0) throw new Refused("fast: the header is not empty"); // FAST-01
  if (layout.nResolutions !== 1) throw new Refused(`fast: ${layout.nResolutions} resolutions`);
  return {
    decodes: "ordinals",
    alone: true, // lead, tail and freshness mean nothing
    decode: (segments) => decodeSegments(layout, segments),
  };
}

/**
 * The ordinals of groups of which each is decoded as the only one of a signal.
 *
 * @param {{groups: number[][], grids: object[]}} layout
 * @param {object[]} segments whose streams of the coarsest resolution are those of fast
 * @param {number[]} numbers of the groups
 * @returns {BigInt64Array} all rows, row after row; 0 in the columns of other groups
 * @throws {Refused}
 */
export function decodeAlone({ groups, grids }, segments, numbers) {
  const ordinals = ordinalsOf(segments, grids.length);
  for (const g of numbers) {
    const own = segments.map((segment) => ({ ...segment, streams: [[segment.streams[0][g]]] }));
    decodeInto(ordinals, own, [groups[g]], grids);
  }
  return ordinals;
}

/** The ordinals of all rows of some segments, row after row. */
function decodeSegments({ groups, grids }, segments) {
  const ordinals = ordinalsOf(segments, grids.length);
  decodeInto(ordinals, segments, groups, grids);
  return ordinals;
}

/** Room for the ordinals of segments. */
export function ordinalsOf(segments, nChannels) {
  const nRows = segments.reduce((sum, segment) => sum + segment.nRows, 0);
  return new BigInt64Array(nRows * nChannels);
}

function decodeInto(ordinals, segments, groups, grids) {
  const nChannels = groups.reduce((sum, columns) => sum + columns.length, 0);
  for (const segment of segments) checkSize(segment, nChannels);
  let first = 0;
  for (const segment of segments) {
    const end = first + segment.nRows * grids.length;
    new SegmentDecoder(segment, groups, grids, ordinals.subarray(first, end)).decode();
    first = end;
  }
}

/** Refuses a segment that is larger than any. */
export function checkSize({ nFrames, nRows }, nChannels) {
  const isTooLong = nRows > MAX_ROWS && nFrames > 1;
  if (isTooLong || nRows * nChannels > MAX_VALUES) {
    throw new Refused(`fast: a segment of ${nRows} rows of ${nChannels} channels`); // FAST-18
  }
}

/** Decodes the rows of one segment. */
export class SegmentDecoder {
  /**
   * @param {object} segment with its streams
   * @param {number[][]} groups the columns of each
   * @param {object[]} grids of CLIP, one a column
   * @param {BigInt64Array} ordinals of the segment, row after row
   */
  constructor({ streams, nRows }, groups, grids, ordinals) {
    this.nRows = nRows;
    this.nChannels = grids.length;
    this.ordinals = ordinals;
    this.halves = halvesOf(ordinals);
    this.groups = groups.map((columns, g) => {
      const reader = new ByteReader(streams[0][g], `fast stream of group ${g}`);
      const heads = columns.map((column) => readFastHead(reader, grids[column], column, nRows));
      return { reader, heads, coded: heads.filter(({ kind }) => kind === CODED) };
    });
    this.coded = this.groups.flatMap(({ coded }) => coded);
  }

  decode() {
    this.coded.forEach((head, index) => {
      head.index = index; // in a row of residuals and leads
    });
    this.groups.forEach((group, g) => this.findParents(group, g));
    const heads = this.groups.flatMap((group) => group.heads);
    const sources = new Map(
      heads.filter(({ kind }) => kind === COPY).map((copy) => [copy, this.findSource(copy)]),
    );

    this.residuals = new Int32Array(this.nRows * this.coded.length);
    this.leads = new Int32Array(this.residuals.length);
    const withCodes = this.groups.filter((group) => this.hasCodes(group));
    for (const group of withCodes) this.decodeResiduals(group);
    for (const head of this.coded) this.predict(head);
    for (const group of withCodes) this.decodeTails(group);

    for (const head of heads) {
      if (head.kind === CONSTANT) this.fill(head.column, 0, this.nRows, head.ordinal); // FAST-23
      if (head.kind === STEPS) this.setRuns(head);
      if (head.kind === CODED && head.exceptions !== null) this.setExceptions(head);
    }
    for (const [{ column }, source] of sources) this.copy(column, source);
  }

  // Channels that others name

  /** The head of a channel that another one names; undefined where there is none. */
  find({ group, channel }) {
    return this.groups[group]?.heads[channel];
  }

  /** Sets the index of the parent of each coded channel of a group. */
  findParents({ reader, coded }, own) {
    const others = new Set();
    for (const head of coded) {
      const { parent } = head;
      if (parent === null) continue;
      const found = this.find(parent);
      if (found?.kind !== CODED || found === head) {
        reader.refuse(`channel ${parent.channel} of group ${parent.group} as a parent`); // FAST-34
      }
      parent.index = found.index;
      if (parent.group !== own) others.add(parent.group);
    }
    if (others.size > MAX_OTHER_GROUPS) {
      reader.refuse(`parents in ${others.size} other groups`); // FAST-36
    }
  }

  /** The column that a copy repeats. */
  findSource({ group, channel }) {
    const found = this.find({ group, channel });
    if (!found || found.kind === COPY) {
      throw new Refused(`fast: a copy of channel ${channel} of group ${group}`); // FAST-27
    }
    return found.column;
  }

  // The parts of a stream

  /** Whether a group has codes; it ends here where it has none. */
  hasCodes({ reader, coded }) {
    if (coded.length === 0) reader.end(); // FAST-19
    return coded.length > 0;
  }

  decodeResiduals({ reader, coded }) {
    const { residuals, nRows } = this;
    const codes = new RiceReader(reader.take(reader.varint()), `${reader.what}, residuals`);
    const scales = Int32Array.from(coded, ({ scale }) => scale);
    const width = this.coded.length;
    const nCoded = coded.length;
    for (let row = 1; row < nRows; row++) {
      const first = row * width + coded[0].index; // those of a group follow one another
      for (let i = 0; i < nCoded; i++) {
        const e = codes.code(scales[i]);
        scales[i] = nextScale(scales[i], e);
        residuals[first + i] = e;
      }
    }
    codes.finish();
  }

  /** The leads of a channel, modulo 2^32. FAST-39 */
  predict({ index, first, taps, parent }) {
    const { residuals, leads } = this;
    const [t0, t1, t2, t3] = taps;
    const width = this.coded.length;
    const weight = parent?.weight ?? 0;
    const toParent = parent ? parent.index - index : 0;
    let d0 = 0;
    let d1 = 0;
    let d2 = 0;
    let d3 = 0;
    let last = first;
    leads[index] = first;
    for (let at = index + width; at < leads.length; at += width) {
      const near = (Math.imul(t0, d0) + Math.imul(t1, d1)) | 0;
      const far = (Math.imul(t2, d2) + Math.imul(t3, d3)) | 0;
      const p = (16 + near + far) >> 5;
      const x = (128 + Math.imul(weight, residuals[at + toParent])) >> 8;
      const c = (last + p + x + residuals[at]) | 0;
      d3 = d2;
      d2 = d1;
      d1 = d0;
      d0 = (c - last) | 0;
      last = c;
      leads[at] = c;
    }
  }

  decodeTails({ reader, coded }) {
    const tails = new RiceReader(reader.rest(), `${reader.what}, tails`);
    const channels = coded.map((head) => {
      const { column, index } = head;
      return { column, index, numbers: numbersOf(head, this.ordinals) };
    });
    // Channels that take no bits need not go row by row, which is slower.
    const withTails = [];
    for (const channel of channels) {
      if (channel.numbers.hasTails) withTails.push(channel);
      else this.setNumbers([channel], tails);
    }
    if (withTails.length > 0) this.setNumbers(withTails, tails);
    tails.finish();
  }

  /** Sets the ordinals of some channels, row by row. */
  setNumbers(channels, tails) {
    const { leads, nRows, nChannels } = this;
    const width = this.coded.length;
    for (let row = 0; row < nRows; row++) {
      for (let i = 0; i < channels.length; i++) {
        const { column, index, numbers } = channels[i];
        numbers.set(row * nChannels + column, leads[row * width + index], tails);
      }
    }
  }

  // Ordinals that a head tells

  /** Sets rows of a column to an ordinal. */
  fill(column, firstRow, nRows, { low, high }) {
    const first = firstRow * this.nChannels + column;
    for (let i = 0, at = first; i < nRows; i++, at += this.nChannels) {
      setHalves(this.halves, at, low, high);
    }
  }

  /** The rows of steps. FAST-24 */
  setRuns({ column, runs }) {
    let row = 0;
    for (let i = 0; i < runs.length; i += 3) {
      this.fill(column, row, runs[i], { low: runs[i + 1], high: runs[i + 2] });
      row += runs[i];
    }
  }

  /** Rows of a coded channel whose decoded ordinals do not count. FAST-38 */
  setExceptions({ column, exceptions }) {
    for (let i = 0; i < exceptions.length; i += 3) {
      this.fill(column, exceptions[i], 1, { low: exceptions[i + 1], high: exceptions[i + 2] });
    }
  }

  /** The rows of a copy, whose source has all of its own by now. FAST-26 */
  copy(column, source) {
    const { halves, nChannels } = this;
    for (let at = column; at < this.ordinals.length; at += nChannels) {
      const from = 2 * (at + source - column);
      setHalves(halves, at, halves[from], halves[from + 1]);
    }
  }
}
