// SPEC.md, "Held contacts": points that keep their places, frame by frame.

import { Model, clamp } from "./entropy.js";
import { Refused } from "./errors.js";
import { readNumber } from "./pose-head.js";

// Contexts; those of numbers come first.
const FAST = 492;
const SLOW = 748;
const OTHER = 1004;
const SIGN = 1260;
const USUAL = 1268;
const FINE = 1269;
const N_CONTEXTS = 1270;
const N_MIXERS = 16;
const N_CLASSES = 16;
const FIRST_COUNT = 8;

/** What the contexts of the first decision of each class begin with, and those of the others. */
// prettier-ignore
const FIRST = [
  3840, 7424, 11008, 15616, 21760, 29184, 36864, 44544, 50688, 55296, 58624, 60928, 62464, 63488,
  64256, 64512,
];
// prettier-ignore
const LATER = [
  2048, 4096, 5888, 8960, 13056, 18688, 25856, 33536, 41216, 47872, 52992, 56832, 59648, 61440,
  62720, 63744,
];

// What a number says: counts, frames, lengths, anchors, what is too large.
const [COUNT, START, LENGTH, ANCHOR, ESCAPE] = [0, 1, 2, 3, 4];

const MAX_ANCHOR = 2 ** 30;
const USUAL_FRAMES = 8;
const MAX_UNARY = 16;
const MOST = 4096;
const N_FEATURES = 7;
const MEMORY = 255 / 256;
const RIDGE = 64;
const USUAL_WEIGHTS = [0.4375, -0.3125, 0.15625, 0.4375, 0.3125, -0.0625, -0.3125];

const limited = (x) => clamp(x, -MOST, MOST);

function startModel() {
  const model = Model.even(N_CONTEXTS, N_MIXERS);
  for (const first of [FAST, SLOW, OTHER]) {
    for (let k = 0; k < N_CLASSES; k++) {
      for (let i = 0; i < MAX_UNARY; i++) {
        const context = first + MAX_UNARY * k + i;
        model.probabilities[context] = (i === 0 ? FIRST : LATER)[k];
        model.counts[context] = FIRST_COUNT;
      }
    }
  }
  return model;
}

/** The class of a mean size. */
function classOf(size) {
  let k = 0;
  for (let b = 0.1; size > b && k < N_CLASSES - 1; b *= 1.5) k++;
  return k;
}

/**
 * Decodes the contacts of a segment, and corrects its frames.
 *
 * @param {import("./entropy.js").RangeDecoder} coder which has decoded the rows
 * @param {{rounds: number, limbs: object[]}} contacts of the header
 * @param {Float64Array} values of all frames of the segment, changed in place
 * @param {number} nChannels
 * @param {string} what names the segment in messages
 * @throws {Refused}
 */
export function holdContacts(coder, contacts, values, nChannels, what) {
  const reader = new ContactReader(coder, contacts.rounds, values, nChannels, what);
  for (const limb of contacts.limbs) reader.limb(limb);
}

class ContactReader {
  constructor(coder, rounds, values, nChannels, what) {
    Object.assign(this, { coder, rounds, values, nChannels, what });
    this.nFrames = values.length / nChannels;
    this.model = startModel();
    this.axes = [0, 1, 2].map(() => new Predictor());
    this.fast = new Float64Array(3).fill(2);
    this.slow = new Float64Array(3).fill(2);
  }

  coded(own) {
    return readNumber(this.coder, this.model, 0, own, this.what);
  }

  refuse(message) {
    throw new Refused(`${this.what}, contacts: ${message}`);
  }

  limb(limb) {
    const count = this.coded(COUNT);
    if (count < 0 || count > this.nFrames) this.refuse(`${count} of a limb`);
    let before = 0;
    for (let i = 0; i < count; i++) before = this.contact(limb, before);
  }

  /** A contact not before a frame; returns the frame behind it. */
  contact(limb, before) {
    const { coder, model, nFrames } = this;
    const first = before + this.coded(START);
    const length = 1 + this.coded(LENGTH);
    if (first < before || length < 1 || first + length > nFrames) {
      this.refuse(`frames ${first} to ${first + length - 1} of ${nFrames}`);
    }
    let lead = USUAL_FRAMES;
    let fade = USUAL_FRAMES;
    if (!model.adaptive(coder, USUAL)) {
      lead = coder.number(4);
      fade = coder.number(4);
    }
    const unit = (model.adaptive(coder, FINE) ? 1 / 16 : 4) * limb.step;
    const anchor = [this.coded(ANCHOR), this.coded(ANCHOR), this.coded(ANCHOR)];
    if (anchor.some((x) => Math.abs(x) > MAX_ANCHOR)) this.refuse(`an anchor of ${anchor}`);
    const place = this.place(limb, first);
    const A = anchor.map((x, k) => place[k] + x * unit);
    const D = this.displacements(limb, first, length, A);
    this.correct(limb, first, length, { A, D, lead, fade });
    return first + length;
  }

  place(limb, frame) {
    const at = clamp(frame, 0, this.nFrames - 1) * this.nChannels;
    return limb.place(this.values, at);
  }

  /** D: of each frame of a contact by how many steps the point is away from its anchor place. */
  displacements(limb, first, length, A) {
    const { step } = limb;
    const q = [];
    // q[t + 1] is where the point is in frame t of the contact, in steps.
    for (let t = -1; t <= length; t++) q.push(this.place(limb, first + t).map((x) => x / step));
    const a = A.map((x) => x / step);
    const D = [[0, 0, 0]];
    for (let t = 1; t < length; t++) {
      this.axes.forEach((axis, k) => {
        const v = (b) => (t < b + 1 ? 0 : D[t - b][k] - D[t - b - 1][k]);
        axis.expect([
          ...[v(1), v(2), v(3)],
          ...[q[t][k] - q[t - 1][k], q[t + 1][k] - q[t][k], q[t + 2][k] - q[t + 1][k]],
          a[k] + D[t - 1][k] - q[t][k],
        ]);
      });
      D.push(this.displacement(D[t - 1]));
    }
    return D;
  }

  /** The displacement after another; all three of its numbers are odd, or all are even. */
  displacement(before) {
    const { axes, fast, slow } = this;
    const D = [0, 0, 0];
    let other = 0;
    let odd = 0;
    for (let k = 0; k < 3; k++) {
      const e = axes[k].mean + before[k];
      const u = k === 0 ? 1 : 2;
      const c = k === 0 ? Math.floor(e + 0.5) : 2 * Math.floor((e - odd) * 0.5 + 0.5) + odd;
      const side = Math.floor(((e - c) * 4) / u) + 2;
      const r = this.residual(fast[k], slow[k], other, side);
      D[k] = c + u * r;
      if (Math.abs(D[k]) > MAX_ANCHOR) this.refuse(`a displacement of ${D[k]}`);
      odd = Math.abs(D[0] % 2);
      const z = Math.min(Math.abs(r), 1024);
      other = k === 0 ? z : 0.5 * (other + z);
      fast[k] += (z - fast[k]) * 0.25;
      slow[k] += (z - slow[k]) * 0.03125;
      axes[k].learn(D[k] - before[k]);
    }
    return D;
  }

  residual(fast, slow, other, side) {
    const { coder, model } = this;
    const a = FAST + MAX_UNARY * classOf(fast);
    const b = SLOW + MAX_UNARY * classOf(slow);
    const c = OTHER + MAX_UNARY * classOf(other);
    let n = 0;
    while (n < MAX_UNARY && model.mixed(coder, n, a + n, b + n, c + n)) n++;
    if (n === MAX_UNARY) {
      const more = this.coded(ESCAPE);
      if (more < 0 || more >= MAX_ANCHOR) this.refuse(`a residual of ${more} more`);
      n += more;
    }
    if (n === 0) return 0;
    return model.adaptive(coder, SIGN + side) ? -n : n;
  }

  /** Puts the point where it is to be, and leads values in and out. */
  correct(limb, first, length, { A, D, lead, fade }) {
    const { values, nChannels, nFrames, rounds } = this;
    const c = new Float64Array(limb.columns.length);
    let cFirst = c;
    for (let t = 0; t < length; t++) {
      const target = A.map((x, k) => x + D[t][k] * limb.step);
      limb.reach(values, (first + t) * nChannels, c, target, rounds);
      if (t === 0) cFirst = c.slice();
      this.add(limb, first + t, c, 1);
    }
    for (let n = 1; n <= lead && first - n >= 0; n++) {
      this.add(limb, first - n, cFirst, 1 - n / (lead + 1));
    }
    const last = first + length - 1;
    for (let n = 1; n <= fade && last + n < nFrames; n++) {
      this.add(limb, last + n, c, 1 - n / (fade + 1));
    }
  }

  add({ columns }, frame, c, share) {
    const at = frame * this.nChannels;
    columns.forEach((column, i) => (this.values[at + column] += c[i] * share));
  }
}

/** How displacements go on along an axis: least squares that forget. */
class Predictor {
  constructor() {
    this.w = Float64Array.from(USUAL_WEIGHTS);
    this.S = new Float64Array(N_FEATURES * N_FEATURES);
    this.P = new Float64Array(N_FEATURES);
    this.L = new Float64Array(N_FEATURES * N_FEATURES);
    this.d = new Float64Array(N_FEATURES);
    this.b = new Float64Array(N_FEATURES);
    this.x = new Float64Array(N_FEATURES);
    this.mean = 0;
  }

  /** Sets `mean`, how far the displacement is to move. */
  expect(features) {
    const { w, x } = this;
    let sum = 0;
    for (let i = 0; i < N_FEATURES; i++) {
      x[i] = limited(features[i]);
      sum += w[i] * x[i];
    }
    this.mean = limited(sum);
  }

  /** Learns how far it has moved. */
  learn(moved) {
    const { x, P, S } = this;
    let y = limited(moved);
    for (let i = 0; i < N_FEATURES; i++) y -= USUAL_WEIGHTS[i] * x[i];
    for (let i = 0; i < N_FEATURES; i++) {
      P[i] = P[i] * MEMORY + y * x[i];
      for (let j = 0; j <= i; j++) {
        S[i * N_FEATURES + j] = S[i * N_FEATURES + j] * MEMORY + x[i] * x[j];
      }
    }
    this.factor();
    this.solve();
  }

  /** S and a ridge as L d L'. */
  factor() {
    const { S, L, d } = this;
    for (let i = 0; i < N_FEATURES; i++) {
      for (let j = 0; j <= i; j++) {
        let s = S[i * N_FEATURES + j];
        if (i === j) s += RIDGE;
        for (let n = 0; n < j; n++) s -= L[i * N_FEATURES + n] * L[j * N_FEATURES + n] * d[n];
        if (i === j) d[i] = Math.max(s, RIDGE);
        else L[i * N_FEATURES + j] = s / d[j];
      }
    }
  }

  solve() {
    const { P, L, d, b, w } = this;
    for (let i = 0; i < N_FEATURES; i++) {
      b[i] = P[i];
      for (let n = 0; n < i; n++) b[i] -= L[i * N_FEATURES + n] * b[n];
    }
    for (let i = N_FEATURES - 1; i >= 0; i--) {
      b[i] /= d[i];
      for (let n = i + 1; n < N_FEATURES; n++) b[i] -= L[n * N_FEATURES + i] * b[n];
    }
    for (let i = 0; i < N_FEATURES; i++) w[i] = b[i] + USUAL_WEIGHTS[i];
  }
}
