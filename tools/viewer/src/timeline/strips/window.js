// The part of the clip's time that strips show: frames from <= f < to, of one clip.

const LEAST = 4; // frames
const NEAR = 24; // pixels: fingers do not come nearer to each other

/** The window of `nFrames` frames that is nearest to the wished one. */
export function clamped(from, to, nFrames) {
  const length = Math.min(nFrames, Math.max(Math.min(LEAST, nFrames), to - from));
  const start = Math.max(0, Math.min(nFrames - length, from));
  return { from: start, to: start + length };
}

/** The window zoomed by a factor about a frame that stays where it is. */
export function zoomed({ from, to }, factor, about, nFrames) {
  const length = Math.max(LEAST, (to - from) * factor);
  const share = (about - from) / (to - from);
  const start = about - share * length;
  return clamped(start, start + length, nFrames);
}

/**
 * The window in which two frames are below two fingers.
 *
 * @param {number[]} frames @param {number[]} xs of the fingers, in pixels of `width`
 */
export function pinched([a, b], [x, y], width, nFrames) {
  const between = Math.max(NEAR, Math.abs(y - x)); // fingers that cross go on as they were
  const each = Math.abs(b - a) / between; // frames a pixel
  const middle = (a + b) / 2;
  const from = middle - ((x + y) / 2) * each;
  return clamped(from, from + width * each, nFrames);
}

export const moved = ({ from, to }, by, nFrames) => clamped(from + by, to + by, nFrames);

/** Whole frames that cover the window. */
export const whole = ({ from, to }, nFrames) => ({
  from: Math.max(0, Math.floor(from)),
  to: Math.min(nFrames, Math.ceil(to)),
});

/** A step of 1, 2 or 5 times a power of ten, about `n` of which fill `length`. */
export function niceStep(length, n) {
  const rough = length / Math.max(1, n);
  if (!(rough > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const factor = [1, 2, 5, 10].find((f) => f * power >= rough * 0.999);
  return factor * power;
}
