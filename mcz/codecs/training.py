"""Training sets: positions of clips, and bases learned from them.

``mcz train`` and ``tools/train_lsdt.py`` call this module. Positions are in centimeters if the unit
of every clip is known, else in the common unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcz.codecs.basis_models import build_bases
from mcz.codecs.source_readers import fill_gaps
from mcz.codecs.transforms.bases import (
    GROWTH,
    ITERATIONS,
    SPARSITY,
    Learned,
    dct_matrix,
    learn_bases,
)
from mcz.errors import MotionError, OptionError
from mcz.kinematics.points import point_names, positions
from mcz.model.motion import Motion
from mcz.model.skeleton import column_of
from mcz.model.types import Floats, JsonObject

Progress = Callable[[int, int, str], None]

KINDS = ("frames", "steps", "windows")
STEP_FRAMES = 8  # of a step: short against a movement, long against the noise of a capture
WINDOW_FRAMES, WINDOW_KEPT = 120, 12  # of a window; its later coefficients are nearly 0
SIDES = (("l", "r"), ("L", "R"), ("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"))


@dataclass(frozen=True, slots=True)
class TrainingSet:
    """Clips of one set of points, each float64 (n_frames, J, 3), without missing points.

    ``up`` is "x" to "-z"; ``unit`` is "cm", or "" for clips without a known one. ``n_filled``
    counts the frames with a missing point, which is interpolated linearly there, as by the codecs.
    """

    names: tuple[str, ...]
    clips: tuple[Floats, ...]
    up: str
    unit: str
    n_filled: int = 0

    @property
    def n_frames(self) -> int:
        return sum(map(len, self.clips))


def training_set(motions: Iterable[Motion]) -> TrainingSet:
    """The positions of ``motions``.

    Raises MotionError if their points, their up axes or their known units differ, and for a
    motion without positions, or without a known one.
    """
    first: tuple[str, TrainingSet] | None = None
    clips: list[Floats] = []
    n_filled = 0
    for motion in motions:
        positions = _set_of_motion(motion)
        if first is None:
            first = motion.name, positions
        _check_alike(first, (motion.name, positions))
        clips.extend(positions.clips)
        n_filled += positions.n_filled
    if first is None:
        raise MotionError("training needs at least one clip")
    if not any(clip.any() for clip in clips):
        raise MotionError("training needs at least one frame with points")
    return replace(first[1], clips=tuple(clips), n_filled=n_filled)


def _set_of_motion(motion: Motion) -> TrainingSet:
    skeleton = motion.skeleton
    points = positions(motion)
    if not points.shape[1]:
        raise MotionError(f"motion {motion.name!r} has no points to train on")
    rows = points.reshape(len(points), 3 * points.shape[1])
    known = np.isfinite(rows)
    filled = fill_gaps(rows, known, np.full(rows.shape[1], np.nan))
    clip = filled.reshape(points.shape) * (skeleton.unit_cm or 1.0)
    n_filled = int((~known.all(axis=1)).sum())
    unit = "cm" if skeleton.unit_cm else ""
    return TrainingSet(point_names(skeleton), (clip,), skeleton.up_axis or "y", unit, n_filled)


def _check_alike(first: tuple[str, TrainingSet], other: tuple[str, TrainingSet]) -> None:
    (name_a, a), (name_b, b) = first, other
    names = f"motions {name_a!r} and {name_b!r}"
    if len(a.names) != len(b.names):
        raise MotionError(
            f"{names} have {len(a.names)} and {len(b.names)} points, but must have the same"
        )
    if a.names != b.names:
        at = next(
            i for i, pair in enumerate(zip(a.names, b.names, strict=True)) if len({*pair}) > 1
        )
        raise MotionError(f"{names} differ in point {at}: {a.names[at]!r} and {b.names[at]!r}")
    if a.up != b.up:
        raise MotionError(f"{names} have different up axes, {a.up} and {b.up}")
    if a.unit != b.unit:
        raise MotionError(f"of {names}, only one has a length unit")


def with_mirror_images(training: TrainingSet) -> TrainingSet:
    """``training`` and its mirror image: left and right swapped, x negated (z if x is up).

    Raises OptionError if no two points have names that differ only in their side.
    """
    order = mirror_order(training.names)
    if order == list(range(len(order))):
        raise OptionError("no two point names differ only in left and right")
    axis = 2 if column_of(training.up) == 0 else 0
    images = []
    for clip in training.clips:
        image = clip[:, order]
        image[:, :, axis] *= -1
        images.append(image)
    return replace(training, clips=(*training.clips, *images))


def mirror_order(names: Sequence[str]) -> list[int]:
    """Counterpart of each point on the other side, itself for none.

    >>> mirror_order(["root", "lfoot", "rfoot", "lowerback", "LeftHand", "RightHand"])
    [0, 2, 1, 3, 5, 4]
    """
    index = {name: i for i, name in enumerate(names)}
    order = list(range(len(names)))
    for left, right in SIDES:
        for i, name in enumerate(names):
            if name.startswith(left) and (other := right + name[len(left) :]) in index:
                order[i], order[index[other]] = index[other], i
    return order


def with_headings(training: TrainingSet, n_turns: int) -> TrainingSet:
    """``training`` in ``n_turns`` headings, 180 / ``n_turns`` degrees apart about the up axis.

    Half a turn negates the coordinates, which does not affect bases, so half a circle covers all
    headings.
    """
    if n_turns < 1:
        raise OptionError(f"headings is {n_turns}; it must be at least 1")
    up = column_of(training.up)
    a, b = (up + 1) % 3, (up + 2) % 3
    clips = []
    for turn in range(n_turns):
        angle = np.pi * turn / n_turns
        for clip in training.clips:
            image = clip.copy()
            image[:, :, a] = np.cos(angle) * clip[:, :, a] - np.sin(angle) * clip[:, :, b]
            image[:, :, b] = np.sin(angle) * clip[:, :, a] + np.cos(angle) * clip[:, :, b]
            clips.append(image)
    return replace(training, clips=tuple(clips))


def frames_of(training: TrainingSet, every: int = 1) -> Floats:
    """All frames of the clips, or every n-th of each, (N, J, 3)."""
    if every < 1:
        raise OptionError(f"every is {every}; it must be at least 1")
    return np.concatenate([clip[::every] for clip in training.clips])


def window_coefficients(training: TrainingSet, n_frames: int, n_kept: int) -> Floats:
    """The first ``n_kept`` DCT coefficients of windows of ``n_frames``, as frames (N, J, 3).

    The rest of a clip after its last whole window is a shorter window, scaled by its own length; if
    it has fewer frames than ``n_kept`` it has as many coefficients.
    """
    if n_frames < 1 or n_kept < 1:
        raise OptionError(f"windows of {n_frames} frames cannot keep {n_kept} coefficients each")
    parts = []
    for clip in training.clips:
        for start in range(0, len(clip), n_frames):
            window = clip[start : start + n_frames]
            parts.append(np.einsum("kf,fja->kja", dct_matrix(len(window))[:n_kept], window))
    return np.concatenate(parts)


def steps(training: TrainingSet, n_frames: int, every: int = 1) -> Floats:
    """Displacements of points over ``n_frames``, from every ``every``-th frame, (N, J, 3)."""
    if n_frames < 1 or every < 1:
        raise OptionError(f"cannot make steps of {n_frames} frames from every {every} frames")
    return np.concatenate(
        [(clip[n_frames:] - clip[:-n_frames])[::every] for clip in training.clips]
    )


@dataclass(frozen=True, slots=True)
class Recipe:
    """Options of learning a basis; ``learn_basis`` has the first four.

    ``kind``, one of ``KINDS``, is the data to make sparse: "frames" themselves, "steps" from one to
    a later one, DCT coefficients of "windows". ``mirror`` and ``headings`` add mirrored and turned
    copies of the clips; ``every`` uses only every n-th frame, or step.

    Why steps? A codec codes changes: differences of frames, or windows in which all but one
    coefficient in time represent movement. Bases learned from steps take fewer bits there at equal
    error than bases of the positions themselves, whose energy is mostly the place of the figure.
    """

    sparsity: int = SPARSITY
    iterations: int = ITERATIONS
    growth: int = GROWTH
    start: str = "dct"
    kind: str = "steps"
    mirror: bool = False
    headings: int = 1
    every: int = 1

    def vectors(self, training: TrainingSet) -> Floats:
        """Training vectors, (N, J, 3); raises OptionError for too short clips."""
        if self.mirror:
            training = with_mirror_images(training)
        training = with_headings(training, self.headings)
        if self.kind == "steps":
            vectors = steps(training, STEP_FRAMES, self.every)
        elif self.kind == "windows":
            vectors = window_coefficients(training, WINDOW_FRAMES, WINDOW_KEPT)
        elif self.kind == "frames":
            vectors = frames_of(training, self.every)
        else:
            raise OptionError(f"kind is {self.kind!r}; it must be one of {', '.join(KINDS)}")
        if not len(vectors):
            raise OptionError(f"no clip is long enough to train on {self.kind}")
        return vectors

    def learn(self, training: TrainingSet, progress: Progress | None = None) -> Trained:
        """The bases of x, y and z; raises OptionError as ``learn_basis``."""
        vectors = self.vectors(training)

        def report(done: int, at_most: int) -> None:
            if progress is not None:
                progress(done, at_most, f"learning from {len(vectors):,} vectors")

        learned = learn_bases(
            vectors,
            sparsity=self.sparsity,
            iterations=self.iterations,
            growth=self.growth,
            start=self.start,
            progress=report,
        )
        return Trained(training, len(vectors), learned)


# Settings of the bases of this package, for which tools/train_lsdt.py tries several starts and
# growths.
SHIPPED = Recipe(kind="steps", mirror=True, headings=2, every=2)


@dataclass(frozen=True, slots=True, eq=False)
class Trained:
    """Bases, one a coordinate, and their training set."""

    source: TrainingSet
    n_vectors: int
    learned: tuple[Learned, ...]

    @property
    def data(self) -> bytes:
        """The bases in integers, as the data of a model of SPEC.md, "Bases"."""
        return build_bases([learned.basis for learned in self.learned])

    def better(self, other: Trained) -> Trained:
        """Choose the better basis of each coordinate; raises OptionError if they do not compare.

        Minima differ, even with growth, by some percent, and occasionally by more; the last digit
        of the start decides which one is reached. So several are tried where it matters.
        """
        if self.n_vectors != other.n_vectors or self.source.names != other.source.names:
            raise OptionError("bases learned from different vectors cannot be compared")
        pairs = zip(self.learned, other.learned, strict=True)
        best = (min(pair, key=lambda learned: float(learned.objective[-1])) for pair in pairs)
        return replace(self, learned=tuple(best))

    def left_out(self, learned: Learned) -> Floats:
        """Rms residual of a point with the start and after each iteration, in units."""
        size = max(1, self.n_vectors * len(self.source.names))
        return np.sqrt(learned.objective / size)

    def document(self) -> JsonObject:
        """For JSON and people; ``left_out`` is rms, at the start and after each iteration."""
        return {
            "bytes": len(self.data),
            "n_points": len(self.source.names),
            "n_clips": len(self.source.clips),
            "n_frames": self.source.n_frames,
            "n_filled": self.source.n_filled,
            "n_vectors": self.n_vectors,
            "unit": self.source.unit or "length units",
            "coordinates": [
                {
                    "iterations": learned.n_iterations,
                    "start": float(self.left_out(learned)[0]),
                    "end": float(self.left_out(learned)[-1]),
                    "left_out": self.left_out(learned).tolist(),
                }
                for learned in self.learned
            ],
        }


def train(
    motions: Iterable[Motion], recipe: Recipe | None = None, progress: Progress | None = None
) -> Trained:
    """Bases from ``motions``; raises MotionError and OptionError."""
    return (recipe or Recipe()).learn(training_set(motions), progress)
