"""Poses as arrays with names: positions, rotations, velocities, resampled motions.

One convention throughout: rotations are active and turn column vectors, a joint's local rotation is
W_parent^-1 W (W: its rotation in the world), and in the rest pose every rotation is the identity.
Functions take a Motion or a Clip, and decode only the needed part of a Clip.
"""

from __future__ import annotations

from mcz.kinematics.frames import times
from mcz.kinematics.poses.conversions import rotations
from mcz.kinematics.poses.resampling import resample
from mcz.kinematics.poses.trajectories import (
    Root,
    accelerations,
    point_names,
    positions,
    root,
    velocities,
)

__all__ = [
    "Root",
    "accelerations",
    "point_names",
    "positions",
    "resample",
    "root",
    "rotations",
    "times",
    "velocities",
]
