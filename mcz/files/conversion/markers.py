"""The points of a skeleton -> markers of C3D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.kinematics import point_names, point_set, positions
from mcz.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton

MM_CM = 0.1
MM_PER_CM = 10.0


def to_c3d(motion: Motion) -> Motion:
    """Its points as markers of their names, in mm where the length unit is known.

    A motion of markers is returned as it is. A point whose place is not known is invalid.
    """
    skeleton = motion.skeleton
    if point_set(skeleton) == "markers":
        return motion
    points = positions(motion)
    unit_cm = skeleton.unit_cm
    if unit_cm is not None:
        points *= unit_cm * MM_PER_CM
    values = points.reshape(len(points), points.shape[1] * points.shape[2])
    valid = ~np.isnan(values)
    channels = tuple(Channel(kind) for kind in POSITION_KINDS)
    converted = Skeleton(
        tuple(Joint(name, channels=channels) for name in point_names(skeleton)),
        skeleton.name,
        None if unit_cm is None else MM_CM,
        "",
        skeleton.up_axis,
    )
    signal = Signal(
        np.where(valid, values, 0.0),
        name=motion.signals[0].name,
        samples_per_frame=motion.signals[0].samples_per_frame,
        mask=None if valid.all() else valid,
    )
    return replace(motion, skeleton=converted, signals=(signal, *motion.signals[1:]))
