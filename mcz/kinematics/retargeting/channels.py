"""Common steps of retargeting: a motion with its joints' channels in, another out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError
from mcz.model.motion import POSITION_KINDS, TURNING_KINDS, Channel, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind

Floats = NDArray[np.float64]

COMPUTED = Grid(GridKind.FIXED, 6)  # as of conversions: a millionth is far below noise


def turns(channels: tuple[Channel, ...]) -> bool:
    """Return True if one of the channels turns its joint."""
    return any(channel.kind in TURNING_KINDS for channel in channels)


def moves(channels: tuple[Channel, ...]) -> bool:
    """Return True if one of the channels moves its joint."""
    return any(channel.kind in POSITION_KINDS for channel in channels)


def check_channels(motion: Motion) -> None:
    """Raise MotionError where the motion's channels are not those of its joints."""
    if not motion.signals[0].has_poses:
        raise MotionError("its channels are not those of its skeleton", clip=motion.name)


def edited(motion: Motion, skeleton: Skeleton, signal: Signal) -> Motion:
    """``motion`` of another skeleton and signal, without the source file that it no longer is."""
    made = replace(motion, skeleton=skeleton, signals=(signal, *motion.signals[1:]), source=None)
    return made.at_times(motion.timeline)


def computed(motion: Motion, values: Floats) -> Signal:
    """The motion signal of ``values`` (n_rows, n_channels) that were computed; NaN is invalid."""
    valid = np.isfinite(values)
    first = motion.signals[0]
    return Signal(
        np.where(valid, values, 0.0),
        (COMPUTED,) * values.shape[1],
        first.name,
        first.samples_per_frame,
        None if valid.all() else valid,
    )
