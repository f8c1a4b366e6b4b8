// SPEC.md, "Held contacts": how displacements go on along an axis, by least squares that forget.

import { clamp } from "./entropy.js";

export const N_FEATURES = 9;

const MOST = 4096;
const MEMORY = 255 / 256;
const RIDGE = 64;
const USUAL = [0.25, -0.125, 0.0625, 0, 0.6875, 0.125, -0.25, 0.75, 0.1875];

const limited = (x) => clamp(x, -MOST, MOST);

/** What is known along an axis; `mean` is how far the displacement is expected to move. */
export class DisplacementModel {
  constructor() {
    this.w = Float64Array.from(USUAL);
    this.M = new Float64Array(N_FEATURES * N_FEATURES);
    this.P = new Float64Array(N_FEATURES);
    this.L = new Float64Array(N_FEATURES * N_FEATURES);
    this.d = new Float64Array(N_FEATURES);
    this.b = new Float64Array(N_FEATURES);
    this.x = new Float64Array(N_FEATURES);
    this.mean = 0;
  }

  /** @param {ArrayLike<number>} features each at most 4096 in magnitude */
  expect(features) {
    const { w, x } = this;
    let sum = 0;
    for (let n = 0; n < N_FEATURES; n++) {
      x[n] = features[n];
      sum += w[n] * x[n];
    }
    this.mean = limited(sum);
  }

  /** Learns how far it has moved. */
  learn(moved) {
    const { x, P, M } = this;
    let y = limited(moved);
    for (let n = 0; n < N_FEATURES; n++) y -= USUAL[n] * x[n];
    for (let n = 0; n < N_FEATURES; n++) {
      P[n] = P[n] * MEMORY + y * x[n];
      for (let p = 0; p <= n; p++) {
        M[n * N_FEATURES + p] = M[n * N_FEATURES + p] * MEMORY + x[n] * x[p];
      }
    }
    this.factor();
    this.solve();
  }

  /** M and a ridge as L d L'. */
  factor() {
    const { M, L, d } = this;
    for (let n = 0; n < N_FEATURES; n++) {
      for (let p = 0; p <= n; p++) {
        let t = M[n * N_FEATURES + p];
        if (n === p) t += RIDGE;
        for (let g = 0; g < p; g++) t -= L[n * N_FEATURES + g] * L[p * N_FEATURES + g] * d[g];
        if (n === p) d[n] = Math.max(t, RIDGE);
        else L[n * N_FEATURES + p] = t / d[p];
      }
    }
  }

  solve() {
    const { P, L, d, b, w } = this;
    for (let n = 0; n < N_FEATURES; n++) {
      b[n] = P[n];
      for (let g = 0; g < n; g++) b[n] -= L[n * N_FEATURES + g] * b[g];
    }
    for (let n = N_FEATURES - 1; n >= 0; n--) {
      b[n] /= d[n];
      for (let g = n + 1; g < N_FEATURES; g++) b[n] -= L[g * N_FEATURES + n] * b[g];
    }
    for (let n = 0; n < N_FEATURES; n++) w[n] = b[n] + USUAL[n];
  }
}
