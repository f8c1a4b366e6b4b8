"""Data of a small player: few frames of few bytes, for a motion of any length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.files.reading.clip import Clip
from mcz.kinematics import positions_of
from mcz.kinematics.points import first_points, listed_points
from mcz.kinematics.retargeting.sides import sides_of
from mcz.model.motion import Motion, Skeleton
from mcz.model.skeleton import column_of, signs_of

MOST_POINTS = 4096
MOST_READ = 3000  # frames of a clip that are decoded to show some of them
MOST_NUMBERS = 2**21  # likewise, of all channels
RATE = 30.0  # frames a second that are enough; the player draws what lies between two
MISSING = -32768  # the word of a coordinate that is not known
LARGEST = 32767
FAR = 1e100  # what is farther away is missing: nothing else would be seen beside it
Words = NDArray[np.int16]
Moving: TypeAlias = Motion | Clip


@dataclass(frozen=True, slots=True)
class Figure:
    """Constant parts: ``bones``, pairs of points; ``sides`` 0, 1 left, 2 right of points."""

    bones: list[tuple[int, int]]
    sides: list[int]


@dataclass(frozen=True, slots=True)
class Drawn:
    """Words of (frames, points, 3), each ``step`` length units from the middle of what is seen.

    Every ``every``-th of the first ``n_read`` frames. ``floor`` is the lowest coordinate along the
    axis ``up``, ``radius`` the greatest of all, both counted from the middle.
    """

    words: Words
    step: float
    every: int
    n_read: int
    up: int
    floor: float
    radius: float


def figure(skeleton: Skeleton) -> Figure:
    """The lines and sides; raises MotionError where there is no point, or too many to draw."""
    points = list(listed_points(skeleton))
    if not 0 < len(points) <= MOST_POINTS:
        why = f"at most {MOST_POINTS:,} are drawn" if points else "there is nothing to draw"
        raise MotionError(f"{len(points):,} points: {why}")
    sides = [("", "left", "right").index(side) for side in sides_of(skeleton.addresses())]
    return Figure(lines_of(skeleton), [sides[joint] for joint, _ in points])


def drawn(moving: Moving, most_frames: int, every: int = 1) -> Drawn:
    """At most ``most_frames`` frames of a Motion or Clip; raises MczError for what has no points.

    ``every`` is the least distance of two of them.
    """
    skeleton = moving.skeleton
    n_read = frames_read(moving)
    every = max(every, -(-n_read // max(1, most_frames)))
    places = positions_of(skeleton, _values(moving, n_read, every))
    places[~(np.abs(places) < FAR).all(axis=2)] = np.nan
    axis = skeleton.up_axis or "y"
    places *= signs_of(axis)
    words, step, middle = _words(places)
    up = column_of(axis)
    known = places[np.isfinite(places).all(axis=2)] - middle
    floor = float(known[:, up].min(initial=0.0))
    return Drawn(words, step, every, n_read, up, floor, float(np.abs(known).max(initial=0.0)))


def frames_read(moving: Moving) -> int:
    """Number of frames that are used: of a clip, which must be decoded, the first of many."""
    if isinstance(moving, Motion):
        return moving.n_frames
    return min(moving.n_frames, MOST_READ, MOST_NUMBERS // max(1, moving.n_channels) + 1)


def _values(moving: Moving, n_read: int, every: int) -> NDArray[np.float64]:
    """Every so many frames, (n, n_channels), NaN where invalid."""
    if not moving.signals[0].has_poses:
        raise MotionError("its channels are not those of its skeleton", clip=moving.name)
    if isinstance(moving, Motion):
        signal = moving.signals[0]
        values = np.asarray(signal.values[:n_read:every], np.float64)
        valid = None if signal.mask is None else signal.mask[:n_read:every]
        return values if valid is None else np.where(valid, values, np.nan)
    return np.asarray(moving.read((0, n_read))[::every], np.float64)


def _words(places: NDArray[np.float64]) -> tuple[Words, float, NDArray[np.float64]]:
    """Coordinates as words, what one is worth, and the middle that they count from, (3,)."""
    known = places[np.isfinite(places).all(axis=2)]
    if not len(known):
        return np.full(places.shape, MISSING, "<i2"), 1.0, np.zeros(3)
    low, high = known.min(axis=0), known.max(axis=0)
    middle = (low + high) / 2
    step = float((high - low).max()) / 2 / LARGEST or 1.0
    with np.errstate(invalid="ignore"):
        scaled = np.rint((places - middle) / step)
    return np.where(np.isnan(scaled), MISSING, scaled).astype("<i2"), step, middle


def lines_of(skeleton: Skeleton) -> list[tuple[int, int]]:
    """The points at both ends of each line: of a joint and its parent, and of its end sites.

    Pictures have nodes (``mcz.show.pictures.bodies``), which show origins that are no points, too.
    """
    firsts = first_points(skeleton)
    found = []
    for point, (joint, _) in enumerate(listed_points(skeleton)):
        parent = skeleton.joints[joint].parent
        if point != firsts[joint] and skeleton.intrinsic:
            found.append((firsts[joint], point))
        elif parent >= 0:
            found.append((firsts[parent], point))
    return found
