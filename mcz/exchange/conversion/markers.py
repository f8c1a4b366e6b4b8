"""The points of a skeleton -> markers of C3D."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.marker_motion import in_positions
from mcz.model.motion import Motion

MM_CM = 0.1
MM_PER_CM = 10.0


def to_c3d(motion: Motion) -> Motion:
    """Its points as markers of their names, in mm where the length unit is known.

    A motion of markers is returned as it is. A point whose position is not known is invalid.
    """
    made = in_positions(motion)
    unit_cm = motion.skeleton.unit_cm
    if made is motion or unit_cm is None:
        return replace(made, metadata=motion.metadata)
    with np.errstate(over="ignore"):
        values = np.asarray(made.signals[0].values, np.float64) * (unit_cm * MM_PER_CM)
    if np.isinf(values).any():
        raise MotionError("a position in mm is beyond float64", clip=motion.name)
    signal = replace(made.signals[0], values=values)
    return replace(
        made,
        skeleton=replace(made.skeleton, unit_cm=MM_CM),
        signals=(signal, *made.signals[1:]),
        metadata=motion.metadata,
    )
