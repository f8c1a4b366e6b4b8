"""Markers -> a skeleton that moves: inverse kinematics, and how well its points fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.exchange.conversion.hierarchy import PRINTED
from mcz.kinematics.inverse import solve_ik
from mcz.kinematics.points import (
    point_names,
    point_set,
    points_and_markers_of,
    positions,
    positions_of,
    without_note,
)
from mcz.kinematics.targets import unsolved_channels
from mcz.model.checks import check_arguments
from mcz.model.motion import A_MOTION, A_SKELETON, Motion, Signal, Skeleton
from mcz.model.text_format import fields_text, named

FARTHEST = 2.0**100  # length units


@dataclass(frozen=True, slots=True)
class Fit:
    """Distances of a solution's points from their target positions.

    Distances in length units of the skeleton, over points with a known position, None without any;
    ``marker_...`` ones are of virtual markers. ``max_error`` is in ``frame`` (from 0) at ``point``.
    ``unsolved`` names the channels that no position determines; they are 0.
    """

    n_points: int
    n_markers: int
    mean_error: float | None
    max_error: float | None
    frame: int | None
    point: str | None
    marker_mean_error: float | None
    marker_max_error: float | None
    unit_cm: float | None
    unsolved: tuple[str, ...] = ()

    __repr__ = fields_text

    @property
    def mean_error_cm(self) -> float | None:
        return self._cm(self.mean_error)

    @property
    def max_error_cm(self) -> float | None:
        return self._cm(self.max_error)

    @property
    def marker_mean_error_cm(self) -> float | None:
        return self._cm(self.marker_mean_error)

    @property
    def marker_max_error_cm(self) -> float | None:
        return self._cm(self.marker_max_error)

    def _cm(self, distance: float | None) -> float | None:
        return None if distance is None or self.unit_cm is None else distance * self.unit_cm


def _check_sizes(motion: Motion) -> None:
    """Raise MotionError for a position so large that its square is beyond binary64."""
    values = np.asarray(motion.values, np.float64)
    with np.errstate(invalid="ignore"):
        far = np.argwhere(np.abs(values) > FARTHEST)
    if len(far):
        row, column = far[0].tolist()
        frame = row // motion.signals[0].samples_per_frame
        name = motion.skeleton.addresses()[column // 3]
        raise MotionError(
            f"frame {frame}, {name}: {values[row, column]:g} is too far away for inverse "
            "kinematics",
            clip=motion.name,
        )


class Solved(NamedTuple):
    """A motion that was fitted to positions, and how well it fits."""

    motion: Motion
    fit: Fit


@check_arguments(motion=A_MOTION, base=A_SKELETON)
def from_positions(motion: Motion, base: Skeleton) -> Solved:
    """Markers as a motion of the skeleton ``base``, whose points they are, and the fit.

    The markers are the points of ``base`` in order, with its virtual markers after them or without.
    Values are found by inverse kinematics (see ``solve_ik``), on a grid of 6 decimals. Frame rate,
    frame numbers, name, metadata and further signals are kept.

    Raises MotionError for another number of markers, for a ``motion`` without markers, or a
    ``base`` without kinematics.
    """
    skeleton, first = motion.skeleton, motion.signals[0]
    if point_set(skeleton) != "markers":
        raise MotionError(
            f"motion {motion.name!r} has joints that are not markers, so there are no "
            "positions to fit"
        )
    _check_sizes(motion)
    if point_set(base) == "markers":
        raise MotionError(
            f"{named('skeleton', base.name)} has only markers, so it cannot be fitted",
            clip=motion.name,
        )
    n_points, n_markers = len(point_names(base)), 3 * base.n_joints
    if skeleton.n_joints not in (n_points, n_points + n_markers):
        raise MotionError(
            f"motion {motion.name!r} has {skeleton.n_joints} markers, but skeleton "
            f"{base.name!r} has {n_points} points, or {n_points + n_markers} with its virtual "
            "markers"
        )
    seen_at = positions(motion)
    if skeleton.unit_cm and base.unit_cm:
        seen_at *= skeleton.unit_cm / base.unit_cm
    seen = seen_at[:, :n_points]
    virtual = seen_at[:, n_points:] if skeleton.n_joints > n_points else None
    values = solve_ik(base, seen, virtual)
    signal = Signal(values, (PRINTED,) * base.n_channels, first.name, first.samples_per_frame)
    solved = replace(
        motion,
        skeleton=base,
        signals=(signal, *motion.signals[1:]),
        metadata=without_note(motion),
        source=None,
    ).at_times(motion.timeline)
    return Solved(solved, _fit(base, values, seen, virtual, first.samples_per_frame))


def _fit(
    base: Skeleton,
    values: NDArray[np.float64],
    seen: NDArray[np.float64],
    virtual: NDArray[np.float64] | None,
    samples_per_frame: int,
) -> Fit:
    """Distances of the points and virtual markers of ``values`` from those ``seen``."""
    if virtual is None:
        points, markers = positions_of(base, values), np.zeros((len(values), 0, 3))
    else:
        points, markers = points_and_markers_of(base, values)
    missed = _distances(points, seen)
    mean, most = _figures(missed)
    marker_mean, marker_most = _figures(
        _distances(markers, markers if virtual is None else virtual)
    )
    frame = point = None
    if most is not None:
        row, number = divmod(int(np.nanargmax(missed)), missed.shape[1])
        frame, point = row // samples_per_frame, point_names(base)[number]
    return Fit(
        n_points=missed.shape[1],
        n_markers=markers.shape[1],
        mean_error=mean,
        max_error=most,
        frame=frame,
        point=point,
        marker_mean_error=marker_mean,
        marker_max_error=marker_most,
        unit_cm=base.unit_cm,
        unsolved=unsolved_channels(base),
    )


def _distances(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances between points (n_frames, n, 3), NaN if one is unknown."""
    step = a - b
    distances: NDArray[np.float64] = np.sqrt((step * step).sum(axis=2))
    return distances


def _figures(distances: NDArray[np.float64]) -> tuple[float | None, float | None]:
    known = distances[~np.isnan(distances)]
    return (float(known.mean()), float(known.max())) if len(known) else (None, None)
