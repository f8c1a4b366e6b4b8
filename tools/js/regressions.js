// SPEC.md, "Codec 2: best", "Regressions".

const LIMIT = 2 ** 20;
const FLOOR = 1e-6;
const AWAY = 1e300;

/** v, or 0 where it is too large or no number. */
export function bounded(v) {
  return v > -LIMIT && v < LIMIT ? v : 0;
}

/** A regression that is learned while it is used. */
export class Learner {
  /**
   * @param {number} n features
   * @param {number} keep what is kept of the sums from row to row
   * @param {number} ridge
   */
  constructor(n, keep, ridge) {
    this.n = n;
    this.keep = keep;
    this.ridge = ridge;
    this.features = new Float64Array(n);
    this.weights = new Float64Array(n);
    this.sums = new Float64Array(n * (n + 1)); // row after row; the last of a row is the target's
    this.typical = 1;
    this.work = new Float64Array(n * (n + 1));
    this.weighted = new Float64Array(n + 1);
  }

  /** What it says of its features. */
  expect() {
    const { n, features, weights } = this;
    let total = 0;
    for (let i = 0; i < n; i++) total += weights[i] * features[i];
    return bounded(total);
  }

  /** Takes in, in row r, what the target was, and what was guessed. BEST-18 */
  learn(r, target, guess) {
    const { n, features, sums, keep, weighted, typical } = this;
    const e = target - guess;
    const g = 1 / (typical * typical + 0.3 * (e * e) + 1e-9);
    for (let i = 0; i < n; i++) weighted[i] = g * features[i];
    weighted[n] = g * target;
    for (let i = 0; i < n; i++) {
      const at = i * (n + 1);
      for (let j = i; j <= n; j++) sums[at + j] = keep * sums[at + j] + features[i] * weighted[j];
    }
    this.typical = typical + (Math.abs(e) - typical) * (r < 20 ? 0.2 : 0.05);
  }

  /** Fits the weights to the sums. */
  solve() {
    const { n, ridge, weights, work } = this;
    const width = n + 1;
    work.set(this.sums);
    for (let i = 0; i < n; i++) {
      const at = i * width + i;
      work[at] += ridge + 1e-10 * work[at];
    }
    for (let k = 0; k < n; k++) {
      const top = k * width;
      if (!(work[top + k] > ridge * FLOOR)) work[top + k] = AWAY;
      const v = 1 / work[top + k];
      for (let i = k + 1; i < n; i++) {
        const q = work[top + i] * v;
        const at = i * width;
        for (let j = i; j <= n; j++) work[at + j] -= q * work[top + j];
      }
    }
    for (let i = n - 1; i >= 0; i--) {
      const at = i * width;
      let x = work[at + n];
      for (let j = i + 1; j < n; j++) x -= work[at + j] * weights[j];
      weights[i] = x / work[at + i];
    }
  }
}
