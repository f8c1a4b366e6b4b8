// SPEC.md, "Codec 1: fast", "Tails" and "Units": the ordinals of leads.

import { COUNTS, MULTIPLES, PLAIN, PRODUCTS, classesOf, numberOfCount, productOf } from "./forms.js";
import { GENERAL, binary32Ordinal } from "./grids.js";
import { halvesOf, setHalves, setInteger } from "./int64.js";
import { ordinalOf } from "./ordinals.js";
import { nextScale } from "./rice.js";

const TWO_32 = 2 ** 32;
const MAX_DIGITS_10 = 9; // of a lead
const MAX_DIGITS_2 = 30;
const TINY_ESCAPE = 9;
const MAX_DECIMAL = 9; // digits that are read at once
const TEN_9 = 10 ** MAX_DECIMAL;

/** 10^n for all that 31 bits hold. */
const LEAST_10 = Int32Array.from({ length: 10 }, (_, n) => 10 ** n);

/** How a number below 10^n is read, by n: bits, and from where on there is one more. */
const DECIMALS = Array.from({ length: MAX_DECIMAL + 1 }, (_, n) => {
  const bits = 31 - Math.clz32(10 ** n);
  return { bits, nShort: 2 ** (bits + 1) - 10 ** n, added: 10 ** n - 2 ** bits };
});

/** A number below 10^n, 0 <= n <= 15. */
function takeDecimal(reader, n) {
  if (n > MAX_DECIMAL) {
    const high = takeDecimal(reader, n - MAX_DECIMAL);
    return high * TEN_9 + takeDecimal(reader, MAX_DECIMAL);
  }
  const { bits, nShort, added } = DECIMALS[n];
  const v = reader.take(bits);
  return v >= nShort && reader.take(1) === 1 ? v + added : v;
}

/**
 * What sets the ordinals of a coded channel. FAST-42
 *
 * @param {object} head of the channel
 * @param {BigInt64Array} ordinals where they go
 * @returns {{hasTails: boolean, set: (index: number, lead: number, reader: RiceReader) => void}}
 *     `set` makes the ordinal at an index; the reader is that of the tails of the group
 */
export function numbersOf(head, ordinals) {
  const halves = halvesOf(ordinals);
  const isGeneral = head.grid.kind === GENERAL;
  switch (head.form) {
    case PLAIN:
      return new PlainNumbers(head, halves);
    case MULTIPLES:
      return isGeneral ? new GeneralMultiples(head, ordinals) : new Multiples(head, halves);
    case PRODUCTS:
      return new Products(head, ordinals);
    case COUNTS:
      return isGeneral ? new GeneralCounts(head, ordinals) : new Counts(head, halves);
    default:
      return new ClassNumbers(head, halves);
  }
}

class PlainNumbers {
  constructor({ drop }, halves) {
    this.drop = drop;
    this.halves = halves;
    this.hasTails = drop > 0;
  }

  set(index, lead, reader) {
    const { drop } = this;
    if (drop === 0) {
      setHalves(this.halves, index, lead, lead >> 31);
      return;
    }
    const tail = reader.take(drop);
    // Of shifts of 32 bits nothing would come.
    setHalves(this.halves, index, drop < 32 ? (lead << drop) | tail : tail, lead >> (32 - drop));
  }
}

class Multiples {
  constructor({ unit }, halves) {
    this.unit = unit;
    this.halves = halves;
    this.hasTails = false;
  }

  set(index, lead) {
    setInteger(this.halves, index, binary32Ordinal(lead * this.unit)); // FAST-48
  }
}

/** Multiples on a decimal grid. */
class GeneralMultiples {
  constructor({ unit, grid }, ordinals) {
    this.unit = unit;
    this.grid = grid;
    this.ordinals = ordinals;
    this.hasTails = false;
  }

  set(index, lead) {
    this.ordinals[index] = ordinalOf(this.grid, Math.fround(lead * this.unit)); // FAST-48
  }
}

class Products {
  constructor(head, ordinals) {
    this.head = head;
    this.ordinals = ordinals;
    this.hasTails = false;
  }

  set(index, lead) {
    this.ordinals[index] = ordinalOf(this.head.grid, productOf(this.head, lead)); // FAST-51
  }
}

class Counts {
  constructor(head, halves) {
    this.head = head;
    this.halves = halves;
    this.hasTails = head.law.hasRests;
    this.scale = head.restScale;
  }

  set(index, lead, reader) {
    const ordinal = binary32Ordinal(numberOfCount(this.head, lead)); // FAST-54
    setInteger(this.halves, index, ordinal + this.takeRest(reader));
  }

  takeRest(reader) {
    if (!this.hasTails) return 0;
    const rest = reader.code(this.scale);
    this.scale = nextScale(this.scale, rest);
    return rest;
  }
}

/** Counts on a decimal grid. */
class GeneralCounts extends Counts {
  constructor(head, ordinals) {
    super(head, null);
    this.ordinals = ordinals;
  }

  set(index, lead, reader) {
    const ordinal = ordinalOf(this.head.grid, numberOfCount(this.head, lead)); // FAST-54
    this.ordinals[index] = ordinal + BigInt(this.takeRest(reader));
  }
}

class ClassNumbers {
  constructor(head, halves) {
    const { decimal, nDigits, least, perClass, powers } = classesOf(head);
    this.halves = halves;
    this.hasTails = true;
    this.decimal = decimal;
    this.isTiny = head.isTiny;
    this.nDigits = nDigits; // P
    this.least = least; // L
    this.most = Math.min(nDigits, decimal ? MAX_DIGITS_10 : MAX_DIGITS_2); // D
    this.lowest = head.top - this.most; // class of n digits, without n
    this.powers = powers; // of B
    this.before = (decimal ? 1 : 0) - least; // F - L
    this.unit = 2 ** head.drop;
    // K * 2^drop: products of its halves with a class are exact.
    this.classLow = (perClass * this.unit) % TWO_32;
    this.classHigh = Math.floor((perClass * this.unit) / TWO_32);
  }

  set(index, lead, reader) {
    const minus = lead < 0;
    const s = minus ? ~lead : lead;
    if (s === 0) {
      this.setSmall(index, minus, reader);
      return;
    }
    const n = this.decimal ? countDigits(s) : 32 - Math.clz32(s);
    if (n > this.most) reader.refuse(`a lead of ${n} digits of ${this.most}`); // FAST-43
    const k = this.lowest + n;
    if (k < 0) reader.refuse(`class ${k}`); // FAST-44
    const nTail = this.nDigits - n;
    const tail = this.decimal ? takeDecimal(reader, nTail) : reader.takeLong(nTail);
    this.setClass(index, minus, k, s * this.powers[nTail] + tail);
  }

  /** Zero, or a number of a class that no lead reaches. */
  setSmall(index, minus, reader) {
    let z = this.isTiny ? takeDecimal(reader, 1) : 0;
    if (z === TINY_ESCAPE) z += takeDecimal(reader, 4);
    if (z === 0) {
      setHalves(this.halves, index, -minus, -minus);
      return;
    }
    const k = this.lowest + 1 - z;
    if (k < 0) reader.refuse(`class ${k}`); // FAST-45
    const m = this.decimal
      ? takeDecimal(reader, this.nDigits)
      : this.least + reader.takeLong(this.nDigits - 1);
    if (m < this.least) reader.refuse(`mantissa ${m}`); // FAST-46
    this.setClass(index, minus, k, m);
  }

  /** Sets the ordinal of a sign, a class k and a mantissa m; it may be too large for a double. */
  setClass(index, minus, k, m) {
    const within = (this.before + m) * this.unit;
    const withinHigh = Math.floor(within / TWO_32);
    const low = k * this.classLow + (within - withinHigh * TWO_32);
    const high = k * this.classHigh + withinHigh + Math.floor(low / TWO_32);
    if (minus) setHalves(this.halves, index, -1 - low, -1 - high);
    else setHalves(this.halves, index, low, high);
  }
}

/** Decimal digits of a positive integer of 31 bits. */
function countDigits(s) {
  let n = 1;
  while (n < LEAST_10.length && s >= LEAST_10[n]) n++;
  return n;
}
