// SPEC.md, "Cosines": the orthonormal DCT-II, in binary64 and in one order.

const QUARTER_TURN = 1.5707963267948966;

/** Tables that were made last; together at most so many numbers, but for a single one. */
const CACHED_NUMBERS = 2 ** 23;
const cache = new Map();
let cached = 0;

/** The square root of v, by 40 steps of Newton's. */
export function root(v) {
  let r = 1;
  for (let i = 0; i < 40; i++) r = (r + v / r) / 2;
  return r;
}

/** The cosine of m pi / (2 n), 0 <= m <= n. */
function quarter(m, n) {
  const x = (Math.min(m, n - m) * QUARTER_TURN) / n;
  const q = x * x;
  let c = 1;
  let s = 1;
  for (let i = 9; i >= 1; i--) {
    c = 1 - (q * c) / ((2 * i - 1) * (2 * i));
    s = 1 - (q * s) / (2 * i * (2 * i + 1));
  }
  return 2 * m <= n ? c : x * s;
}

function makeCosines(n, rows) {
  const quarters = new Float64Array(n + 1);
  for (let m = 0; m <= n; m++) quarters[m] = quarter(m, n);
  const scale = root(2 / n);
  const table = new Float64Array(rows * n);
  table.fill(root(1 / n), 0, n);
  for (let k = 1; k < rows; k++) {
    for (let j = 0; j < n; j++) {
      let t = ((2 * j + 1) * k) % (4 * n);
      if (t > 2 * n) t = 4 * n - t;
      table[k * n + j] = (t <= n ? quarters[t] : -quarters[2 * n - t]) * scale;
    }
  }
  return table;
}

/**
 * The first rows of the matrix of n cosines, row after row. Nobody changes what is returned.
 *
 * @param {number} n at least 1
 * @param {number} [rows] at least 1, at most n
 * @returns {Float64Array} rows * n numbers
 */
export function cosines(n, rows = n) {
  const key = `${n} ${rows}`;
  let table = cache.get(key);
  if (table !== undefined) return table;
  table = makeCosines(n, rows);
  cache.set(key, table);
  cached += table.length;
  for (const [oldest, { length }] of cache) {
    if (cached <= CACHED_NUMBERS || oldest === key) break;
    cache.delete(oldest);
    cached -= length;
  }
  return table;
}
