// SPEC.md, "Held contacts": when points stand, how they move, and how far they are to be shifted.

import { Model, clamp } from "./entropy.js";
import { Refused } from "./errors.js";
import { readNumber } from "./pose-head.js";
import { DisplacementModel, N_FEATURES } from "./pose-displacements.js";

// Contexts; those of numbers come first.
const FAST = 492;
const SLOW = 748;
const OTHER = 1004;
const SIGN = 1260;
const MOVED = 1268;
const N_CONTEXTS = 1269;
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

// What a number says: counts, frames, lengths, starts, what is too large.
const [COUNT, GAP, LENGTH, START, ESCAPE] = [0, 1, 2, 3, 4];

const GREATEST = 2 ** 30;
const START_UNITS = 16;
const MAX_UNARY = 16;
const MOST = 4096;
const MAX_POINTS = 8;
const MAX_ROUNDS = 6;
const MAX_RAMP = 64;
const GREATEST_STEP = 2 ** 60;

/** What a point does in a frame of a segment. */
export const LEANS = 1;
export const STANDS = 2;

const limited = (x) => clamp(x, -MOST, MOST);

/**
 * @param {import("./bytes.js").ByteReader} reader at CONTACTS
 * @param {import("./skel.js").Skeleton} skeleton
 * @returns {{rounds: number, ramp: number, points: object[]}}
 * @throws {Refused}
 */
export function readContacts(reader, skeleton) {
  const rounds = reader.u8();
  if (rounds < 1 || rounds > MAX_ROUNDS) reader.refuse(`${rounds} rounds`);
  const ramp = reader.u8();
  if (ramp > MAX_RAMP) reader.refuse(`a ramp of ${ramp} frames`);
  let number = 0;
  const points = reader.counted(() => readPoint(reader, skeleton, number++));
  if (points.length < 1 || points.length > MAX_POINTS) reader.refuse(`${points.length} points`);
  return { rounds, ramp, points };
}

function readPoint(reader, { joints }, number) {
  const joint = reader.varint();
  if (joint >= joints.length) reader.refuse(`joint ${joint} of ${joints.length}`);
  const tail = reader.varint();
  if (tail > joints[joint].tails.length) reader.refuse(`tail ${tail} of joint ${joint}`);
  const step = reader.f32();
  if (!(step >= 1 / GREATEST_STEP && step <= GREATEST_STEP)) reader.refuse(`a step of ${step}`);
  const follows = reader.varint();
  if (follows > number) reader.refuse(`point ${number + 1} follows point ${follows}`);
  return { joint, tail, step, follows };
}

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
 * Decodes the contacts of a segment.
 *
 * @param {import("./entropy.js").RangeDecoder} coder which has decoded the rows
 * @param {{ramp: number, points: object[]}} contacts of the header
 * @param {Float64Array[]} places of each point in all frames
 * @param {string} what names the segment in messages
 * @returns {{shifts: Float64Array, active: Uint8Array}[]} of each point how far it is to be from
 *   its places, and in which frames it leans or stands
 * @throws {Refused}
 */
export function decodeShifts(coder, contacts, places, what) {
  const reader = new ContactReader(coder, contacts.ramp, what);
  const tracks = [];
  contacts.points.forEach((point, k) => {
    tracks.push(reader.point(point, places[k], tracks[point.follows - 1]));
  });
  return tracks;
}

class ContactReader {
  constructor(coder, ramp, what) {
    Object.assign(this, { coder, ramp, what });
    this.model = startModel();
    this.axes = [0, 1, 2].map(() => new DisplacementModel());
    this.fast = new Float64Array(3).fill(2);
    this.slow = new Float64Array(3).fill(2);
  }

  coded(own) {
    return readNumber(this.coder, this.model, 0, own, this.what);
  }

  refuse(message) {
    throw new Refused(`${this.what}, contacts: ${message}`);
  }

  point({ step }, places, leader) {
    const nFrames = places.length / 3;
    const track = { shifts: new Float64Array(places.length), active: new Uint8Array(nFrames) };
    track.begins = new Uint8Array(nFrames);
    const spans = [];
    const count = this.coded(COUNT);
    if (count < 0 || count > nFrames) this.refuse(`${count} of a point`);
    let before = 0;
    for (let i = 0; i < count; i++) {
      const span = this.contact(step, places, leader, before, track);
      spans.push(span);
      before = span.stop;
    }
    lean(spans, this.ramp, track);
    return track;
  }

  /** A contact not before a frame. */
  contact(step, places, leader, before, track) {
    const nFrames = places.length / 3;
    const first = before + this.coded(GAP);
    const length = 1 + this.coded(LENGTH);
    if (first < before || length < 1 || first + length > nFrames) {
      this.refuse(`frames ${first} to ${first + length - 1} of ${nFrames}`);
    }
    const moved = this.model.adaptive(this.coder, MOVED) === 1;
    const S = moved ? [this.coded(START), this.coded(START), this.coded(START)] : [0, 0, 0];
    if (S.some((x) => Math.abs(x) > GREATEST)) this.refuse(`a start of ${S}`);
    const D = this.displacements(step, places, leader, { first, length, S });
    for (let t = 0; t < length; t++) {
      const f = first + t;
      track.active[f] = STANDS;
      for (let i = 0; i < 3; i++) {
        const start = places[3 * first + i] + (S[i] / START_UNITS) * step;
        track.shifts[3 * f + i] = start + D[t][i] * step - places[3 * f + i];
      }
    }
    track.begins[first] = 1;
    return { first, stop: first + length, moved: S.some((x) => x !== 0) };
  }

  /** D: of each frame of a contact by how many steps the point has moved since the first. */
  displacements(step, places, leader, { first, length, S }) {
    const last = places.length / 3 - 1;
    const q = (f, i) => places[3 * clamp(f, 0, last) + i] / step;
    const D = [[0, 0, 0]];
    const x = new Float64Array(N_FEATURES);
    for (let t = 1; t < length; t++) {
      const f = first + t;
      const leads = leader && leader.active[f] === STANDS && !leader.begins[f];
      this.axes.forEach((axis, i) => {
        const v = (b) => (t < b + 1 ? 0 : D[t - b][i] - D[t - b - 1][i]);
        for (let b = 0; b < 3; b++) {
          x[b] = limited(v(b + 1));
          x[3 + b] = limited(q(f + b - 1, i) - q(f + b - 2, i));
        }
        x[6] = limited(q(first, i) + S[i] / START_UNITS + D[t - 1][i] - q(f - 1, i));
        x[7] = 0;
        x[8] = 0;
        if (leads) {
          const [now, then] = [leader.shifts[3 * f + i], leader.shifts[3 * f - 3 + i]];
          x[7] = limited((now - then) / step);
          x[8] = limited(then / step - x[6]);
        }
        axis.expect(x);
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
    for (let i = 0; i < 3; i++) {
      const e = axes[i].mean + before[i];
      const u = i === 0 ? 1 : 2;
      const c = i === 0 ? Math.floor(e + 0.5) : 2 * Math.floor((e - odd) * 0.5 + 0.5) + odd;
      const side = Math.floor(((e - c) * 4) / u) + 2;
      const r = this.residual(fast[i], slow[i], other, side);
      D[i] = c + u * r;
      if (Math.abs(D[i]) > GREATEST) this.refuse(`a displacement of ${D[i]}`);
      odd = Math.abs(D[0] % 2);
      const z = Math.min(Math.abs(r), 1024);
      other = i === 0 ? z : 0.5 * (other + z);
      fast[i] += (z - fast[i]) * 0.25;
      slow[i] += (z - slow[i]) * 0.03125;
      axes[i].learn(D[i] - before[i]);
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
      if (more < 0 || more >= GREATEST) this.refuse(`a residual of ${more} more`);
      n += more;
    }
    if (n === 0) return 0;
    return model.adaptive(coder, SIGN + side) ? -n : n;
  }
}

/** Lets a point lean to each of its contacts in the frames around it. */
function lean(spans, ramp, { shifts, active }) {
  const add = (f, end, share) => {
    if (f < 0 || f >= active.length) return;
    active[f] = LEANS;
    for (let i = 0; i < 3; i++) shifts[3 * f + i] += share * shifts[3 * end + i];
  };
  spans.forEach(({ first, stop, moved }, at) => {
    const back = at > 0 ? Math.min(ramp, first - spans[at - 1].stop) : ramp;
    const on = at + 1 < spans.length ? Math.min(ramp, spans[at + 1].first - stop) : ramp;
    if (moved) for (let n = 1; n <= back; n++) add(first - n, first, 1 - n / (back + 1));
    for (let n = 1; n <= on; n++) add(stop - 1 + n, stop - 1, 1 - n / (on + 1));
  });
}
