// SPEC.md, "Codec 2: best".

import { ByteReader } from "../bytes.js";
import { RangeDecoder, clamp } from "../entropy.js";
import { Refused } from "../errors.js";
import { CODED, MULTIPLES, PRODUCTS, COUNTS, withRests } from "../heads.js";
import { setHalves } from "../int64.js";
import { SignalDecoder } from "../ordinal-streams.js";
import { Learner, bounded } from "../regressions.js";
import { restart } from "../start-models.js";
import { BitDecoder, CodedChannel, guessed } from "./lossless.js";

export const id = 2;
export const name = "best";
export const version = 0;

const AS_CODEC_1 = 0;
const LINKED = 1;
const ECHOED = 2;
const MAX_UNIT = 44;
const MAX_OTHERS = 8;
const MAX_LINKS = 4096;

// The first context of each kind of bit; residuals have the mixers from 0 on.
const ZERO = 0;
const MINUS = 2;
const DOWN = 4;
const RESIDUALS = 17;

const LIMIT = 2 ** 20;
const TWO_44 = 2 ** 44;
const EIGHT_OR_NINE = 13107;

const CODEC = {
  name,
  rules: { hasProducts: true, hasCounts: true },
  decoder: (ordinals) => new BitDecoder(ordinals),
};

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header the codec's header in CLIP
 * @param {{channels: object[], groups: number[][], grids: object[], nResolutions: number}} layout
 * @returns {{decodes: "ordinals", alone: true, decode: (segments: object[]) => BigInt64Array}}
 * @throws {Refused}
 */
export function open(header, layout) {
  if (header.length !== 0) throw new Refused("best: the header is not empty");
  if (layout.nResolutions !== 1) throw new Refused(`best: ${layout.nResolutions} resolutions`);
  return {
    decodes: "ordinals",
    alone: true,
    decode: (segments) => new BestDecoder(layout, segments).decode(),
  };
}

class BestDecoder extends SignalDecoder {
  constructor(layout, segments) {
    super(CODEC, layout, segments);
    this.linked = new LinkedDecoder(this.ordinals);
    this.echoed = new LinkedDecoder(this.ordinals, readEchoes);
  }

  decoderOf(reader) {
    const method = reader.u8();
    if (method > ECHOED) reader.refuse(`method ${method}`);
    if (method === AS_CODEC_1) return this.bits;
    return method === LINKED ? this.linked : this.echoed;
  }

  decodeBits(group, nRows, firstRow) {
    if (group.bits !== this.bits && !group.heads.some(({ kind }) => kind === CODED)) {
      group.reader.refuse("no channel is coded");
    }
    super.decodeBits(group, nRows, firstRow);
  }
}

/**
 * Blocks of numbers that repeat earlier ones.
 *
 * @returns {Float64Array} of each number of the coded channels, row after row: 0, or 1 + the place
 *     that it repeats, less than 0 for the other sign
 */
function readEchoes(reader, heads, nRows) {
  const count = reader.varint();
  const width = heads.length;
  let left = nRows * width;
  if (count < 1 || count > left) reader.refuse(`${count} echoes`);
  const table = new Float64Array(left);
  for (let i = 0; i < count; i++) {
    const row = reader.varint();
    const rows = reader.varint();
    const channel = reader.varint();
    const channels = reader.varint();
    const lag = reader.varint();
    const source = reader.varint();
    const flags = reader.u8();
    if (rows < 1 || row + rows > nRows) reader.refuse(`an echo in rows from ${row} on`);
    if (lag < 1 || lag > row) reader.refuse(`an echo in row ${row} of ${lag} rows before`);
    for (const first of [channel, source]) {
      const own = heads.slice(first, first + channels);
      if (channels < 1 || own.length !== channels || own.some(isNoOrdinal)) {
        reader.refuse(`an echo of ${channels} channels from ${first} on`);
      }
    }
    if (flags > 1) reader.refuse(`flags ${flags} of an echo`);
    left -= rows * channels;
    if (left < 0) reader.refuse("more echoes than there are numbers");
    for (let r = row; r < row + rows; r++) {
      for (let c = 0; c < channels; c++) {
        const place = (r - lag) * width + source + c + 1;
        table[r * width + channel + c] = flags === 1 ? -place : place;
      }
    }
  }
  return table;
}

/** Whether what is coded of a channel are no ordinals. */
function isNoOrdinal({ form, restsOf }) {
  return Boolean(restsOf) || [MULTIPLES, PRODUCTS, COUNTS].includes(form);
}

/** The coded channels with their links. */
function readLinks(reader, heads) {
  const channels = [];
  let total = 0;
  for (const head of heads) {
    const unit = reader.u8();
    const seen = reader.u8();
    if (unit > MAX_UNIT) reader.refuse(`a unit of 2^${unit}`);
    const n = seen & 15;
    if (n > MAX_OTHERS) reader.refuse(`a channel looks at ${n} others`);
    const others = [];
    for (let i = 0; i < n; i++) {
      const other = reader.varint();
      if (other >= channels.length) reader.refuse(`channel ${channels.length} looks at ${other}`);
      others.push(channels[other]);
    }
    total += n;
    channels.push(new LinkedChannel(head, unit, unit + (seen >> 4), others));
  }
  if (total > MAX_LINKS) reader.refuse(`${total} links`);
  return channels;
}

/** A coded channel, the others that it looks at, and its regressions. */
class LinkedChannel extends CodedChannel {
  constructor(head, unit, reach, others) {
    super(head);
    this.stepUnit = 2 ** unit; // U
    this.reach = 2 ** reach; // R
    this.others = others;
    this.steps = new Float64Array(5); // of this row, and of those before it
    this.level = 0;
    this.levelBefore = 0;
    this.first = 0;
    const n = others.length;
    this.nearby = new Learner(4 + 2 * Math.min(n, 6), 0.95, 0.01);
    this.bent = new Learner(3 + n + (n * (n + 1)) / 2, 0.998, 0.001);
    this.final = new Learner(3, 0.98, 0.01);
  }

  nextRow() {
    this.steps.copyWithin(1, 0, 4);
    this.levelBefore = this.level;
  }

  /** Sets the features of NEARBY. */
  lookNearby() {
    const { steps, others } = this;
    const { features } = this.nearby;
    for (let lag = 1; lag <= 4; lag++) features[lag - 1] = steps[lag];
    const m = Math.min(others.length, 6);
    for (let i = 0; i < m; i++) {
      features[4 + i] = others[i].steps[0];
      features[4 + m + i] = others[i].steps[1];
    }
  }

  /** Sets the features of BENT. */
  lookBent() {
    const { steps, others } = this;
    const { features } = this.bent;
    const ratio = this.reach / this.stepUnit;
    for (let lag = 1; lag <= 3; lag++) features[lag - 1] = steps[lag];
    let at = 3;
    for (const other of others) features[at++] = other.steps[0];
    others.forEach((one, i) => {
      for (const other of others.slice(i)) {
        const step = one.level * other.level - one.levelBefore * other.levelBefore;
        features[at++] = step * ratio;
      }
    });
  }

  /** The step that is expected in row r, in units. */
  guess(r) {
    this.lookNearby();
    this.lookBent();
    this.final.features[0] = this.nearby.expect();
    this.final.features[1] = this.bent.expect();
    const p = bounded((this.predict() - this.last) / this.stepUnit);
    this.final.features[2] = p;
    return r < 8 ? p : this.final.expect();
  }

  /** Takes in what followed `last` in row r; c is its number among the coded channels. */
  learn(r, c, guess, last) {
    if (r === 0) {
      this.first = this.last;
      return;
    }
    const step = Math.min(Math.max((this.last - last) / this.stepUnit, -LIMIT), LIMIT);
    this.steps[0] = step;
    this.level = (this.last - this.first) / this.reach;
    const due = r < 64 ? r % 2 === 0 : (r + c) % 4 === 0;
    this.nearby.learn(r, step, this.final.features[0], true);
    this.bent.learn(r, step, this.final.features[1], due);
    this.final.learn(r, step, guess, true);
  }
}

/** Decodes the coded channels of a group in a segment. */
class LinkedDecoder extends BitDecoder {
  /**
   * @param {BigInt64Array} ordinals where they go
   * @param {(reader: ByteReader, heads: object[], nRows: number) => ?Float64Array} echoesOf reads
   *     the echoes in front of the links
   */
  constructor(ordinals, echoesOf = () => null) {
    super(ordinals, "best_start.json", [RESIDUALS, 0]);
    this.echoesOf = echoesOf;
  }

  decodeGroup(heads, data, nRows, nChannels, firstIndex, what) {
    const reader = new ByteReader(data, what);
    const every = withRests(heads);
    this.echoes = this.echoesOf(reader, every, nRows);
    const channels = readLinks(reader, every);
    restart(this.model, this.startModel);
    this.coder = new RangeDecoder(reader.rest());
    this.decode(channels, nRows, nChannels, firstIndex);
    this.coder.finish(what);
  }

  decode(channels, nRows, nChannels, firstIndex) {
    for (let r = 0; r < nRows; r++) {
      this.near = 0;
      this.other = 3;
      for (const channel of channels) channel.nextRow();
      channels.forEach((channel, c) => {
        const echo = this.echoes?.[r * channels.length + c];
        if (echo) {
          this.echo(channels, channel, r, Math.abs(echo) - 1, echo < 0, nChannels, firstIndex);
          return;
        }
        const { last, stepUnit } = channel;
        const guess = channel.guess(r);
        const predicted = clamp(Math.floor(last + guess * stepUnit + 0.5), -TWO_44, TWO_44);
        this.number(channel, firstIndex + r * nChannels + channel.column, predicted);
        this.other = channel.side1;
        channel.learn(r, c, guess, last);
      });
    }
  }

  /** Takes the number at a place for that of a channel in row r. */
  echo(channels, channel, r, place, minus, nChannels, firstIndex) {
    const row = Math.floor(place / channels.length);
    const { column } = channels[place % channels.length];
    const o = this.ordinals[firstIndex + row * nChannels + column];
    this.ordinals[firstIndex + r * nChannels + channel.column] = minus ? -1n - o : o;
    channel.steps[0] = 0;
  }

  number(channel, index, predicted) {
    if (channel.isPlain) this.plainOf(channel, index, predicted);
    else this.digits(channel, index, clamp(predicted, -channel.limit, channel.limit));
  }

  /** A number in classes, counted in units of its last digit. */
  digits(channel, index, predicted) {
    const { fast, slow, powers, nDigits, limit } = channel;
    const s = Math.abs(predicted);
    const bound = Math.min(s + Math.floor(slow / 2), limit);
    const u = Math.max(guessed(channel, bound) - nDigits, 0);
    const power = powers[u];
    const h = Math.floor((s + Math.floor(power / 2)) / power);
    const f = Math.floor(fast / power);
    const g = Math.floor(slow / power);
    const q = (predicted < 0 ? -h : h) + this.residual(channel, false, f, g);
    if (q === 0) this.small(channel, index, predicted, u);
    else this.large(channel, index, predicted, u, q);
  }

  /** A number below the unit. */
  small(channel, index, predicted, u) {
    const { coder, model } = this;
    const zero = model.adaptive(coder, ZERO + (channel.last === 0 ? 1 : 0));
    const minus = model.adaptive(coder, MINUS + (predicted < 0 ? 1 : 0));
    if (zero) {
      this.remember(channel, 0, predicted);
      setHalves(this.halves, index, -minus, -minus);
      return;
    }
    let t = 0;
    while (model.adaptive(coder, DOWN + t)) {
      t++;
      if (t > 12) throw new Refused("best: a number more than 4095 classes below the unit");
    }
    const c = u - (t === 0 ? 0 : 2 ** (t - 1) + coder.number(t - 1));
    const lead = channel.decimal ? this.digit() : 1;
    const m = lead * channel.least + this.below(channel, channel.nDigits - 1);
    if (m < channel.least) throw new Refused("best: a mantissa that begins with 0");
    this.accept(channel, index, predicted, minus === 1, c, m);
  }

  /** A number of q units. */
  large(channel, index, predicted, u, q) {
    const { powers, nDigits } = channel;
    const count = Math.abs(q);
    const c = guessed(channel, count) + u;
    const j = c - nDigits - u;
    let m;
    if (j >= 0) {
      if (count % powers[j] !== 0) throw new Refused(`best: ${q} units of a greater class`);
      m = count / powers[j];
    } else {
      m = count * powers[-j] + this.below(channel, -j);
    }
    this.accept(channel, index, predicted, q < 0, c, m);
  }

  accept(channel, index, predicted, minus, c, m) {
    const k = c - channel.width + channel.top;
    if (!(k >= 0 && k <= channel.top)) {
      throw new Refused(`best: class ${k} of 0 to ${channel.top}`);
    }
    this.take(channel, index, minus, k, m, predicted);
  }

  digit() {
    const { coder } = this;
    return coder.decode(EIGHT_OR_NINE) ? 8 + coder.number(1) : coder.number(3);
  }

  /** n digits, each as likely as any. */
  below(channel, n) {
    if (!channel.decimal) return this.coder.number(n);
    let found = 0;
    for (let i = 0; i < n; i++) found += this.digit() * channel.powers[i];
    return found;
  }
}
