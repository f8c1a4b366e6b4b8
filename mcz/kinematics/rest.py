"""The rest pose: every joint at its offset, nothing turned."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.motion import Skeleton


def rest_positions(skeleton: Skeleton) -> NDArray[np.float64]:
    """Where the joints are at rest, float64 (n_joints, 3), in length units.

    Nothing is turned, moved or stretched: rotation and length channels are 0, scales are 1. A
    joint whose position channels replace its offset lies at its offset, too, for 0 would put it
    onto its parent.
    """
    positions = skeleton.offsets
    for index, joint in enumerate(skeleton.joints):
        if joint.parent >= 0:
            positions[index] += positions[joint.parent]
    return positions
