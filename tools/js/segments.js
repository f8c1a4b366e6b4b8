// What codecs that reach back by whole units (2, 3, 5 and 6) ask of segments.

import { Refused } from "./errors.js";

/**
 * @param {object[]} segments
 * @param {{ unit: number, codedFrames: number, reach: number }} codec frames that segments are
 *   cut at multiples of; all stored frames; the longest lead
 * @throws {Refused}
 */
export function checkCuts(segments, { unit, codedFrames, reach }) {
  for (const { firstFrame, nFrames, lead, tail, fresh } of segments) {
    const end = firstFrame + nFrames;
    const where = `segment at frame ${firstFrame}`;
    if (firstFrame % unit !== 0) throw new Refused(`${where}: not a multiple of ${unit}`);
    if (end > codedFrames) throw new Refused(`${where}: ends behind coded_frames`);
    if (end % unit !== 0 && end !== codedFrames) {
      throw new Refused(`${where}: its end ${end} is not a multiple of ${unit}`);
    }
    if (lead !== Math.min(firstFrame, reach)) throw new Refused(`${where}: a lead of ${lead}`);
    if (tail !== 0) throw new Refused(`${where}: a tail of ${tail}`);
    if (!fresh) throw new Refused(`${where}: does not start fresh`);
  }
}
