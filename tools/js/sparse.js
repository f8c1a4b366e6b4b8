// SPEC.md, "Sparse lists": where coefficients are not 0, and what they are there.

import { bits as digits } from "./entropy.js";
import { Refused } from "./errors.js";
import { GREATEST } from "./scales.js";

/**
 * Decodes one sparse list.
 *
 * @param {import("./bits.js").BitReader} bits
 * @param {{ gaps: PrefixCode, values: PrefixCode }} code the codes of CODE
 * @param {Float64Array} out where the list goes
 * @param {number} start index of its first entry
 * @param {number} n its entries
 * @throws {Refused} where an entry lies behind the list or is too large
 */
export function sparseList(bits, code, out, start, n) {
  out.fill(0, start, start + n);
  let at = 0;
  for (let count = bits.plain(digits(n)); count > 0; count--) {
    const gap = code.gaps.integer(bits);
    if (gap >= n - at) throw new Refused(`${bits.what}: a gap of ${gap}, ${n - at} are left`);
    at += gap;
    const size = code.values.integer(bits) + 1;
    if (size > GREATEST) throw new Refused(`${bits.what}: the coefficient ${size}`);
    out[start + at] = bits.bit() === 1 ? -size : size;
    at++;
  }
}
