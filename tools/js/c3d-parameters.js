// The parameter section of a C3D file. Read leniently: a parameter that runs out of its section is
// left out, and the first of a name counts.

import { Grid, VAX_F, float32Of, valueOf } from "./grids.js";

const DEC = 85;
const SGI = 86;
const BLOCK = 512;
const MOST_BLOCKS = 255;
const WORD_OF_DATA = 16; // offset in the header: first block of the data
const MOST_CONTINUED = 4096; // parameters that go on with another

const TEXT = -1;
const BYTE = 1;
const INTEGER = 2;
const FLOAT = 4;

const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

/** Bytes as Latin-1. */
function latin1(bytes) {
  let out = "";
  for (const byte of bytes) out += String.fromCharCode(byte);
  return out;
}

/**
 * Texts as UTF-8 where all of them are, otherwise as Latin-1.
 *
 * @param {Uint8Array[]} texts
 * @returns {string[]}
 */
export function decodedTexts(texts) {
  try {
    return texts.map((text) => utf8.decode(text));
  } catch {
    return texts.map(latin1);
  }
}

/** Words and floats in the byte order of a processor. */
export class Order {
  constructor(processor) {
    this.little = processor !== SGI;
    this.vax = processor === DEC ? new Grid(VAX_F, 0, 0, 1) : null;
  }

  /** The unsigned word at an offset; 0 beyond the end. */
  word(bytes, at) {
    if (at + 2 > bytes.length) return 0;
    return this.little ? bytes[at] + 256 * bytes[at + 1] : 256 * bytes[at] + bytes[at + 1];
  }

  /** The float at an offset; 0 beyond the end. */
  float(bytes, at) {
    if (at + 4 > bytes.length) return 0;
    if (this.vax === null) {
      const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
      return float32Of(view.getUint32(at, this.little));
    }
    const bits = 65536 * this.word(bytes, at) + this.word(bytes, at + 2);
    return valueOf(this.vax, BigInt(bits < 2 ** 31 ? bits : 2 ** 31 - 1 - bits));
  }
}

/** The parameters of a file by group and name, both in capitals. */
class Parameters {
  /**
   * @param {Order} order
   * @param {Map<string, {type: number, dims: number[], data: Uint8Array}>} found by "GROUP:NAME"
   */
  constructor(order, found) {
    this.order = order;
    this.found = found;
  }

  /** @returns {{type: number, dims: number[], data: Uint8Array} | undefined} */
  get(group, name) {
    return this.found.get(`${group}:${name}`);
  }

  /** The first number of a parameter, integers unsigned; null where there is none. */
  number(group, name) {
    const parameter = this.get(group, name);
    if (!parameter || parameter.type === TEXT || parameter.data.length === 0) return null;
    if (parameter.type === FLOAT) return this.order.float(parameter.data, 0);
    return parameter.type === INTEGER ? this.order.word(parameter.data, 0) : parameter.data[0];
  }

  /** The first number where it is a count; null where it is none. */
  count(group, name) {
    const value = this.number(group, name);
    return value !== null && value >= 0 && value < 2 ** 32 ? Math.trunc(value) : null;
  }

  /** All numbers of a parameter and of those that go on with it (SCALE, SCALE2), with signs. */
  numbers(group, name) {
    return this.continued(group, name, false).flatMap(({ type, data }) => {
      const size = Math.abs(type);
      return Array.from({ length: Math.floor(data.length / size) }, (_, i) => {
        if (type === BYTE) return data[i];
        if (type === FLOAT) return this.order.float(data, 4 * i);
        const word = this.order.word(data, 2 * i);
        return word < 0x8000 ? word : word - 0x10000;
      });
    });
  }

  /** All texts of a parameter and of those that go on with it (LABELS, LABELS2), trimmed. */
  texts(group, name) {
    return this.continued(group, name, true).flatMap(({ dims, data }) => {
      const width = (dims.length > 0 ? dims[0] : 1) || 1;
      const rows = [];
      for (let at = 0; at < data.length; at += width) rows.push(data.subarray(at, at + width));
      return rows.map(trimmed);
    });
  }

  /** The first text of a parameter; "" where there is none. */
  text(group, name) {
    const [first] = this.texts(group, name);
    return first === undefined ? "" : decodedTexts([first])[0];
  }

  continued(group, name, isText) {
    const list = [];
    for (let number = 1; number <= MOST_CONTINUED; number++) {
      const parameter = this.get(group, number === 1 ? name : `${name}${number}`);
      if (!parameter || (parameter.type === TEXT) !== isText) break;
      list.push(parameter);
    }
    return list;
  }
}

/** Without blanks at its beginning, and without blanks and zeros at its end. */
export function trimmed(bytes) {
  let end = bytes.length;
  while (end > 0 && (bytes[end - 1] === 0 || bytes[end - 1] === 0x20)) end--;
  let start = 0;
  while (start < end && bytes[start] === 0x20) start++;
  return bytes.subarray(start, end);
}

/**
 * The parameters of a file.
 *
 * @param {Uint8Array} head of the file up to its data
 * @param {Uint8Array} tail of the file from `tailAt` on
 * @param {number} tailAt
 * @param {Order} order
 * @returns {Parameters} none where there is no section
 */
export function findParameters(head, tail, tailAt, order) {
  if (head.length < BLOCK) return new Parameters(order, new Map());
  const start = (head[0] - 1) * BLOCK;
  if (start >= BLOCK && start <= head.length - 4) return readSection(head, start, order, head);
  const from = start - tailAt; // the parameters follow the data
  if (from < 0 || from > tail.length - 4) return new Parameters(order, new Map());
  return readSection(tail.subarray(from, from + MOST_BLOCKS * BLOCK), 0, order, head);
}

function readSection(bytes, start, order, head) {
  const blocks = bytes[start + 2] || MOST_BLOCKS; // some files have more of them than they say
  const data = (order.word(head, WORD_OF_DATA) - 1) * BLOCK;
  const most = start + MOST_BLOCKS * BLOCK;
  const stop = Math.min(Math.max(start + blocks * BLOCK, data), most, bytes.length);
  const groups = new Map();
  const entries = [];
  let at = start + 4;
  while (at + 2 <= stop) {
    const size = (bytes[at] << 24) >> 24;
    const number = (bytes[at + 1] << 24) >> 24;
    const after = at + 2 + Math.abs(size);
    if (size === 0 || after + 2 > stop) break;
    const name = nameOf(bytes.subarray(at + 2, after));
    if (number >= 0) entries.push({ number, name, parameter: parameterAt(bytes, after + 2, stop) });
    else if (!groups.has(-number)) groups.set(-number, name);
    const step = order.word(bytes, after);
    if (step < 2) break;
    at = after + step;
  }
  const found = new Map();
  for (const { number, name, parameter } of entries) {
    const key = `${groups.get(number)}:${name}`;
    if (parameter !== null && groups.has(number) && !found.has(key)) found.set(key, parameter);
  }
  return new Parameters(order, found);
}

function nameOf(bytes) {
  return latin1(bytes).replace(/^[ \0]+|[ \0]+$/g, "").toUpperCase();
}

/** The parameter whose type stands at an offset; null where it does not fit its section. */
function parameterAt(bytes, at, stop) {
  if (at + 2 > stop) return null;
  const type = (bytes[at] << 24) >> 24;
  const first = at + 2 + bytes[at + 1];
  if (first > stop || ![TEXT, BYTE, INTEGER, FLOAT].includes(type)) return null;
  const dims = [...bytes.subarray(at + 2, first)];
  const size = dims.reduce((product, dim) => product * dim, Math.abs(type));
  if (first + size > stop) return null;
  return { type, dims, data: bytes.subarray(first, first + size) };
}
