"""First and second derivatives over time, from known positions only.

``places`` is (n_frames, n, 3), NaN where unknown; ``steps`` are the seconds from each frame to the
next, (n_frames - 1,), NaN across a gap.
"""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import Floats


def velocities_of(places: Floats, steps: Floats) -> Floats:
    """The slope of the parabola through three frames, at an end or beside a gap that to the next.

    NaN where a frame or both of its neighbors are unknown.
    """
    before, after, first, last = _one_sided_slopes(places, steps)
    with np.errstate(invalid="ignore"):
        velocities: Floats = (before * last + after * first) / (first + last)
    velocities = np.where(np.isnan(velocities), before, velocities)
    return np.where(np.isnan(velocities), after, velocities)


def accelerations_of(places: Floats, steps: Floats) -> Floats:
    """Second derivative of that parabola; at an end or beside a gap that of the next frame.

    NaN where a frame is unknown or stands in a run of fewer than three.
    """
    before, after, first, last = _one_sided_slopes(places, steps)
    with np.errstate(invalid="ignore"):
        inner: Floats = 2.0 * (after - before) / (first + last)
    accelerations = inner.copy()
    missing = np.isnan(accelerations[:-1]) & ~np.isnan(after[:-1])  # the next frame is a neighbor
    accelerations[:-1][missing] = inner[1:][missing]
    missing = np.isnan(accelerations[1:]) & ~np.isnan(before[1:])
    accelerations[1:][missing] = inner[:-1][missing]
    return accelerations


def _one_sided_slopes(places: Floats, steps: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The slopes from the frame before and to the next, and the seconds between; NaN: none."""
    seconds = np.full((len(places) + 1, 1, 1), np.nan)
    seconds[1:-1, 0, 0] = steps
    slopes = np.full((len(places) + 1, *places.shape[1:]), np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        slopes[1:-1] = np.diff(places, axis=0) / seconds[1:-1]
    return slopes[:-1], slopes[1:], seconds[:-1], seconds[1:]
