// Which lines of a skeleton are bones. Some files begin with a reference on the floor, from which the
// hips go away; what changes its length is no bone.

const MOST_CHANGE = 0.25; // of its mean length
const MOST_CHANGE_OF_ROOT = 0.005; // of the only bone at the first point, which may be a reference
const MOST_LENGTH = 0.75; // of the figure

/**
 * @param {{points: object[], bones: number[][], isMarkers: boolean}} clip
 * @param {ArrayLike<number>[]} samples x, y, z of each point in some frames
 * @returns {{bones: number[][], loose: Set<number>}} bones that are drawn; points that have lost all
 *   of theirs, which are no part of the figure
 */
export function anatomyOf({ points, bones, isMarkers }, samples) {
  if (isMarkers) return { bones, loose: new Set() };
  const lengths = bones.map(([a, b]) =>
    samples.map((places) => distance(places, a, b)).filter(Number.isFinite),
  );
  const ofFirst = bones.filter((bone) => bone.includes(0));
  const steady = bones.map((bone, i) => {
    const isAlone = ofFirst.length === 1 && bone === ofFirst[0];
    return isSteady(lengths[i], isAlone ? MOST_CHANGE_OF_ROOT : MOST_CHANGE);
  });
  const size = sizeOf(
    bones.filter((_, i) => steady[i]),
    samples,
  );
  const kept = bones.filter((_, i) => steady[i] && !(Math.max(...lengths[i]) > MOST_LENGTH * size));
  const joined = new Set(kept.flat());
  const isLoose = (point) =>
    kept.length > 0 && !joined.has(point) && bones.some((bone) => bone.includes(point));
  return {
    bones: kept,
    loose: new Set(points.flatMap((_, point) => (isLoose(point) ? [point] : []))),
  };
}

/**
 * The first point of the figure that moves: what its curves begin with.
 *
 * @param {{points: object[], bones: number[][], isMarkers: boolean}} clip
 * @param {ArrayLike<number>[]} samples x, y, z of each point in some frames
 * @returns {number} its index; that of the first point of the figure where nothing moves
 */
export function leadOf(clip, samples) {
  const { loose } = anatomyOf(clip, samples);
  const ofFigure = clip.points.map((_, point) => point).filter((point) => !loose.has(point));
  return ofFigure.find((point) => moves(point, samples)) ?? ofFigure[0] ?? 0;
}

function moves(point, samples) {
  return [0, 1, 2].some((k) => {
    const numbers = samples.map((places) => places[3 * point + k]).filter(Number.isFinite);
    return numbers.some((x) => x !== numbers[0]);
  });
}

function isSteady(lengths, mostChange) {
  if (lengths.length === 0) return true;
  const [least, most] = [Math.min(...lengths), Math.max(...lengths)];
  return most - least <= (mostChange * (most + least)) / 2;
}

/** The longest side of the box around the ends of some bones; the median of samples. */
function sizeOf(bones, samples) {
  const ends = [...new Set(bones.flat())];
  const sizes = samples.map((places) => {
    const side = (k) => {
      const numbers = ends.map((point) => places[3 * point + k]).filter(Number.isFinite);
      return numbers.length === 0 ? 0 : Math.max(...numbers) - Math.min(...numbers);
    };
    return Math.max(side(0), side(1), side(2));
  });
  return sizes.sort((a, b) => a - b)[Math.floor(sizes.length / 2)] ?? 0;
}

function distance(places, a, b) {
  return Math.hypot(...[0, 1, 2].map((k) => places[3 * a + k] - places[3 * b + k]));
}
