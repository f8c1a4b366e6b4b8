// SPEC.md, "Time": the numbers of the frames of a clip, and the time of the first.

import { Refused } from "./errors.js";

const MAX_NUMBER = 2 ** 52 - 1; // of a frame

/**
 * @typedef {object} TimeBase
 * @property {number} number of the first frame
 * @property {number | null} firstTime its time in seconds, where that is stated
 * @property {{frames: number, length: number}[]} missing runs of missing frames
 */

/**
 * @param {import("./bytes.js").ByteReader} reader
 * @param {boolean} open the clip is open
 * @returns {TimeBase}
 * @throws {Refused}
 */
export function readTimeBase(reader, open) {
  const number = reader.zigzag();
  const firstTime = reader.optional(() => reader.f64());
  if (firstTime !== null && !Number.isFinite(firstTime)) reader.refuse(`a first time of ${firstTime} is not finite`);
  const missing = readMissing(reader);
  if (open && missing.length > 0) reader.refuse("an open clip states missing frames");
  return { number, firstTime, missing };
}

/** Runs of missing frames: how many frames come before each, and how many it has. */
export function readMissing(reader) {
  return reader.counted(() => {
    const run = { frames: reader.varint(), length: reader.varint() };
    if (run.frames === 0) reader.refuse("frames are missing before the first, or twice in a row");
    if (run.length === 0) reader.refuse("a run of missing frames is empty");
    return run;
  });
}

/**
 * The frame numbers, as runs of numbers that grow by 1.
 *
 * @param {import("./clip.js").Clip} clip whose number of frames is known; of an open one the end, too
 * @returns {{frame: number, number: bigint}[]} where each run begins, and with which number
 * @throws {Refused}
 */
export function frameNumbers({ name, nFrames, open, timeBase, end }) {
  const missing = (open ? end?.missing : timeBase?.missing) ?? [];
  let frame = 0;
  let number = timeBase?.number ?? 1;
  const runs = [{ frame, number: BigInt(number) }];
  for (const { frames, length } of missing) {
    frame += frames;
    number += frames + length;
    if (frame >= nFrames) throw new Refused(`clip ${name}: frames are missing behind the last`);
    checkNumber(name, number);
    runs.push({ frame, number: BigInt(number) });
  }
  checkNumber(name, number + nFrames - 1 - frame);
  return runs;
}

function checkNumber(name, number) {
  if (number > MAX_NUMBER) throw new Refused(`clip ${name}: a frame has the number ${number}`);
}
