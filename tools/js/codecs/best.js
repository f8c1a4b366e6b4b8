// SPEC.md, "Codec 2: best".

import { ByteReader } from "../bytes.js";
import { RangeDecoder, bits } from "../entropy.js";
import { Refused } from "../errors.js";
import { hasUnit } from "../forms.js";
import { numbersOf } from "../fast-numbers.js";
import { setHalves } from "../int64.js";
import { Learner, bounded } from "../regressions.js";
import { Residuals, side } from "../residuals.js";
import { RiceReader } from "../rice.js";
import { restart, startModels } from "../start-models.js";
import { SegmentDecoder, checkSize, ordinalsOf } from "./fast.js";

export const id = 2;
export const name = "best";
export const version = 0;

const AS_FAST = 0;
const ECHOED = 2;
const MAX_REFERENCES = 8;
const MAX_IN_ALL = 4096;
const WORK = 64; // references x rows that a byte pays for
const SPARE = 1024; // bytes that are given
const LINEAR_REFERENCES = 6;
const FIRST_ROWS = 8; // in which the blend is not asked
const REACH = 64; // units that a level is counted in
const LIMIT = 2 ** 20;
const TWO_31 = 2 ** 31;
const COUNT_BITS = 4; // of the number of references

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header the codec's header in CLIP
 * @param {{channels: object[], groups: number[][], grids: object[], nResolutions: number}} layout
 * @returns {{decodes: "ordinals", alone: true, decode: (segments: object[]) => BigInt64Array}}
 * @throws {Refused}
 */
export function open(header, layout) {
  if (header.length !== 0) throw new Refused("best: the header is not empty"); // BEST-01
  if (layout.nResolutions !== 1) throw new Refused(`best: ${layout.nResolutions} resolutions`);
  if (layout.groups.length > 1) throw new Refused(`best: ${layout.groups.length} groups`); // BEST-02
  const [model] = startModels("best_start.json");
  const learned = model.copy();
  const fresh = () => {
    restart(learned, model);
    return learned;
  };
  return {
    decodes: "ordinals",
    alone: true,
    decode: (segments) => decodeSegments(layout, segments, fresh),
  };
}

/** The ordinals of all rows of some segments, row after row; `fresh` gives a model to begin with. */
function decodeSegments({ groups, grids }, segments, fresh) {
  const ordinals = ordinalsOf(segments, grids.length);
  let first = 0;
  for (const segment of segments) {
    checkSize(segment, grids.length);
    const end = first + segment.nRows * grids.length;
    const own = ordinals.subarray(first, end);
    first = end;
    if (groups.length === 0) continue;
    const [[stream]] = segment.streams;
    const method = stream[0];
    if (!(method <= ECHOED)) throw new Refused(`best: method ${method}`); // BEST-03
    const rest = { ...segment, streams: [[stream.subarray(1)]] };
    const decoder =
      method === AS_FAST
        ? new SegmentDecoder(rest, groups, grids, own)
        : new PredictedDecoder(rest, groups, grids, own, { method, model: fresh() });
    decoder.decode();
  }
  return ordinals;
}

/** Fast and slow scale and sides of what was coded of a channel. */
class Memory {
  constructor(scale) {
    this.fast = scale;
    this.slow = scale;
    this.side1 = 0;
    this.side2 = 0;
  }

  learn(e) {
    const size = 16 * Math.abs(e); // fits no 32 bits: floor in the place of >>
    this.fast += Math.floor((size - this.fast) / 2);
    this.slow += Math.floor((size - this.slow) / 32);
    this.side2 = this.side1;
    this.side1 = side(e);
  }
}

/** A coded channel as it is predicted; `first`: its lead in row 0. */
class Predicted {
  constructor({ scale, first, taps, law, restScale }, references) {
    this.memory = new Memory(scale);
    this.rests = law?.hasRests ? new Memory(restScale) : null;
    this.unit = 2 ** (bits(scale >> 4) + 2); // U
    this.references = references;
    this.taps = taps;
    this.first = first;
    this.last = first;
    this.differences = new Int32Array(4);
    this.steps = new Float64Array(5); // of this row, and of those before it
    this.level = 0;
    this.levelBefore = 0;
    const n = references.length;
    this.linear = new Learner(4 + 2 * Math.min(n, LINEAR_REFERENCES), 0.95, 0.01);
    this.quadratic = new Learner(3 + n + (n * (n + 1)) / 2, 0.998, 0.001);
    this.blend = new Learner(3, 0.98, 0.01);
  }

  nextRow() {
    this.steps.copyWithin(1, 0, 4);
    this.steps[0] = 0;
    this.levelBefore = this.level;
  }

  setLinear() {
    const { steps, references } = this;
    const { features } = this.linear;
    for (let lag = 1; lag <= 4; lag++) features[lag - 1] = steps[lag];
    const m = Math.min(references.length, LINEAR_REFERENCES);
    for (let i = 0; i < m; i++) {
      features[4 + i] = references[i].steps[0];
      features[4 + m + i] = references[i].steps[1];
    }
  }

  setQuadratic() {
    const { steps, references } = this;
    const { features } = this.quadratic;
    const n = references.length;
    for (let lag = 1; lag <= 3; lag++) features[lag - 1] = steps[lag];
    let at = 3 + n;
    for (let i = 0; i < n; i++) {
      const one = references[i];
      features[3 + i] = one.steps[0];
      for (let j = i; j < n; j++) {
        const two = references[j];
        features[at++] = (one.level * two.level - one.levelBefore * two.levelBefore) * REACH;
      }
    }
  }

  /** The step that is expected in row r, in units. BEST-17 */
  guess(r) {
    this.setLinear();
    this.setQuadratic();
    const { features } = this.blend;
    const [t0, t1, t2, t3] = this.taps;
    const [d0, d1, d2, d3] = this.differences;
    const near = (Math.imul(t0, d0) + Math.imul(t1, d1)) | 0;
    const far = (Math.imul(t2, d2) + Math.imul(t3, d3)) | 0;
    features[0] = this.linear.expect();
    features[1] = this.quadratic.expect();
    features[2] = bounded(((16 + near + far) >> 5) / this.unit);
    return r < FIRST_ROWS ? features[2] : this.blend.expect();
  }

  /** Takes in the lead of a row. */
  move(lead) {
    const { unit, last, first, differences } = this;
    this.steps[0] = Math.min(Math.max((lead - last) / unit, -LIMIT), LIMIT);
    this.level = (lead - first) / (REACH * unit);
    differences.copyWithin(1, 0, 3);
    differences[0] = lead - last;
    this.last = lead;
  }

  /** Learns from row r; c is its number. */
  learn(r, c, guess) {
    const [step] = this.steps;
    const { features } = this.blend;
    this.linear.learn(r, step, features[0]);
    this.linear.solve();
    this.quadratic.learn(r, step, features[1]);
    if ((r + c) % 2 === 0) this.quadratic.solve();
    this.blend.learn(r, step, guess);
    this.blend.solve();
  }
}

/** Decodes a segment whose leads are predicted. */
class PredictedDecoder extends SegmentDecoder {
  constructor(segment, groups, grids, ordinals, { method, model }) {
    super(segment, groups, grids, ordinals);
    this.hasEchoes = method === ECHOED;
    this.model = model;
    this.most = WORK * (segment.streams[0][0].length + 1 + SPARE);
  }

  findParents({ reader, coded }) {
    if (coded.length === 0) reader.refuse("no channel is coded"); // BEST-04
    if (coded.some(({ parent }) => parent !== null)) reader.refuse("a parent"); // BEST-05
  }

  decodeResiduals({ reader, coded }) {
    const size = reader.varint();
    const part = new ByteReader(reader.take(size), `${reader.what}, residuals`);
    this.echoes = this.hasEchoes ? readEchoes(part, coded, this.nRows) : null;
    this.coder = new RangeDecoder(part.rest());
    this.kind = new Residuals(this.model);
    this.rests = new Int32Array(this.leads.length);
    this.decodeLeads(this.channelsOf(coded));
    this.coder.finish(part.what); // BEST-07
  }

  /** The coded channels with their references. BEST-08 */
  channelsOf(coded) {
    const { coder } = this;
    const channels = [];
    let total = 0;
    for (const [c, head] of coded.entries()) {
      const n = c === 0 ? 0 : coder.number(COUNT_BITS);
      total += n;
      if (n > MAX_REFERENCES) throw new Refused(`best: ${n} references of a channel`); // BEST-09
      if (total > MAX_IN_ALL) throw new Refused(`best: more than ${MAX_IN_ALL} references`); // BEST-11
      const references = Array.from({ length: n }, () => {
        const o = coder.number(bits(c - 1));
        if (o >= c) throw new Refused(`best: channel ${c} refers to ${o}`); // BEST-10
        return channels[o];
      });
      channels.push(new Predicted(head, references));
    }
    if ((coded.length + total) * this.nRows > this.most) {
      throw new Refused("best: more references than its bytes pay for"); // BEST-12
    }
    return channels;
  }

  decodeLeads(channels) {
    const width = channels.length;
    for (let r = 0; r < this.nRows; r++) {
      this.near = 0;
      this.other = 3;
      if (r > 0) for (const channel of channels) channel.nextRow();
      for (let c = 0; c < width; c++) {
        const channel = channels[c];
        const at = r * width + c;
        if (channel.rests !== null) this.rests[at] = this.rest(channel.rests); // BEST-13
        if (r === 0) this.leads[at] = channel.first;
        else if (this.echoes?.[at]) this.repeat(channel, at);
        else this.lead(channel, r, c, at);
      }
    }
  }

  miss({ fast, slow, side1, side2 }) {
    return this.kind.decode(this.coder, false, fast, slow, this.near, side1, side2, this.other);
  }

  rest(memory) {
    const e = this.miss(memory);
    if (e !== (e | 0)) throw new Refused(`best: a rest of ${e}`); // BEST-14
    memory.learn(e);
    return e;
  }

  /** Decodes the lead of a channel in row r. BEST-15 */
  lead(channel, r, c, at) {
    const { memory, last, unit } = channel;
    const guess = channel.guess(r);
    const place = Math.floor(last + guess * unit + 0.5);
    const e = this.miss(memory);
    const lead = Math.min(Math.max(place, -TWO_31), TWO_31 - 1) + e;
    if (lead !== (lead | 0)) throw new Refused(`best: a lead of ${lead}`); // BEST-16
    this.near = (this.near + bits(16 * Math.abs(e)) - bits(memory.slow)) >> 1;
    memory.learn(e);
    this.other = memory.side1;
    this.leads[at] = lead;
    channel.move(lead);
    channel.learn(r, c, guess);
  }

  /** Takes the lead that an echo repeats. BEST-24 */
  repeat(channel, at) {
    const place = this.echoes[at];
    const lead = this.leads[Math.abs(place) - 1];
    this.leads[at] = place < 0 ? ~lead : lead;
    channel.move(this.leads[at]);
  }

  predict() {
    // Leads are there.
  }

  decodeTails({ reader, coded }) {
    const tails = new RiceReader(reader.rest(), `${reader.what}, tails`);
    const numbers = coded.map((head) => numbersOf(head, this.ordinals));
    const width = coded.length;
    const rest = { code: () => this.rests[this.at] }; // in the place of tails
    for (let at = 0; at < this.leads.length; at++) {
      const c = at % width;
      const index = this.indexOf(coded, at);
      if (this.echoes?.[at] && !hasUnit(coded[c].form)) {
        this.repeatOrdinal(coded, index, this.echoes[at]);
      } else {
        this.at = at;
        numbers[c].set(index, this.leads[at], coded[c].law ? rest : tails);
      }
    }
    tails.finish();
  }

  /** The index of the ordinal of a place in leads. */
  indexOf(coded, at) {
    const row = Math.floor(at / coded.length);
    return row * this.nChannels + coded[at % coded.length].column;
  }

  /** Takes the ordinal that an echo repeats; of a channel in units it is the lead. */
  repeatOrdinal(coded, index, place) {
    const at = Math.abs(place) - 1;
    const from = 2 * this.indexOf(coded, at);
    const isLead = hasUnit(coded[at % coded.length].form);
    const low = isLead ? this.leads[at] : this.halves[from];
    const high = isLead ? low >> 31 : this.halves[from + 1];
    if (place < 0) setHalves(this.halves, index, ~low, ~high);
    else setHalves(this.halves, index, low, high);
  }
}

/**
 * Blocks of numbers that repeat earlier ones.
 *
 * @returns {Float64Array} of each number of the coded channels, row after row: 0, or 1 + the place
 *     that it repeats, less than 0 for the other sign
 */
function readEchoes(reader, coded, nRows) {
  const count = reader.varint();
  const width = coded.length;
  let left = nRows * width;
  if (count < 1 || count > left) reader.refuse(`${count} echoes`); // BEST-19
  const table = new Float64Array(left);
  for (let i = 0; i < count; i++) {
    const [row, rows, channel, channels, lag, source] = Array.from({ length: 6 }, () =>
      reader.varint(),
    );
    const flags = reader.u8();
    if (rows < 1 || row + rows > nRows) reader.refuse(`an echo in rows from ${row} on`); // BEST-20
    if (lag < 1 || lag > row) reader.refuse(`an echo in row ${row} of ${lag} rows before`); // BEST-21
    for (const first of [channel, source]) {
      const own = coded.slice(first, first + channels);
      if (channels < 1 || own.length !== channels || own.some(({ law }) => law?.hasRests)) {
        reader.refuse(`an echo of ${channels} channels from ${first} on`); // BEST-22
      }
    }
    if (flags > 1) reader.refuse(`flags ${flags} of an echo`); // BEST-23
    left -= rows * channels;
    if (left < 0) reader.refuse("more echoes than there are numbers"); // BEST-19
    for (let r = row; r < row + rows; r++) {
      for (let c = 0; c < channels; c++) {
        const place = (r - lag) * width + source + c + 1;
        table[r * width + channel + c] = flags === 1 ? -place : place;
      }
    }
  }
  return table;
}
