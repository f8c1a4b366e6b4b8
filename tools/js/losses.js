// Which frames of a signal can be decoded, though some of its segments are lost.

/**
 * A run of segments that follow one another, from one that starts fresh on.
 *
 * @typedef {object} Chain
 * @property {import("./data.js").Segment[]} segments
 * @property {number} from first stored frame that can be decoded
 * @property {number} to behind the last
 */

/**
 * @param {import("./data.js").Segment[]} segments those that are there, in frame order
 * @param {number} stored frames of the signal, where it is whole
 * @returns {Chain[]}
 */
export function chainsOf(segments, stored) {
  const chains = [];
  let chain = null;
  for (const segment of segments) {
    if (chain && chain.to !== segment.firstFrame) chain = null;
    if (chain === null && segment.fresh) {
      chain = { segments: [], from: segment.firstFrame, to: segment.firstFrame };
      chains.push(chain);
    }
    if (chain === null) continue;
    chain.segments.push(segment);
    chain.to += segment.nFrames;
  }
  // What a lost neighbor affects is lost with it; it reaches no farther than others do.
  const lead = segments.reduce((most, segment) => Math.max(most, segment.lead), 0);
  const tail = segments.reduce((most, segment) => Math.max(most, segment.tail), 0);
  let end = 0; // of the chain before
  chains.forEach((own, i) => {
    const next = chains[i + 1];
    const isBefore = own.from === 0 || own.from === end;
    const isBehind = own.to >= stored || own.to === next?.from;
    end = own.to;
    if (!isBefore) own.from += tail;
    if (!isBehind) own.to -= lead;
  });
  return chains.filter(({ from, to }) => from < to);
}

/**
 * The stored frames of a signal, those that are lost among them.
 *
 * @param {{nFrames: number, declared: number, open: boolean}} clip `declared`: frames of CLIP
 * @param {number} hidden frames that are not shown
 * @param {boolean} ended the clip has its CEND
 * @returns {number} Infinity where nobody knows
 */
export function storedFrames({ nFrames, declared, open }, hidden, ended) {
  if (ended) return nFrames + hidden;
  return open ? Infinity : declared + hidden;
}

/**
 * @param {import("./data.js").Segment[]} segments those that are there, in frame order
 * @param {number} stored frames of the signal, where it is whole
 * @returns {[number, number][]} runs of stored frames that cannot be decoded
 */
export function lostFrames(segments, stored) {
  const lost = [];
  let at = 0;
  for (const { from, to } of chainsOf(segments, stored)) {
    if (from > at) lost.push([at, from]);
    at = to;
  }
  if (at < stored) lost.push([at, stored]);
  return lost;
}
