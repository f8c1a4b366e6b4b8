// SPEC.md, "Prefix codes": integers from 0 to 2^41 - 1 in classes, the classes in prefix codes.

import { Refused } from "./errors.js";

const CLASSES = 90;
const LONGEST = 15;

/** A prefix code of classes, made of the lengths of its codes. */
export class PrefixCode {
  /**
   * @param {number[]} lengths bits of the code of each class from 0 on; 0: it does not occur
   * @param {string} what named in messages
   * @throws {Refused} where the lengths make no code
   */
  constructor(lengths, what) {
    this.what = what;
    this.counts = new Int32Array(LONGEST + 1);
    checkLengths(lengths, this.counts, what);
    // Classes in the order of their codes: by length, then by class.
    this.classes = [];
    for (let length = 1; length <= LONGEST; length++) {
      for (let c = 0; c < lengths.length; c++) if (lengths[c] === length) this.classes.push(c);
    }
  }

  /** The class whose code comes next. */
  symbol(bits) {
    let v = 0;
    let first = 0;
    let shorter = 0; // classes whose codes are shorter
    for (let length = 1; length <= LONGEST; length++) {
      const k = this.counts[length];
      v = 2 * v + bits.bit();
      if (v < first + k) return this.classes[shorter + v - first];
      first = 2 * (first + k);
      shorter += k;
    }
    throw new Refused(`${this.what}: these bits are no code`);
  }

  /**
   * The next integer, 0 to 2^41 - 1.
   *
   * @param {import("./bits.js").BitReader} bits
   * @throws {Refused} where the bits are no code
   */
  integer(bits) {
    const c = this.symbol(bits);
    if (c < 16) return c;
    const n = Math.floor((c - 16) / 2) + 3;
    return (2 + (c % 2)) * 2 ** n + bits.plain(n);
  }
}

/** Counts the lengths and refuses those that make no whole code, but for none and a single 1. */
function checkLengths(lengths, counts, what) {
  if (lengths.length > CLASSES) throw new Refused(`${what}: ${lengths.length} lengths`);
  let sum = 0; // of 2^(15 - l)
  let used = 0;
  for (const length of lengths) {
    if (length > LONGEST) throw new Refused(`${what}: a code of ${length} bits`);
    if (length === 0) continue;
    counts[length]++;
    sum += 2 ** (LONGEST - length);
    used++;
  }
  const single = used === 1 && counts[1] === 1;
  if (used > 0 && !single && sum !== 2 ** LONGEST) {
    throw new Refused(`${what}: the lengths do not make a whole code`);
  }
}
