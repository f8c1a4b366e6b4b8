// SPEC.md, "Template of arrays" and "The bytes of arrays": NPY and NPZ files, pickles.

import { ByteReader } from "./bytes.js";
import { crc32 } from "./crc32.js";
import { restoreStream } from "./deflate-streams.js";
import { LimitExceeded, Refused } from "./errors.js";
import { BINARY32, BINARY64 } from "./grids.js";
import { halvesOf, highHalf, lowHalf } from "./int64.js";

const TEXT = 0;
const OWN = 1;
const COUNT = 2;
const DATA = 3;
const CRC = 4;
const SIZE4 = 5;
const SIZE8 = 6;
const DEFLATE = 7;
const ROWS = 8;
const SIZE1 = 9;
const PART = 10;
const ITEMS = 11;
/** Bytes of the kinds that follow from other pieces. */
const SIZES = { [CRC]: 4, [SIZE4]: 4, [SIZE8]: 8, [SIZE1]: 1 };

const BIG_ENDIAN = 1;
const BY_COLUMNS = 2;

const LEAST_LIMIT = 2 ** 26;
const BYTES_PER_VALUE = 64;
const MAX_PIECES = 2 ** 16;
const MAX_RUNS = 2 ** 18;
const MAX_COLUMNS = 2 ** 22;
const TWO_32 = 2 ** 32;
const TWO_53 = 2 ** 53;

/** Types of numbers: the bytes of each, and how a number is put, see Words. */
const TYPES = [
  { size: 1, least: 0, greatest: 1, set: (view, at, v) => view.setUint8(at, v) },
  ...[1, 2, 4, 8].map((size) => integer(size, true)),
  ...[1, 2, 4, 8].map((size) => integer(size, false)),
  { size: 2, float: true, set: (view, at, v, le) => view.setUint16(at, half(v), le) },
  { size: 4, float: true, grid: BINARY32, set: (view, at, v, le) => view.setFloat32(at, v, le) },
  { size: 8, float: true, grid: BINARY64, set: (view, at, v, le) => view.setFloat64(at, v, le) },
];

function integer(size, signed) {
  const bits = 8 * size;
  const least = signed ? Math.max(-(2 ** (bits - 1)), -TWO_53) : 0;
  const greatest = Math.min(2 ** (signed ? bits - 1 : bits) - 1, TWO_53);
  const name = `set${size === 8 ? "Big" : ""}${signed ? "Int" : "Uint"}${bits}`;
  const number = size === 8 ? BigInt : Number;
  return { size, least, greatest, set: (view, at, v, le) => view[name](at, number(v), le) };
}

/**
 * Restores an NPY or NPZ file, or a pickle.
 *
 * @param {object} source of CLIP: template.data, detail
 * @param {object[]} signals all of them, decoded: see sources.js
 * @param {{frame: number, number: bigint}[]} numbers runs of frame numbers that grow by 1
 * @param {number} nFrames
 * @param {number} maxBytes the limit of the caller
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function restoreArrays(source, signals, numbers, nFrames, maxBytes) {
  const pieces = readPieces(source.template.data, source.detail);
  checkSpans(pieces);
  placeRows(pieces, signals, numbers, nFrames);
  const nValues = signals.reduce((sum, { nRows, nChannels }) => sum + nRows * nChannels, 0);
  const most = Math.min(maxBytes, Math.max(LEAST_LIMIT, BYTES_PER_VALUE * nValues));
  const nOfFile = countFilePieces(pieces);
  if (nOfFile < pieces.length) {
    startsOf(pieces, signals, most);
    for (const piece of pieces) {
      if (piece.kind !== DEFLATE) continue;
      const own = pieces.slice(piece.start, piece.stop);
      const inner = startsOf(own, signals, most);
      piece.text = restoreStream(piece.text, assemble(own, inner, signals).out);
    }
  }
  const starts = startsOf(pieces, signals, most);
  const { out, view } = assemble(pieces, starts, signals);
  const known = new Map();
  pieces.forEach(({ kind, start, stop }, k) => {
    if (kind !== CRC) return;
    if (!known.has(start)) known.set(start, new Map());
    const sums = known.get(start);
    if (!sums.has(stop)) sums.set(stop, crc32(out, starts[start], starts[stop]));
    view.setUint32(starts[k], sums.get(stop), true);
  });
  return out.subarray(0, starts[nOfFile]);
}

/** Gives each piece of a signal its rows, from `row` on `nRows`: those of the PART before it. */
function placeRows(pieces, signals, numbers, nFrames) {
  let part = null;
  for (const piece of pieces) {
    if (piece.kind === PART) {
      if (piece.start > piece.stop) throw new Refused("arrays: a PART that ends before it begins");
      part = [piece.start, piece.stop].map((number) => countBefore(number, numbers, nFrames));
    }
    if (![COUNT, DATA, ROWS, ITEMS].includes(piece.kind)) continue;
    const decoded = signals[piece.signal];
    if (!decoded) throw new Refused(`arrays: signal ${piece.signal} of ${signals.length}`);
    const [first, stop] = part ?? [0, nFrames];
    const perFrame = nFrames === 0 ? 0 : decoded.nRows / nFrames;
    piece.row = first * perFrame;
    piece.nRows = (stop - first) * perFrame;
  }
}

/** How many frames have a number less than `limit`. */
function countBefore(limit, numbers, nFrames) {
  let [low, high] = [0, numbers.length]; // the runs that begin below it
  while (low < high) {
    const middle = (low + high) >> 1;
    if (Number(numbers[middle].number) < limit) low = middle + 1;
    else high = middle;
  }
  if (low === 0) return 0;
  const { frame, number } = numbers[low - 1];
  return Math.min(frame + limit - Number(number), numbers[low]?.frame ?? nFrames);
}

/** The number of pieces that are the file: the others are contents of DEFLATE pieces. */
function countFilePieces(pieces) {
  const starts = pieces.filter(({ kind }) => kind === DEFLATE).map(({ start }) => start);
  return starts.reduce((least, start) => Math.min(least, start), pieces.length);
}

/** The offset of each piece, and the size of all. */
function startsOf(pieces, signals, most) {
  const starts = [0];
  for (const piece of pieces) starts.push(starts[starts.length - 1] + sizeOf(piece, signals));
  const size = starts[pieces.length];
  if (size > most) throw new LimitExceeded(`a file of arrays of ${size} bytes, limit ${most}`);
  return starts;
}

/** The bytes of all pieces but CRC. */
function assemble(pieces, starts, signals) {
  const out = new Uint8Array(starts[pieces.length]);
  const view = new DataView(out.buffer);
  pieces.forEach((piece, k) => put(out, view, starts, piece, starts[k], signals));
  return { out, view };
}

function readPieces(template, detail) {
  const own = new ByteReader(detail, "the detail of arrays");
  const parts = own.counted(() => own.sized());
  own.end();
  const reader = new ByteReader(template, "a template of arrays");
  const left = { pieces: MAX_PIECES, runs: MAX_RUNS };
  const pieces = reader.counted(() => {
    if (left.pieces-- === 0) reader.refuse(`more than ${MAX_PIECES} pieces`);
    return readPiece(reader, left);
  });
  reader.end();
  checkColumns(pieces);
  let used = 0;
  for (const piece of pieces) {
    if (piece.kind === OWN || piece.kind === DEFLATE) piece.text = parts[used++];
  }
  if (used !== parts.length) own.refuse(`${parts.length} parts of ${used} pieces`);
  return pieces;
}

function checkColumns(pieces) {
  let nColumns = 0;
  for (const { runs } of pieces) {
    for (const { nChannels } of runs ?? []) nColumns += nChannels;
  }
  if (nColumns > MAX_COLUMNS) throw new LimitExceeded(`arrays: ${nColumns} columns`);
}

function readPiece(reader, left) {
  const kind = reader.u8();
  switch (kind) {
    case TEXT:
      return { kind, text: reader.sized() };
    case OWN:
      return { kind, text: null };
    case COUNT:
      return { kind, signal: reader.varint(), after: reader.sized(), size: reader.varint() };
    case DATA:
      return readData(reader, left);
    case ROWS:
      return readRows(reader);
    case ITEMS:
      return { ...readRows(reader), kind: ITEMS, factor: reader.varint() };
    case CRC:
    case SIZE4:
    case SIZE8:
    case DEFLATE:
    case SIZE1:
    case PART:
      return { kind, start: reader.varint(), stop: reader.varint() };
    default:
      return reader.refuse(`a piece of kind ${kind}`);
  }
}

function readRows(reader) {
  const signal = reader.varint();
  const size = reader.varint();
  if (![1, 2, 4].includes(size)) reader.refuse(`a number of rows in ${size} bytes`);
  return { kind: ROWS, signal, size };
}

function readData(reader, left) {
  const signal = reader.varint();
  const type = reader.u8();
  if (type >= TYPES.length) reader.refuse(`numbers of type ${type}`);
  const flags = reader.u8();
  if (flags > 3) reader.refuse(`flags ${flags} of numbers`);
  const runs = reader.counted(() => {
    if (left.runs-- === 0) reader.refuse(`more than ${MAX_RUNS} runs`);
    const channel = reader.varint();
    const nChannels = reader.varint();
    if (nChannels === 0) reader.refuse("a run of no channels");
    return { channel, nChannels };
  });
  return { kind: DATA, signal, type: TYPES[type], flags, runs };
}

/** Whether pieces of a kind follow from other pieces. */
function follows(kind) {
  return kind in SIZES || kind === DEFLATE;
}

/** Checks what pieces say of other pieces. */
function checkSpans(pieces) {
  const nOfFile = countFilePieces(pieces);
  for (const { kind } of pieces.slice(nOfFile)) {
    if (follows(kind)) throw new Refused(`arrays: a piece of kind ${kind} in contents`);
  }
  const sums = [0]; // CRC pieces before each piece
  for (const { kind } of pieces) sums.push(sums[sums.length - 1] + (kind === CRC ? 1 : 0));
  const spans = [];
  for (const { kind, start, stop } of pieces) {
    if (!follows(kind)) continue;
    if (start > stop || stop > pieces.length) {
      throw new Refused(`arrays: pieces ${start} to ${stop} of ${pieces.length}`);
    }
    if (start < nOfFile && stop > nOfFile) {
      throw new Refused(`arrays: pieces ${start} to ${stop} are not all of the file`);
    }
    if (kind !== CRC) continue;
    if (sums[start] !== sums[stop]) throw new Refused("arrays: a CRC-32 of a CRC-32");
    if (start < stop) spans.push({ start, stop }); // no pieces overlap none
  }
  spans.sort((a, b) => a.start - b.start || a.stop - b.stop);
  for (let k = 1; k < spans.length; k++) {
    const [before, { start, stop }] = [spans[k - 1], spans[k]];
    const same = before.start === start && before.stop === stop;
    if (!same && start < before.stop) throw new Refused("arrays: pieces of two CRC-32 overlap");
  }
}

function sizeOf(piece, signals) {
  const { kind } = piece;
  if (kind === TEXT || kind === OWN || kind === DEFLATE) return piece.text.length;
  if (kind in SIZES) return SIZES[kind];
  if (kind === PART) return 0;
  if (kind === COUNT || kind === ROWS || kind === ITEMS) return piece.size;
  const decoded = signals[piece.signal];
  let nColumns = 0;
  for (const { channel, nChannels } of piece.runs) {
    if (channel + nChannels > decoded.nChannels) {
      throw new Refused(`arrays: a run up to channel ${channel + nChannels}`);
    }
    nColumns += nChannels;
  }
  return piece.nRows * nColumns * piece.type.size;
}

/** Puts the bytes of a piece of any kind but CRC. */
function put(out, view, starts, piece, at, signals) {
  const { kind } = piece;
  if (kind === TEXT || kind === OWN || kind === DEFLATE) {
    out.set(piece.text, at);
  } else if (kind === COUNT) {
    const number = String(piece.nRows);
    const used = number.length + piece.after.length;
    if (used > piece.size) throw new Refused(`arrays: a count of ${used} bytes, not ${piece.size}`);
    out.fill(32, at, at + piece.size);
    for (let i = 0; i < number.length; i++) out[at + i] = number.charCodeAt(i);
    out.set(piece.after, at + number.length);
  } else if (kind === DATA) {
    putNumbers(view, at, piece, signals[piece.signal]);
  } else if (kind === ROWS) {
    putRows(view, at, piece.size, piece.nRows);
  } else if (kind === ITEMS) {
    putRows(view, at, piece.size, piece.nRows * piece.factor);
  } else if (kind !== CRC && kind !== PART) {
    const size = starts[piece.stop] - starts[piece.start];
    const width = SIZES[kind];
    if (width < 8 && size >= 2 ** (8 * width)) {
      throw new Refused(`arrays: a size of ${size} in ${width} bytes`);
    }
    if (kind === SIZE1) {
      view.setUint8(at, size);
      return;
    }
    view.setUint32(at, size % TWO_32, true);
    if (kind === SIZE8) view.setUint32(at + 4, Math.floor(size / TWO_32), true);
  }
}

function putRows(view, at, size, nRows) {
  const most = { 1: 2 ** 8 - 1, 2: 2 ** 16 - 1, 4: 2 ** 31 - 1 }[size];
  if (nRows > most) throw new Refused(`arrays: ${nRows} rows in ${size} bytes`);
  for (let k = 0; k < size; k++) view.setUint8(at + k, Math.floor(nRows / 2 ** (8 * k)) % 256);
}

function putNumbers(view, at, { type, flags, runs, row, nRows }, decoded) {
  const channels = [];
  for (const { channel, nChannels } of runs) {
    for (let k = 0; k < nChannels; k++) channels.push(channel + k);
  }
  const words = new Words(type, (flags & BIG_ENDIAN) === 0, decoded);
  const byColumns = (flags & BY_COLUMNS) !== 0;
  for (let r = 0; r < nRows; r++) {
    for (let k = 0; k < channels.length; k++) {
      const place = byColumns ? k * nRows + r : r * channels.length + k;
      words.put(view, at + place * type.size, row + r, channels[k]);
    }
  }
}

/** The numbers of a signal as words of a type. Rows are asked for in order. */
class Words {
  constructor(type, little, { parts, values, ordinals, mask, nChannels }) {
    this.type = type;
    this.little = little;
    this.nChannels = nChannels;
    this.values = values;
    this.mask = mask;
    this.halves = ordinals ? halvesOf(ordinals) : null;
    this.parts = parts;
    this.part = 0;
  }

  put(view, at, row, channel) {
    const { type, little } = this;
    const i = row * this.nChannels + channel;
    const v = Number(this.values[i]);
    if (!type.float) {
      const whole = Number.isNaN(v) ? 0 : rint(v);
      type.set(view, at, Math.min(Math.max(whole, type.least), type.greatest), little);
    } else if (Number.isNaN(v)) {
      this.putNaN(view, at, row, channel);
    } else if (this.mask && !this.mask[i]) {
      putCanonical(view, at, type.size, little);
    } else {
      type.set(view, at, v, little);
    }
  }

  /** A NaN: where the grid is that of the type, the bits that its ordinal says. */
  putNaN(view, at, row, channel) {
    const { type, little } = this;
    while (row >= this.parts[this.part].firstRow + this.parts[this.part].nRows) this.part++;
    const grid = this.parts[this.part].grids[channel];
    if (!this.halves || grid.kind !== type.grid) {
      putCanonical(view, at, type.size, little);
      return;
    }
    const i = row * this.nChannels + channel;
    const [high, low] = [highHalf(this.halves, i), lowHalf(this.halves, i)];
    const sign = high < 0 ? 0x80000000 : 0;
    const [m1, m0] = high < 0 ? [~high, ~low] : [high, low];
    if (type.size === 4) {
      view.setUint32(at, ((m0 & 0x7fffffff) | sign) >>> 0, little);
    } else {
      view.setUint32(little ? at + 4 : at, (m1 | sign) >>> 0, little);
      view.setUint32(little ? at : at + 4, m0 >>> 0, little);
    }
  }
}

function putCanonical(view, at, size, little) {
  if (size === 2) view.setUint16(at, 0x7e00, little);
  else if (size === 4) view.setUint32(at, 0x7fc00000, little);
  else view.setBigUint64(at, 0x7ff8000000000000n, little);
}

/** The nearest integer, ties to even. */
function rint(x) {
  const size = Math.abs(x);
  const whole = size < 2 ** 52 ? size + 2 ** 52 - 2 ** 52 : size;
  return x < 0 ? -whole : whole;
}

/** The bits of the nearest binary16, ties to even. */
function half(v) {
  const size = Math.abs(v);
  const sign = v < 0 || Object.is(v, -0) ? 0x8000 : 0;
  if (size >= 65520) return sign | 0x7c00;
  if (size < 2 ** -14) return sign | rint(size * 2 ** 24);
  let e = Math.floor(Math.log2(size));
  if (2 ** e > size) e--;
  if (2 ** (e + 1) <= size) e++;
  return sign | ((e + 14) * 1024 + rint(size * 2 ** (10 - e)));
}
