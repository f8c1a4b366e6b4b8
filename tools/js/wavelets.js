// SPEC.md, "Wavelets": the registered filters, the lengths of bands, and synthesis.

/**
 * A wavelet: two synthesis filters of the same even number of taps.
 *
 * @typedef {{ lo: Float64Array, hi: Float64Array }} Wavelet
 */

/** `hi` where the registry says *from `lo`*: lo backwards, with a minus at odd k. */
function fromLo(lo) {
  const last = lo.length - 1;
  return lo.map((_, k) => (k % 2 === 0 ? lo[last - k] : -lo[last - k]));
}

function wavelet(lo, hi = fromLo(lo)) {
  return { lo: Float64Array.from(lo), hi: Float64Array.from(hi) };
}

/**
 * The registered wavelets by id; what stands at 0 is none of them.
 *
 * @type {(Wavelet | null)[]}
 */
export const WAVELETS = [
  null,
  // 1: haar
  wavelet([0.7071067811865476, 0.7071067811865476]),
  // 2: db2
  wavelet([0.48296291314453416, 0.8365163037378079, 0.2241438680420134, -0.12940952255126037]),
  // 3: db3
  wavelet([
    0.33267055295008263, 0.8068915093110925, 0.45987750211849154, -0.13501102001025458,
    -0.08544127388202666, 0.03522629188570953,
  ]),
  // 4: db4
  wavelet([
    0.2303778133088965, 0.7148465705529157, 0.6308807679298589, -0.027983769416859854,
    -0.18703481171909309, 0.030841381835560764, 0.0328830116668852, -0.010597401785069032,
  ]),
  // 5: db5
  wavelet([
    0.16010239797419293, 0.6038292697971896, 0.7243085284377729, 0.13842814590132074,
    -0.24229488706638203, -0.032244869584638375, 0.07757149384004572, -0.006241490212798274,
    -0.012580751999081999, 0.0033357252854737712,
  ]),
  // 6: db6
  wavelet([
    0.11154074335010947, 0.49462389039845306, 0.7511339080210954, 0.31525035170919763,
    -0.22626469396543983, -0.12976686756726194, 0.09750160558732304, 0.027522865530305727,
    -0.03158203931748603, 0.0005538422011614961, 0.004777257510945511, -0.0010773010853084796,
  ]),
  // 7: db7
  wavelet([
    0.07785205408500918, 0.3965393194819173, 0.7291320908462351, 0.4697822874051931,
    -0.14390600392856498, -0.22403618499387498, 0.07130921926683026, 0.08061260915108308,
    -0.03802993693501441, -0.01657454163066688, 0.01255099855609984, 0.0004295779729213665,
    -0.0018016407040474908, 0.00035371379997452024,
  ]),
  // 8: db8
  wavelet([
    0.05441584224310401, 0.31287159091429995, 0.6756307362972898, 0.5853546836542067,
    -0.015829105256349306, -0.2840155429615469, 0.0004724845739132828, 0.12874742662047847,
    -0.017369301001807547, -0.044088253930794755, 0.013981027917398282, 0.008746094047405777,
    -0.004870352993451574, -0.00039174037337694705, 0.0006754494064505693,
    -0.00011747678412476953,
  ]),
  // 9: sym4
  wavelet([
    0.0322231006040427, -0.012603967262037833, -0.09921954357684722, 0.29785779560527736,
    0.8037387518059161, 0.49761866763201545, -0.02963552764599851, -0.07576571478927333,
  ]),
  // 10: bior4.4
  wavelet(
    [
      0.0, -0.06453888262869706, -0.04068941760916406, 0.41809227322161724, 0.7884856164055829,
      0.41809227322161724, -0.04068941760916406, -0.06453888262869706, 0.0, 0.0,
    ],
    [
      0.0, -0.03782845550726404, -0.023849465019556843, 0.11062440441843718, 0.37740285561283066,
      -0.8526986790088938, 0.37740285561283066, 0.11062440441843718, -0.023849465019556843,
      -0.03782845550726404,
    ],
  ),
];

/**
 * The lengths n_0 to n_N of a transform.
 *
 * @param {number} n rows of the signal
 * @param {number} taps L
 * @param {number} levels N
 * @returns {number[]} levels + 1 lengths
 */
export function bandLengths(n, taps, levels) {
  const lengths = [n];
  for (let l = 0; l < levels; l++) lengths.push(Math.floor((lengths[l] + taps - 1) / 2));
  return lengths;
}

/**
 * The coefficients s_l to e_l - 1 that the rows start to end - 1, at least one, need of each level.
 *
 * @param {number} start first row
 * @param {number} end row behind the last
 * @param {number} taps L
 * @param {number} levels N
 * @returns {{ starts: number[], ends: number[] }} levels + 1 of each
 */
export function neededRanges(start, end, taps, levels) {
  const starts = [start];
  const ends = [end];
  for (let l = 0; l < levels; l++) {
    starts.push(Math.floor(starts[l] / 2));
    ends.push(Math.floor((ends[l] + taps - 3) / 2) + 1);
  }
  return { starts, ends };
}

/**
 * One level of synthesis, of a run of rows.
 *
 * @param {Wavelet} filters
 * @param {Float64Array} approximation of level l; its element 0 is the coefficient start div 2
 * @param {Float64Array | null} detail of level l, likewise; null where there are no details
 * @param {number} start first coefficient of level l - 1
 * @param {number} end the one behind the last
 * @returns {Float64Array} the approximation of level l - 1, from start on
 */
export function synthesis({ lo, hi }, approximation, detail, start, end) {
  const out = new Float64Array(end - start);
  const taps = lo.length;
  const base = Math.floor(start / 2);
  for (let i = 0; i < out.length; i++) {
    const n = start + i;
    // Of k = n div 2 only what lies in the arrays counts; the taps fall by 2 as k grows by 1.
    const from = Math.floor(n / 2) - base;
    const top = n % 2 === 0 ? taps - 2 : taps - 1;
    let x = 0;
    for (let tap = top, k = from; tap >= 0; tap -= 2, k++) x += lo[tap] * approximation[k];
    if (detail !== null) {
      for (let tap = top, k = from; tap >= 0; tap -= 2, k++) x += hi[tap] * detail[k];
    }
    out[i] = x;
  }
  return out;
}
