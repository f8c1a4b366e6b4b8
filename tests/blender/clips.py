"""Clips that few files have."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

import mcz


def stretching_arm() -> mcz.Motion:
    """An Acclaim arm that grows from 10 to 15 cm while it turns, and a hand at its end."""
    turning = tuple(map(mcz.Channel, ("rx", "ry", "rz")))
    moving = tuple(map(mcz.Channel, ("tx", "ty", "tz")))
    joints = (
        mcz.Joint("root", channels=moving + turning),
        mcz.Joint(
            "arm", 0, tails=((6.0, 8.0, 0.0),), channels=(*turning[:2], mcz.Channel("length"))
        ),
        mcz.Joint("hand", 1, (6.0, 8.0, 0.0), ((0.0, 3.0, 0.0),), channels=turning),
    )
    skeleton = mcz.Skeleton(joints, unit_cm=1.0, up_axis="y", intrinsic=False)
    frames = np.arange(40)
    waves = [np.sin(frames / (5.0 + k)) * 30 for k in range(skeleton.n_channels)]
    waves[8] = frames / 8.0
    signal = mcz.Signal(np.stack(waves, axis=1))
    return mcz.Motion(skeleton, (signal,), Fraction(30), name="arm")
