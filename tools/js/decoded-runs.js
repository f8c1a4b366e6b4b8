// Decoded frames that are kept for a while: who moves back and forth in a clip reads many windows
// of the same segments.

const LEAST_FRAMES = 128; // of a run, where segments are shorter
const MOST_OF_ONE = 64 * 1024 * 1024; // bytes of a run that is kept
const MOST_HELD = 192 * 1024 * 1024; // of all runs of a file

/**
 * Some frames of a signal that are decoded together.
 *
 * @typedef {{from: number, to: number}} Run stored frames from <= f < to
 */

/**
 * Cuts a signal into runs.
 *
 * @param {import("./clip.js").Signal} signal
 * @param {boolean} alone each segment is decoded by itself
 * @returns {Run[] | null} null where segments affect frames that are not their own
 */
export function runsOf({ segments }, alone) {
  const runs = [];
  for (const { firstFrame, nFrames, fresh, lead, tail } of segments) {
    if (!alone && (lead > 0 || tail > 0)) return null;
    const last = runs.at(-1);
    const joins = last && (!(alone || fresh) || last.to - last.from < LEAST_FRAMES);
    if (joins && last.to === firstFrame) last.to += nFrames;
    else runs.push({ from: firstFrame, to: firstFrame + nFrames });
  }
  return runs;
}

/**
 * The runs that have some of the stored frames from <= f < to.
 *
 * @param {Run[]} runs in order
 * @returns {Run[]}
 */
export function runsWithin(runs, from, to) {
  let [low, high] = [0, runs.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (runs[middle].to <= from) low = middle + 1;
    else high = middle;
  }
  let end = low;
  while (end < runs.length && runs[end].from < to) end++;
  return runs.slice(low, end);
}

/**
 * Wanted frames, cut out of what was decoded of neighboring runs.
 *
 * @param {{from: number, to: number, decoded: object}[]} parts frames of the clip
 * @param {import("./clip.js").Signal} signal
 * @param {{from: number, to: number}} request frames of the clip
 * @returns {{signal: object, nRows: number, nChannels: number, values: object, mask: object}}
 */
export function joined(parts, signal, { from, to }) {
  const { samplesPerFrame, integer, channels } = signal;
  const perFrame = samplesPerFrame * channels.length;
  const size = (to - from) * perFrame;
  const values = integer ? new BigInt64Array(size) : new Float64Array(size);
  const anyMask = parts.some(({ decoded }) => decoded.mask !== null);
  const mask = anyMask ? new Uint8Array(size).fill(1) : null;
  for (const { from: first, to: end, decoded } of parts) {
    const a = Math.max(from, first);
    const b = Math.min(to, end);
    const cut = (array) => array.subarray((a - first) * perFrame, (b - first) * perFrame);
    values.set(cut(decoded.values), (a - from) * perFrame);
    if (decoded.mask) mask.set(cut(decoded.mask), (a - from) * perFrame);
  }
  const nRows = (to - from) * samplesPerFrame;
  return { signal, nRows, nChannels: channels.length, values, mask };
}

/** What was decoded of runs, the run that was used last at the end. */
export class DecodedRuns {
  constructor() {
    this.held = new Map(); // by run: size, and a promise of what was decoded
    this.bytes = 0;
  }

  /** Whether so many bytes of a run may be kept. */
  mayKeep(bytes) {
    return bytes <= MOST_OF_ONE;
  }

  /**
   * What was decoded of a run, by `decode` where it is not at hand.
   *
   * @template T
   * @param {Run} run always the same object
   * @param {number} size its bytes
   * @param {() => Promise<T>} decode
   * @returns {Promise<T>}
   */
  get(run, size, decode) {
    const entry = this.held.get(run) ?? { size, decoded: decode() };
    if (!this.held.delete(run)) {
      this.bytes += size;
      entry.decoded.catch(() => this.drop(run, entry));
    }
    this.held.set(run, entry);
    while (this.bytes > MOST_HELD) this.drop(...this.held.entries().next().value);
    return entry.decoded;
  }

  drop(run, entry) {
    if (this.held.get(run) !== entry) return;
    this.held.delete(run);
    this.bytes -= entry.size;
  }
}
