// SPEC.md, "Codec 3: posewave": wavelets in time, in the metric of the pose.

import { AxisOrders, turnsOf } from "../axis-orders.js";
import { ByteReader } from "../bytes.js";
import { RangeDecoder } from "../entropy.js";
import { Refused } from "../errors.js";
import { decodeShifts, readContacts } from "../pose-contacts.js";
import { readHead } from "../pose-head.js";
import { Holder } from "../pose-holding.js";
import { Pyramid, Walk } from "../pose-levels.js";
import { RowDecoder } from "../pose-rows.js";
import { priorOf } from "../pose-prior.js";
import { VECTOR } from "../pose-metric.js";
import { HEAD, startTable } from "../pose-start.js";
import { stepOf } from "../scales.js";
import { decodeAlone } from "./fast.js";

export const id = 3;
export const name = "posewave";
export const version = 1;

/** Bits of the flags. */
const REFINING = 1;
const WHOLE_TURNS = 2;
const VECTORS = 4;
const DEPENDENT = 8;

const MAX_LEVELS = 8;
const MAX_SHELL = 16;
const SPREADS = 32;
const MAX_FINE = 24;
const START_TABLES = 16;
const MAX_START = 1;
const GREATEST_LENGTH = 2 ** 60;

/** Kinds of channels of the registry, where positions, rotations and others begin. */
const TX = 1;
const RX = 4;
const SX = 7;
const VX = 15;

/** From so many joints on that a rotation moves its class is another. */
const MANY = [2, 4, 8];

/** Kinds of channels. */
const ROTATION = 0;
const POSITION = 1;
const PLAIN = 2;

/**
 * Opens a signal.
 *
 * @param {Uint8Array} header POSEWAVE_HEADER
 * @param {object} layout the signal, as CLIP has it
 * @param {number} codecVersion 0 or 1
 * @returns {PoseDecoder}
 * @throws {Refused} for a header, or a signal, that the codec does not have
 */
export function open(header, layout, codecVersion) {
  const { skeleton, groups, nResolutions, samplesPerFrame } = layout;
  if (samplesPerFrame !== 1) throw new Refused(`${name}: ${samplesPerFrame} rows a frame`);
  if (skeleton === null) throw new Refused(`${name}: channels that are not those of the skeleton`);
  const fields = readHeader(header, skeleton, groups);
  if (fields.whole && codecVersion < 1) throw new Refused(`${name}: whole turns in version 0`);
  if (groups.length > 1 && fields.exactGroups.length === 0) {
    throw new Refused(`${name}: ${groups.length} groups`);
  }
  if (nResolutions > fields.levels + 1) {
    throw new Refused(`${name}: ${nResolutions} resolutions of ${fields.levels} levels`);
  }
  return new PoseDecoder(fields, layout);
}

function readHeader(bytes, skeleton, groups) {
  const { channels, joints } = skeleton;
  const reader = new ByteReader(bytes, "POSEWAVE_HEADER");
  const levels = upTo(reader, MAX_LEVELS, "levels");
  const borrowing = upTo(reader, levels, "borrowed levels");
  const [start, prior] = readStart(reader, channels.length);
  const flags = upTo(reader, REFINING | WHOLE_TURNS | VECTORS | DEPENDENT, "as flags");
  const refining = (flags & REFINING) !== 0;
  const whole = (flags & WHOLE_TURNS) !== 0;
  const dependent = (flags & DEPENDENT) !== 0;
  const step = reader.f32();
  if (!(step >= 1 / GREATEST_LENGTH && step <= GREATEST_LENGTH)) reader.refuse(`a step of ${step}`);
  const radius = reader.f32();
  if (!(radius >= 0 && radius <= GREATEST_LENGTH)) reader.refuse(`a radius of ${radius}`);
  const shares = reader.u8();
  const shell = shares % SPREADS;
  if (shell > MAX_SHELL) reader.refuse(`${shell} sixteenths`);
  const kappa = shell / MAX_SHELL;
  const spread = shares < SPREADS ? 0 : 2 ** (Math.floor(shares / SPREADS) - 10);
  const steps = [stepOf(reader.u8()), stepOf(reader.u8())];
  const first = upTo(reader, MAX_FINE, "halvings");
  const constant = upTo(reader, MAX_FINE, "halvings");
  const kinds = Uint8Array.from(channels, (channel) => kindOf(channel, whole));
  const plain = readSteps(reader, kinds.filter((kind) => kind === PLAIN).length);
  const weights = readSteps(reader, joints.length);
  const orders = readOrders(reader, skeleton, (flags & VECTORS) !== 0);
  const exactGroups = readExact(reader, groups.length);
  const contacts = reader.counted(() => readContacts(reader, skeleton));
  if (contacts.length > 1) reader.refuse(`${contacts.length} times contacts`);
  if (contacts.length > 0 && exactGroups.length > 0) reader.refuse("contacts and exact groups");
  reader.end();
  let at = 0;
  const greatest = Float64Array.from(kinds, (kind) => steps[kind] ?? plain[at++]);
  const firstStep = greatest.map((x) => x * 2 ** -first);
  const constantStep = firstStep.map((x) => x * 2 ** -constant);
  return {
    ...{ levels, borrowing, start, prior, refining, whole, dependent },
    ...{ step, radius, kappa, spread, weights, orders },
    axisOrders: new AxisOrders(skeleton, orders),
    ...{ kinds, greatest, firstStep, constantStep, exactGroups },
    exactColumns: new Set(exactGroups.flatMap((g) => groups[g])),
    contacts: contacts[0] ?? null,
    classes: classesOf(joints, whole),
  };
}

function upTo(reader, most, what) {
  const value = reader.u8();
  if (value > most) reader.refuse(`${value} ${what}`);
  return value;
}

/** What counted step codes stand for, of `due` things; all are 1 where there are none. */
function readSteps(reader, due) {
  const codes = reader.take(reader.varint());
  if (codes.length !== 0 && codes.length !== due) reader.refuse(`${codes.length} codes of ${due}`);
  return codes.length > 0 ? Array.from(codes, stepOf) : new Array(due).fill(1);
}

/** The number of a start table, and a prior for so many channels, or null. */
function readStart(reader, nChannels) {
  const byte = reader.u8();
  const start = byte % START_TABLES;
  if (start > MAX_START) reader.refuse(`${start} is a start table`);
  const number = Math.floor(byte / START_TABLES);
  if (number === 0) return [start, null];
  const prior = priorOf(number);
  if (prior === null) reader.refuse(`prior ${number}`);
  if (prior.variances.length !== nChannels) reader.refuse(`prior ${number}: ${nChannels} channels`);
  return [start, prior];
}

/** The codes of axis orders of all joints, 0 where they have none; `vectors`: most are vectors. */
function readOrders(reader, skeleton, vectors) {
  const { joints } = skeleton;
  const mayTurn = joints.map((joint) => turnsOf(joint, skeleton) !== null);
  const codes = Uint8Array.from(joints, ({ parent }, j) =>
    vectors && mayTurn[j] && parent >= 0 ? VECTOR : 0,
  );
  let last = -1;
  reader.counted(() => {
    const joint = reader.varint();
    if (joint <= last || joint >= joints.length) reader.refuse(`an axis order of joint ${joint}`);
    if (!mayTurn[joint]) reader.refuse(`an axis order of joint ${joint}, which can have none`);
    codes[joint] = upTo(reader, VECTOR, "is an axis order");
    last = joint;
  });
  return codes;
}

/** The numbers of exact groups, of so many. */
function readExact(reader, nGroups) {
  const numbers = reader.counted(() => reader.varint());
  numbers.forEach((number, i) => {
    if (i > 0 && number <= numbers[i - 1]) reader.refuse("exact groups that do not ascend");
    if (number >= nGroups) reader.refuse(`exact group ${number} of ${nGroups}`);
  });
  return numbers;
}

function kindOf({ kind }, whole) {
  if (kind >= TX && kind < RX) return POSITION;
  if (whole && kind >= VX && kind < VX + 3) return ROTATION;
  return kind >= RX && kind < SX ? ROTATION : PLAIN;
}

/**
 * What each channel is to the model of rows: a rotation of a root 1, of another joint 2 to 5, by how
 * many joints it moves; any other channel 0.
 *
 * @param {import("../skel.js").Joint[]} joints
 * @param {boolean} whole whether rotation vectors are rotations
 * @returns {Uint8Array}
 */
function classesOf(joints, whole) {
  const moved = new Array(joints.length).fill(1);
  for (let j = joints.length - 1; j >= 0; j--) {
    const { parent } = joints[j];
    if (parent >= 0) moved[parent] += moved[j];
  }
  return Uint8Array.from(
    joints.flatMap(({ parent, channels }, j) => {
      const own = parent < 0 ? 1 : 2 + MANY.filter((many) => moved[j] >= many).length;
      return channels.map((channel) => (kindOf(channel, whole) === ROTATION ? own : 0));
    }),
  );
}

/** The decoder of one signal. */
class PoseDecoder {
  constructor(header, layout) {
    this.decodes = "values";
    const { groups, skeleton, nResolutions } = layout;
    const { exactGroups, exactColumns } = header;
    /** Whether a segment may go on where the one before it ended. */
    this.mayGoOn = header.levels === 0 && header.orders.every((code) => code === 0);
    if (header.contacts !== null || exactGroups.length > 0) this.mayGoOn = false;
    this.alone = !this.mayGoOn;
    this.header = header;
    this.layout = layout;
    /** The columns of exact channels, of which `ordinals` are decoded, and no values. */
    this.exactColumns = [...exactColumns];
    this.lossyGroups = [...groups.keys()].filter((g) => !exactGroups.includes(g));
    this.skeleton = skeleton;
    this.nResolutions = nResolutions;
  }

  /**
   * What must hold of all stored segments, also of those that are not decoded.
   *
   * @param {object[]} segments
   * @throws {Refused}
   */
  check(segments) {
    for (const { firstFrame, lead, tail, fresh } of segments) {
      const where = `segment at frame ${firstFrame}`;
      if (lead !== 0 || tail !== 0) throw new Refused(`${where}: has a lead or tail`);
      if (!fresh && !this.mayGoOn) throw new Refused(`${where}: does not start fresh`);
    }
  }

  /**
   * The ordinals of exact channels.
   *
   * @param {object[]} segments with their streams
   * @param {{dropped: number}} options how many of the finest resolutions are left out
   * @returns {BigInt64Array} the rows of all these segments; 0 in the columns of others
   * @throws {Refused}
   */
  ordinals(segments, { dropped }) {
    const { exactGroups } = this.header;
    for (const { firstFrame, streams } of segments) {
      const details = streams.slice(1, this.nResolutions - dropped);
      if (details.some((own) => exactGroups.some((g) => own[g].length > 0))) {
        throw new Refused(`${name}: segment at frame ${firstFrame}: details of an exact group`);
      }
    }
    return decodeAlone(this.layout, segments, exactGroups);
  }

  /**
   * Decodes segments, of which the first one starts fresh.
   *
   * @param {object[]} segments with their streams
   * @param {{dropped: number}} options how many of the finest resolutions are left out
   * @returns {Float64Array} the rows of all these segments; in exact columns anything
   * @throws {Refused}
   */
  decode(segments, { dropped }) {
    const nChannels = this.skeleton.channels.length;
    const nRows = segments.reduce((sum, { nFrames }) => sum + nFrames, 0);
    const out = new Float64Array(nRows * nChannels);
    const [lossy, ...others] = this.lossyGroups;
    if (lossy === undefined) return out;
    let at = 0;
    let before = null;
    for (const { firstFrame, nFrames, streams, fresh } of segments) {
      const stored = streams.slice(0, this.nResolutions - dropped);
      const given = stored.map((own) => own[lossy]);
      const what = `${name}: segment at frame ${firstFrame}`;
      if (stored.some((own) => others.some((g) => own[g].length > 0))) {
        throw new Refused(`${what}: a stream of a lossy group that is not the first`);
      }
      const values = out.subarray(at, at + nFrames * nChannels);
      if (fresh) before = this.segment(given, nFrames, values, what);
      else this.goOn(before, given[0], nFrames, values, what);
      at += values.length;
    }
    return out;
  }

  /** Decodes a segment from the streams that are there, the coarsest first; returns what it leaves. */
  segment(given, nFrames, out, what) {
    const { header, skeleton } = this;
    const pyramid = new Pyramid(nFrames, header);
    const streams = this.streamsOfLevels(given, pyramid, what);
    const start = startTable(header.start);
    const model = start.small.copy();
    const reader = new ByteReader(streams[0], what);
    const notes = header.axisOrders.takeNotes(reader, nFrames);
    const coder = new RangeDecoder(reader.rest());
    const { first, kept } = this.head(coder, model, what);
    fillRows(out, first);
    let left = { first, kept };
    if (kept.length > 0) {
      const rows = new RowDecoder(header, kept, model, start);
      const walk = new Walk(header, skeleton, pyramid, kept, first);
      left = { first: first.slice(), kept, rows, walk };
      const rest = this.levels(coder, streams, rows, walk, what);
      putColumns(walk.signal, kept, out);
      if (rest) this.hold(rest, walk, out, what);
    } else {
      coder.finish(what);
      if (streams.slice(1).some(({ length }) => length > 0)) {
        throw new Refused(`${what}: rows of no channel`);
      }
    }
    header.axisOrders.restore(out, skeleton.channels.length, notes);
    return left;
  }

  /** Decodes a segment that goes on after one that has left its rows and its walk. */
  goOn({ first, kept, rows, walk }, stream, nFrames, out, what) {
    fillRows(out, first);
    const coder = new RangeDecoder(stream);
    if (kept.length > 0) walk.approximations(rows.goOn(coder, nFrames, what));
    coder.finish(what);
    if (kept.length > 0) putColumns(walk.signal, kept, out);
  }

  /**
   * Decodes the rows of all levels, the first of them with `coder`, which has decoded the head.
   * Returns the coder of contacts that follow the last, or null.
   */
  levels(coder, streams, rows, walk, what) {
    const { pyramid } = walk;
    let rest = null;
    for (let level = 0; level <= pyramid.nDetails; level++) {
      const where = `${what}, level ${level}`;
      let decoded = null;
      if (level < streams.length) {
        const own = level === 0 ? coder : new RangeDecoder(streams[level]);
        decoded = rows.decode(own, level, pyramid.kind(level), pyramid.nRows(level), where);
        if (level === pyramid.nDetails && this.header.contacts) rest = own;
        else own.finish(where);
      }
      if (level === 0) walk.approximations(decoded);
      else walk.details(level, decoded);
    }
    return rest;
  }

  /** Puts the points of contacts where they should be. */
  hold(coder, { metric, kept, greatest }, values, what) {
    const { contacts } = this.header;
    const nChannels = this.skeleton.channels.length;
    const holder = new Holder(contacts, this.skeleton, metric, kept, greatest);
    const tracks = decodeShifts(coder, contacts, holder.places(values, nChannels), what);
    coder.finish(`${what}, contacts`);
    for (let f = 0; f * nChannels < values.length; f++) {
      holder.correct(values.subarray(f * nChannels, (f + 1) * nChannels), f, tracks);
    }
  }

  /** The streams of levels 0, 1, ... that are there. */
  streamsOfLevels(given, { nDetails }, what) {
    const nEmpty = this.header.levels - nDetails;
    const empty = given.slice(1, 1 + nEmpty);
    if (empty.some(({ length }) => length > 0)) {
      throw new Refused(`${what}: a stream of a level that it has not`);
    }
    return [given[0], ...given.slice(1 + nEmpty)];
  }

  /** The first pose, and the columns of the kept channels. */
  head(coder, model, what) {
    const { kinds, firstStep, constantStep, exactColumns } = this.header;
    const { kept, numbers } = readHead(coder, model, HEAD, kinds, what);
    const first = numbers.map((x, c) => x * (kept[c] ? firstStep[c] : constantStep[c]));
    const columns = Int32Array.from(kept.keys()).filter(
      (c) => kept[c] === 1 && !exactColumns.has(c),
    );
    return { first, kept: columns };
  }
}

/** Fills the rows with one row. */
function fillRows(out, row) {
  for (let at = 0; at < out.length; at += row.length) out.set(row, at);
}

/** Puts rows of some columns into those of all. */
function putColumns(rows, columns, out) {
  const width = (out.length * columns.length) / rows.length;
  for (let from = 0, to = 0; from < rows.length; to += width) {
    for (let c = 0; c < columns.length; c++, from++) out[to + columns[c]] = rows[from];
  }
}
