"""First and second differences over time, that look only at what is known."""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import Floats


def velocities_of(places: Floats, rate: float) -> Floats:
    """Central differences along the first axis, at an end or beside a gap one-sided.

    ``places`` (n_frames, n, 3), NaN where unknown; NaN where a frame or both of its neighbours
    are. A second difference: ``accelerations_of``.
    """
    before, after = _shifted(places, 1), _shifted(places, -1)
    no_before, no_after = np.isnan(before), np.isnan(after)
    first = np.where(no_before, places, before)
    last = np.where(no_after, places, after)
    steps = 2.0 - no_before - no_after
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Floats = (last - first) * rate / steps
    found[np.isnan(places)] = np.nan
    return found


def accelerations_of(places: Floats, rate: float) -> Floats:
    """Second differences; at an end or beside a gap that of the frame next to it.

    NaN where a frame is unknown or stands in a run of fewer than three.
    """
    with np.errstate(invalid="ignore"):
        inner: Floats = (_shifted(places, 1) - 2.0 * places + _shifted(places, -1)) * rate**2
    found = inner
    for step in (-1, 1):
        found = np.where(np.isnan(found), _shifted(inner, step), found)
    found[np.isnan(places)] = np.nan
    return found


def _shifted(places: Floats, step: int) -> Floats:
    """What was ``step`` frames before, NaN where there was none."""
    moved = np.full(places.shape, np.nan)
    if step > 0:
        moved[step:] = places[:-step]
    else:
        moved[:step] = places[-step:]
    return moved
