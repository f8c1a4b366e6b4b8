// Least and greatest values for columns of pixels, of a list of numbers by frame.

/**
 * @param {(frame: number) => number} valueAt NaN where there is none
 * @returns {{least: Float32Array, most: Float32Array}} `width` numbers each
 */
export function rangeOf(valueAt, { from, to, width }) {
  const least = new Float32Array(width).fill(NaN);
  const most = new Float32Array(width).fill(NaN);
  const scale = width / Math.max(1, to - from);
  for (let frame = from; frame < to; frame++) {
    const value = valueAt(frame);
    if (Number.isNaN(value)) continue;
    const at = Math.min(width - 1, Math.floor((frame - from) * scale));
    if (!(least[at] <= value)) least[at] = value;
    if (!(most[at] >= value)) most[at] = value;
  }
  return { least, most };
}

/** The least and greatest of several courses; [0, 1] where there is nothing. */
export function extentOf(courses) {
  let least = Infinity;
  let most = -Infinity;
  for (const course of courses) {
    for (const value of course.least) if (value < least) least = value;
    for (const value of course.most) if (value > most) most = value;
  }
  return least <= most ? [least, most] : [0, 1];
}

/** Frames of the greatest values: each the greatest within `apart` frames, highest first. */
export function peaksOf(values, { from, to, apart, most }) {
  const width = Math.max(1, Math.round(apart));
  const tops = [];
  for (let start = from; start < to; start += width) {
    let best = -1;
    for (let f = start; f < Math.min(to, start + width); f++) {
      if (values[f] > 0 && !(values[best] >= values[f])) best = f;
    }
    if (best >= 0) tops.push(best);
  }
  const isTop = (f, k) => !(values[tops[k - 1]] > values[f]) && !(values[tops[k + 1]] >= values[f]);
  return tops
    .filter(isTop)
    .sort((a, b) => values[b] - values[a])
    .slice(0, most);
}
