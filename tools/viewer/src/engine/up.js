// Which axis points up, where a file does not say it.

const HIGH = /head|neck|(?:^|:)[lr][fb]hd$/i;
const LOW = /foot|toe|ankle|heel|(?:^|:)[lr](?:ank|hee|toe|mt5)$/i;

/**
 * @param {{name: string}[]} points
 * @param {Float32Array} places x, y, z of each point of each frame
 * @param {boolean} isMarkers of markers z is likelier, of skeletons y
 * @returns {number} 0 x, 1 y, 2 z
 */
export function guessedUp(points, places, isMarkers) {
  const usual = isMarkers ? 2 : 1;
  const mean = (pattern) => meanPlace(points, places, pattern);
  const high = mean(HIGH);
  const low = mean(LOW);
  if (high !== null && low !== null) {
    const way = high.map((x, k) => Math.abs(x - low[k]));
    const greatest = way.indexOf(Math.max(...way));
    if (way[greatest] > 0) return greatest;
  }
  return usual;
}

function meanPlace(points, places, pattern) {
  const sum = [0, 0, 0];
  let count = 0;
  const chosen = points.flatMap(({ name }, index) => (pattern.test(name) ? [index] : []));
  for (let start = 0; start < places.length; start += points.length * 3) {
    for (const index of chosen) {
      const at = start + 3 * index;
      if (Number.isNaN(places[at])) continue;
      for (let k = 0; k < 3; k++) sum[k] += places[at + k];
      count++;
    }
  }
  return count === 0 ? null : sum.map((x) => x / count);
}
