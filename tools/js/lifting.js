// SPEC.md, "Lifting": the 9/7 wavelet in time, a step at a time.

const APPROXIMATION = 1.230174104914001;
const DETAIL = 1.149604398860241;

/** What each step adds of the neighbors: to rows 0, 2, ..., then 1, 3, ..., and so on. */
const FACTORS = [-0.443506852043971, -0.882911075530934, 0.052980118572961, 1.586134342059924];

/**
 * Rows of the approximation after 0, 1, ... halvings; a single row is not halved.
 *
 * @param {number} n rows of the signal
 * @param {number} levels halvings at most
 * @returns {number[]} n_0 to n_N
 */
export function halvings(n, levels) {
  const lengths = [n];
  while (lengths.length <= levels && lengths.at(-1) > 1) {
    lengths.push(Math.floor((lengths.at(-1) + 1) / 2));
  }
  return lengths;
}

/**
 * The signal of an approximation and a detail, at least two rows.
 *
 * @param {Float64Array} approximation (n + 1) div 2 rows
 * @param {Float64Array} detail n div 2 rows
 * @param {number} nChannels numbers of a row, at least 1
 * @returns {Float64Array} n rows
 */
export function join(approximation, detail, nChannels) {
  const out = new Float64Array(approximation.length + detail.length);
  spread(approximation, APPROXIMATION, out, 0, nChannels);
  spread(detail, DETAIL, out, 1, nChannels);
  FACTORS.forEach((factor, i) => lift(out, i % 2, factor, nChannels));
  return out;
}

/** Puts `scale` times the rows where the rows `first`, `first` + 2, ... are. */
function spread(rows, scale, out, first, nChannels) {
  let to = first * nChannels;
  for (let from = 0; from < rows.length; to += nChannels) {
    for (let end = from + nChannels; from < end; from++, to++) out[to] = rows[from] * scale;
  }
}

function lift(x, first, factor, nChannels) {
  const nRows = x.length / nChannels;
  for (let n = first; n < nRows; n += 2) {
    let before = (n > 0 ? n - 1 : 1) * nChannels;
    let after = (n + 1 < nRows ? n + 1 : nRows - 2) * nChannels;
    const end = (n + 1) * nChannels;
    for (let at = n * nChannels; at < end; at++) x[at] += factor * (x[before++] + x[after++]);
  }
}
