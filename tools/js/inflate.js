// SPEC.md, "Conventions": raw deflate (RFC 1951), whose stream ends with the bytes given to it and
// inflates to exactly the stated size.

import { Refused } from "./errors.js";

const MAX_BITS = 15;
const MAX_RATIO = 1032; // bytes that a byte of deflate can become
const FIRST_BUFFER = 65536;
export const END_OF_BLOCK = 256;
const NOTHING = new Uint8Array(0);

const CODE_LENGTH_ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
const REPEAT_BASE = [3, 3, 11]; // of the code length symbols 16, 17 and 18
const REPEAT_EXTRA = [2, 3, 7];
export const LENGTH_EXTRA = [
  0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0,
];
export const DISTANCE_EXTRA = [
  0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8, 9, 9, 10, 10, 11, 11, 12, 12, 13, 13,
];
export const LENGTH_BASE = bases(3, LENGTH_EXTRA);
LENGTH_BASE[28] = 258;
export const DISTANCE_BASE = bases(1, DISTANCE_EXTRA);

function bases(first, extra) {
  const list = [];
  let base = first;
  for (const bits of extra) {
    list.push(base);
    base += 2 ** bits;
  }
  return list;
}

/**
 * A canonical Huffman code, as a table by the next bits of the stream: of each code, with whatever
 * may follow it, 16 * symbol + length; 0 of what is no code.
 */
class Huffman {
  constructor(lengths, inflater, whole = false) {
    const counts = new Uint16Array(MAX_BITS + 1);
    for (const length of lengths) counts[length]++;
    const used = lengths.length - counts[0];
    const next = new Uint16Array(MAX_BITS + 1); // the next code of each length
    this.lengths = lengths;
    this.codes = new Uint16Array(lengths.length); // of each symbol, its first bit the lowest
    let free = 1;
    for (let length = 1; length <= MAX_BITS; length++) {
      free = 2 * free - counts[length];
      if (free < 0) inflater.refuse("a code has too many symbols");
      if (length > 1) next[length] = 2 * (next[length - 1] + counts[length - 1]);
    }
    // A code of one symbol may be incomplete, of one bit, and one of none stand unused.
    const mayLack = !whole && used <= 1 && counts[1] === used;
    if (free > 0 && !mayLack) inflater.refuse("a code is incomplete");
    this.bits = used === 0 ? 0 : counts.findLastIndex((n, length) => length > 0 && n > 0);
    this.table = new Uint16Array(1 << this.bits);
    lengths.forEach((length, symbol) => {
      if (length === 0) return;
      const entry = 16 * symbol + length;
      const first = reversed(next[length]++, length);
      this.codes[symbol] = first;
      for (let i = first; i < this.table.length; i += 1 << length) this.table[i] = entry;
    });
  }
}

/** The bits of a code, which come highest first, in the order of the stream: lowest first. */
function reversed(code, length) {
  let out = 0;
  for (let i = 0; i < length; i++) out |= ((code >> i) & 1) << (length - 1 - i);
  return out;
}

class Inflater {
  constructor(data, size, what, past) {
    this.past = past; // what distances may reach back to beyond the beginning
    this.data = data;
    this.size = size;
    this.what = what;
    this.at = 0;
    this.bitBuffer = 0;
    this.bitCount = 0;
    this.out = new Uint8Array(Math.min(size, FIRST_BUFFER));
    this.length = 0;
  }

  refuse(message) {
    throw new Refused(`${this.what}: deflate: ${message}`);
  }

  /** Has n bits in the buffer, or all that there are. */
  fill(n) {
    while (this.bitCount < n && this.at < this.data.length) {
      this.bitBuffer |= this.data[this.at++] << this.bitCount;
      this.bitCount += 8;
    }
  }

  drop(n) {
    if (n > this.bitCount) this.refuse("the stream has no end");
    this.bitBuffer >>>= n;
    this.bitCount -= n;
  }

  /** Puts whole bytes of the buffer back, and drops the rest of the last byte that was begun. */
  align() {
    this.at -= this.bitCount >> 3;
    this.bitBuffer = 0;
    this.bitCount = 0;
  }

  bits(n) {
    this.fill(n);
    const value = this.bitBuffer & ((1 << n) - 1);
    this.drop(n);
    return value;
  }

  symbol(code) {
    this.fill(code.bits);
    const entry = code.table[this.bitBuffer & (code.table.length - 1)];
    if (entry === 0) this.refuse("some bits are not a code");
    this.drop(entry & 15);
    return entry >> 4;
  }

  /** Makes room for n bytes more, by and by: a stated size alone earns no memory. */
  room(n) {
    const needed = this.length + n;
    if (needed > this.size) this.refuse(`more than the stated ${this.size} bytes`);
    if (needed <= this.out.length) return;
    const larger = new Uint8Array(Math.min(this.size, Math.max(needed, 2 * this.out.length)));
    larger.set(this.out.subarray(0, this.length));
    this.out = larger;
  }

  stored() {
    this.align();
    const { data, at } = this;
    if (at + 4 > data.length) this.refuse("the stream has no end");
    const n = data[at] | (data[at + 1] << 8);
    if ((n ^ (data[at + 2] | (data[at + 3] << 8))) !== 0xffff) this.refuse("a bad stored block");
    if (at + 4 + n > data.length) this.refuse("the stream has no end");
    this.room(n);
    this.out.set(data.subarray(at + 4, at + 4 + n), this.length);
    this.length += n;
    this.at = at + 4 + n;
  }

  codes() {
    const nLiterals = this.bits(5) + 257;
    const nDistances = this.bits(5) + 1;
    const nLengths = this.bits(4) + 4;
    if (nLiterals > 286 || nDistances > 30) this.refuse("too many symbols");
    const lengths = new Uint8Array(19);
    for (let i = 0; i < nLengths; i++) lengths[CODE_LENGTH_ORDER[i]] = this.bits(3);
    const code = new Huffman(lengths, this, true);
    const all = new Uint8Array(nLiterals + nDistances);
    let i = 0;
    while (i < all.length) {
      const symbol = this.symbol(code);
      if (symbol < 16) {
        all[i++] = symbol;
        continue;
      }
      if (symbol === 16 && i === 0) this.refuse("nothing to repeat");
      const value = symbol === 16 ? all[i - 1] : 0;
      const n = REPEAT_BASE[symbol - 16] + this.bits(REPEAT_EXTRA[symbol - 16]);
      if (i + n > all.length) this.refuse("too many code lengths");
      all.fill(value, i, i + n);
      i += n;
    }
    if (all[END_OF_BLOCK] === 0) this.refuse("a block has no end");
    return [
      new Huffman(all.subarray(0, nLiterals), this),
      new Huffman(all.subarray(nLiterals), this),
    ];
  }

  block(literals, distances) {
    for (;;) {
      const symbol = this.symbol(literals);
      if (symbol === END_OF_BLOCK) return;
      if (symbol < END_OF_BLOCK) {
        this.room(1);
        this.out[this.length++] = symbol;
        continue;
      }
      if (symbol > 285) this.refuse(`length symbol ${symbol}`);
      const n = LENGTH_BASE[symbol - 257] + this.bits(LENGTH_EXTRA[symbol - 257]);
      const code = this.symbol(distances);
      if (code > 29) this.refuse(`distance symbol ${code}`);
      const distance = DISTANCE_BASE[code] + this.bits(DISTANCE_EXTRA[code]);
      if (distance > this.length + this.past.length) this.refuse("a distance beyond the beginning");
      this.room(n);
      const { out, length } = this;
      for (let to = length; to < length + n; to++) {
        const from = to - distance;
        out[to] = from < 0 ? this.past[this.past.length + from] : out[from];
      }
      this.length += n;
    }
  }

  run() {
    let last = 0;
    while (last === 0) {
      last = this.bits(1);
      const kind = this.bits(2);
      if (kind === 0) this.stored();
      else if (kind === 1) this.block(...FIXED_CODES);
      else if (kind === 2) this.block(...this.codes());
      else this.refuse("kind 3 of a block is reserved");
    }
    this.align();
    if (this.at !== this.data.length) this.refuse("bytes follow the stream");
    if (this.length !== this.size) {
      this.refuse(`${this.length} bytes, not the stated ${this.size}`);
    }
    return this.out;
  }
}

/** The codes of blocks of kind 1; both are whole, so nothing is refused. */
export const FIXED_CODES = [
  Uint8Array.from({ length: 288 }, (_, i) => (i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8)),
  new Uint8Array(32).fill(5),
].map((lengths) => new Huffman(lengths, null));

/**
 * Inflates a raw deflate stream.
 *
 * @param {Uint8Array} data the stream, nothing before or behind it
 * @param {number} size bytes that it MUST inflate to
 * @param {string} what named in messages
 * @param {Uint8Array} past bytes that distances may reach back to, as if they came before
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function inflate(data, size, what, past = NOTHING) {
  if (size > MAX_RATIO * data.length) {
    throw new Refused(`${what}: ${size} bytes cannot come of ${data.length} bytes of deflate`);
  }
  return new Inflater(data, size, what, past).run();
}

/**
 * The codes of a block of kind 2, of the bits from HLIT to the last code length.
 *
 * @param {Uint8Array} header these bits, in whole bytes
 * @param {string} what named in messages
 * @returns {{codes: {lengths: Uint8Array, codes: Uint16Array}[], bits: number}} the code of literals
 *   and lengths, that of distances, and how many bits the header has
 * @throws {Refused} also where it does not end in its last byte
 */
export function readCodes(header, what) {
  const inflater = new Inflater(header, 0, what, NOTHING);
  const codes = inflater.codes();
  if (inflater.at !== header.length || inflater.bitCount > 7) inflater.refuse("bytes follow codes");
  return { codes, bits: 8 * header.length - inflater.bitCount };
}
