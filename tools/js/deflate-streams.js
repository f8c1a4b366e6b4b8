// SPEC.md, "Deflated contents": the deflate stream of a member, as it was.

import { ByteReader } from "./bytes.js";
import { crc32 } from "./crc32.js";
import { LimitExceeded, Refused } from "./errors.js";
import {
  DISTANCE_BASE,
  DISTANCE_EXTRA,
  END_OF_BLOCK,
  FIXED_CODES,
  LENGTH_BASE,
  LENGTH_EXTRA,
  readCodes,
} from "./inflate.js";

const WHAT = "a deflated member";
const MAX_ITEMS = 2 ** 16;
const STORED_SIZE = 65535;
const STORED = 0;
const FIXED = 1;
const DYNAMIC = 2;

const LITERAL = { length: 1, distance: 0 };
const SHORTEST = 3;
const LONGEST = 258;
const FAR = 4096; // a lazy search takes no match of three bytes beyond it
const SEARCHED = 32506; // the distance that a search goes back
const FARTHEST = 32768;
const WINDOW_MASK = 32767;

/** Parameters of the search by level: good, lazy, nice, chain. */
const LEVELS = [
  null,
  [4, 4, 8, 4],
  [4, 5, 16, 8],
  [4, 6, 32, 32],
  [4, 4, 16, 16],
  [8, 16, 32, 32],
  [8, 16, 128, 128],
  [8, 32, 128, 256],
  [32, 128, 258, 1024],
  [32, 258, 258, 4096],
].map((row) => row && { good: row[0], lazy: row[1], nice: row[2], chain: row[3] });

/**
 * Restores the deflate stream of a member.
 *
 * @param {Uint8Array} part of the detail
 * @param {Uint8Array} contents what the stream inflates to
 * @returns {Uint8Array}
 * @throws {Refused}
 */
export function restoreStream(part, contents) {
  const reader = new ByteReader(part, WHAT);
  const crc = reader.u32();
  const level = reader.u8();
  if (level > 9) reader.refuse(`level ${level}`);
  const stream = reader.sized();
  const blocks = counted(reader, () => readBlock(reader));
  const corrections = counted(reader, () => {
    return { skip: reader.varint(), length: reader.varint(), distance: reader.varint() };
  });
  reader.end();
  const isKept = level === 0;
  if (isKept ? blocks.length + corrections.length > 0 : stream.length > 0 || blocks.length === 0) {
    reader.refuse(`a stream or blocks do not fit level ${level}`);
  }
  if (crc32(contents, 0, contents.length) !== crc) return storedBlocks(contents);
  return isKept ? stream : join(contents, level, blocks, corrections);
}

function counted(reader, read) {
  const items = [];
  return reader.counted(() => {
    if (items.push(0) > MAX_ITEMS) throw new LimitExceeded(`${WHAT}: more than ${MAX_ITEMS} items`);
    return read();
  });
}

function readBlock(reader) {
  const kind = reader.u8();
  if (kind > DYNAMIC) reader.refuse(`a block of kind ${kind}`);
  const size = reader.varint();
  const codes = reader.sized();
  if (codes.length > 0 && kind !== DYNAMIC) reader.refuse(`codes of a block of kind ${kind}`);
  return { kind, size, codes };
}

function storedBlocks(contents) {
  const n = Math.max(1, Math.ceil(contents.length / STORED_SIZE));
  const out = new Bits(contents.length + 5 * n);
  for (let k = 0; k < n; k++) {
    out.put(k === n - 1 ? 1 : 0, 3);
    out.store(contents.subarray(k * STORED_SIZE, (k + 1) * STORED_SIZE));
  }
  return out.bytes();
}

/** A stream of bits, the lowest of each byte first. */
class Bits {
  constructor(most) {
    this.buffer = new Uint8Array(most);
    this.at = 0; // in bits
  }

  put(value, n) {
    for (let left = n; left > 0; ) {
      const used = this.at & 7;
      this.buffer[this.at >>> 3] |= value << used;
      const step = Math.min(8 - used, left);
      value >>>= step;
      left -= step;
      this.at += step;
    }
  }

  /** Puts what follows the first three bits of a stored block. */
  store(bytes) {
    this.at = Math.ceil(this.at / 8) * 8;
    this.put(bytes.length, 16);
    this.put(bytes.length ^ STORED_SIZE, 16);
    this.buffer.set(bytes, this.at >>> 3);
    this.at += 8 * bytes.length;
  }

  bytes() {
    return this.buffer.subarray(0, Math.ceil(this.at / 8));
  }
}

function join(contents, level, blocks, corrections) {
  const headers = blocks.reduce((sum, { codes }) => sum + codes.length + 8, 0);
  const out = new Bits(2 * contents.length + headers); // codes have 15 bits at most
  const search = new Search(contents, level);
  let since = 0;
  let used = 0;
  blocks.forEach(({ kind, size, codes: header }, k) => {
    out.put(k === blocks.length - 1 ? 1 : 0, 1);
    out.put(kind, 2);
    if (kind === STORED) {
      if (size > STORED_SIZE || size > contents.length - search.at) refuse("too long a block");
      out.store(contents.subarray(search.at, search.at + size));
      search.skip(size);
      return;
    }
    const codes = kind === FIXED ? FIXED_CODES : putHeader(out, header);
    for (let left = size; left > 0; left--) {
      if (search.at >= contents.length) refuse("more tokens than contents");
      let token = search.next();
      if (used < corrections.length && since === corrections[used].skip) {
        token = corrections[used++];
        search.check(token);
        search.pending = null;
        since = 0;
      } else {
        since++;
      }
      putToken(out, codes, token, contents[search.at]);
      search.advance(token);
    }
    putSymbol(out, codes[0], END_OF_BLOCK);
  });
  if (search.at !== contents.length) refuse("contents are left over");
  if (used !== corrections.length) refuse("corrections are left over");
  return out.bytes();
}

function refuse(message) {
  throw new Refused(`${WHAT}: ${message}`);
}

function putHeader(out, header) {
  const { codes, bits } = readCodes(header, WHAT);
  for (let at = 0; at < bits; at += 8) out.put(header[at >> 3], Math.min(8, bits - at));
  return codes;
}

function putSymbol(out, { lengths, codes }, symbol) {
  if (!lengths[symbol]) refuse(`symbol ${symbol} has no code`);
  out.put(codes[symbol], lengths[symbol]);
}

function putToken(out, [literals, distances], { length, distance }, literal) {
  if (length === 1) {
    putSymbol(out, literals, literal);
    return;
  }
  const a = LENGTH_BASE.findLastIndex((base) => base <= length);
  putSymbol(out, literals, END_OF_BLOCK + 1 + a);
  out.put(length - LENGTH_BASE[a], LENGTH_EXTRA[a]);
  const b = DISTANCE_BASE.findLastIndex((base) => base <= distance);
  putSymbol(out, distances, b);
  out.put(distance - DISTANCE_BASE[b], DISTANCE_EXTRA[b]);
}

/** The search of tokens; `at` is where the next one begins. */
class Search {
  constructor(contents, level) {
    this.contents = contents;
    this.isLazy = level >= 4;
    this.effort = LEVELS[level];
    this.at = 0;
    this.inserted = 0;
    this.pending = null;
    this.latest = new Int32Array(FARTHEST); // the last position of each hash, 0: none
    this.earlier = new Int32Array(FARTHEST); // the one before each position
  }

  next() {
    let token = this.pending;
    this.pending = null;
    if (token === null) {
      this.insert(this.at);
      token = this.longest(this.at, SHORTEST - 1);
      if (this.isLazy && token?.length === SHORTEST && token.distance > FAR) token = null;
    }
    if (token === null) return LITERAL;
    if (this.isLazy && token.length < this.effort.lazy) {
      this.insert(this.at + 1);
      this.pending = this.longest(this.at + 1, token.length);
      if (this.pending !== null) return LITERAL;
    }
    return token;
  }

  advance({ length }) {
    if (!this.isLazy && length > this.effort.lazy) {
      this.insert(this.at + 1);
      this.inserted = this.at + length;
    }
    this.at += length;
  }

  skip(n) {
    this.at += n;
    this.pending = null;
  }

  insert(stop) {
    const end = Math.min(stop, this.contents.length - 2);
    for (let q = this.inserted; q < end; q++) {
      const key = this.hash(q);
      this.earlier[q & WINDOW_MASK] = this.latest[key];
      this.latest[key] = q;
    }
    this.inserted = Math.max(this.inserted, stop);
  }

  hash(q) {
    const { contents } = this;
    return ((contents[q] << 10) ^ (contents[q + 1] << 5) ^ contents[q + 2]) & WINDOW_MASK;
  }

  /** The match at q that is longer than `best`, or null. */
  longest(q, best) {
    const { contents, effort } = this;
    const room = Math.min(LONGEST, contents.length - q);
    if (room < SHORTEST || best >= room) return null;
    const nice = Math.min(effort.nice, room);
    let token = null;
    let candidate = this.latest[this.hash(q)];
    if (q - candidate > SEARCHED) return null;
    let tries = best >= effort.good ? effort.chain >> 2 : effort.chain;
    while (candidate > 0 && tries-- > 0) {
      let length = 0;
      while (length < room && contents[candidate + length] === contents[q + length]) length++;
      if (length > best) {
        best = length;
        token = { length, distance: q - candidate };
        if (length >= nice) break;
      }
      candidate = this.earlier[candidate & WINDOW_MASK];
      if (q - candidate >= SEARCHED) break;
    }
    return token;
  }

  /** Refuses a token that is not one of the contents. */
  check({ length, distance }) {
    const { contents, at } = this;
    if (length === 1 && distance === 0) return;
    const most = Math.min(LONGEST, contents.length - at);
    if (length < SHORTEST || length > most || distance < 1 || distance > Math.min(FARTHEST, at)) {
      refuse(`a match of ${length} bytes at distance ${distance}`);
    }
    for (let k = at; k < at + length; k++) {
      if (contents[k] !== contents[k - distance]) refuse(`byte ${k} is not that of a match`);
    }
  }
}
