"""The rest pose: every joint at its offset, nothing turned. Whether it has any lengths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.motion import POSITION_KINDS, Skeleton

NO_LENGTHS = "no bone has a length"


def has_no_lengths(skeleton: Skeleton) -> bool:
    """Whether joints turn, but all lie where their root is, whatever the pose.

    Arrays of body models are such: how long bones are stands in a model, not in them.
    """
    below = [joint for joint in skeleton.joints if joint.parent >= 0]
    turned = any(channel.kind for joint in below for channel in joint.channels)
    moved = any(any(joint.offset) or joint.tails for joint in below)
    placed = any(channel.kind in POSITION_KINDS for joint in below for channel in joint.channels)
    return turned and not moved and not placed


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
