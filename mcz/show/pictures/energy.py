"""Energy of a motion over time, in a few numbers, without decoding a long clip."""

from __future__ import annotations

from typing import Any

import numpy as np

from mcz.errors import MczError
from mcz.kinematics.chain import Floats
from mcz.kinematics.poses import positions
from mcz.kinematics.poses.motion_like import MotionLike
from mcz.model.motion import Motion
from mcz.model.types import Reals

CELLS = 48  # of a line: greatest number of decoded segments
BLOCK = 2**19  # numbers that are worked on at a time
CHEAP = 2**19  # numbers that are decoded by default


def is_cheap(clip: Any) -> bool:
    """Return True if the energy of a clip is quick to compute."""
    return bool(clip.n_frames * clip.n_channels <= CHEAP)


def motion_energy(moving: MotionLike, cells: int = CELLS) -> Floats | None:
    """The mean speed of all points in ``cells`` equal parts of the frames, float64 (n,).

    In length units a second, or a frame where times are unknown; NaN where no position is known. No
    step is taken across a break in time; with fewer frames there are fewer parts. Of a clip with
    more segments than parts one segment a part is decoded. None without kinematics, or with fewer
    than two frames.
    """
    if moving.n_frames < 2:
        return None
    cells = min(cells, moving.n_frames - 1)
    edges = np.linspace(0, moving.n_frames - 1, cells + 1).astype(np.int64)
    signal: Any = moving.signals[0]
    sampled = not isinstance(moving, Motion) and len(signal.rows) > cells
    try:
        with np.errstate(all="ignore"):
            return _sampled(moving, edges) if sampled else _full_speeds(moving, edges)
    except MczError:  # no kinematics, or damaged
        return None


def _seconds(moving: MotionLike) -> Floats:
    """Seconds from each frame to the next, NaN across a break; 1 where times are unknown."""
    timeline = moving.timeline
    return np.ones(moving.n_frames - 1) if timeline is None else timeline.steps


def _full_speeds(moving: MotionLike, edges: Any) -> Floats:
    width = max(1, moving.skeleton.n_channels + 12 * moving.skeleton.n_joints)
    size = max(1, BLOCK // width)
    means = np.full(moving.n_frames - 1, np.nan)
    for start in range(0, len(means), size):
        stop = min(start + size, len(means))
        means[start:stop] = _steps(positions(moving, frames=(start, stop + 1)))
    means /= _seconds(moving)
    known = np.isfinite(means)
    counts = np.add.reduceat(known, edges[:-1])
    sums: Floats = np.add.reduceat(np.where(known, means, 0.0), edges[:-1])
    return sums / np.where(counts, counts, np.nan)


def _sampled(moving: MotionLike, edges: Any) -> Floats:
    middles = (edges[:-1] + edges[1:]) // 2
    samples = np.array(
        [_steps(positions(moving, frames=(at, at + 2)))[0] for at in middles.tolist()]
    )
    speeds: Floats = samples / _seconds(moving)[middles]
    return speeds


def _steps(places: Reals) -> Floats:
    """The mean step of all points from each frame to the next, (n_frames - 1,)."""
    moved = np.sqrt((np.diff(places, axis=0) ** 2).sum(axis=2))
    known = np.isfinite(moved)
    steps: Floats = np.where(known, moved, 0.0).sum(axis=1) / known.sum(axis=1)
    return steps
