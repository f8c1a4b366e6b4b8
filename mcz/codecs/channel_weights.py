"""Encoder weights of the channels of a skeleton.

Source: Khan 2016, eq. 2, and its successors here, which ask how far the points move.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MczError
from mcz.kinematics import depths, reach
from mcz.kinematics.sensitivity import sensitivities
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, QUATERNION_KINDS, Skeleton

Floats = NDArray[np.float64]

RULES = ("sensitivity", "depth", "flat")
LEAST_SHARE = 1 / 16  # a channel counts at least so much of what rotations do on average
SAMPLED_FRAMES = 128  # where sensitivities are measured


def weights_of(skeleton: Skeleton, sample: Floats, rule: str, *, unit_aware: bool) -> Floats:
    """The threshold of every channel at T_g = 1, (n_channels,), in source units.

    ``sample``: frames of the signal, unwrapped. ``rule`` is one of ``RULES``; ``unit_aware`` turns
    the T_g of a position channel from degrees into the length that the farthest point moves.
    """
    kinds = [channel.kind for channel in skeleton.channels]
    degree = math.pi / 180 if skeleton.angle_unit == "rad" else 1.0
    is_rotation = np.array([kind in ANGLE_KINDS for kind in kinds], np.bool_)
    is_part = np.array([kind in QUATERNION_KINDS for kind in kinds], np.bool_)
    degrees = np.where(is_rotation, degree, np.where(is_part, math.pi / 360, 1.0))
    if rule == "sensitivity":
        return _by_sensitivity(skeleton, sample, is_rotation | is_part, degrees)
    weights = np.ones(len(kinds))
    if rule == "depth":
        counts = [len(joint.channels) for joint in skeleton.joints]
        weights = np.sqrt(np.log2(np.repeat(depths(skeleton), counts) + 2))
    if not unit_aware:
        return weights
    weights = weights * degrees
    is_position = np.array([kind in POSITION_KINDS for kind in kinds], np.bool_)
    lever = reach(skeleton) * math.pi / 180
    return np.where(is_position, weights * (lever if 0 < lever < math.inf else 1.0), weights)


def _by_sensitivity(
    skeleton: Skeleton, sample: Floats, turns: NDArray[np.bool_], degrees: Floats
) -> Floats:
    """Thresholds with equal effect on the points; T_g is that of a rotation of average effect.

    ``degrees`` (n_channels,) is what a degree is in the unit of a channel that ``turns``.
    """
    try:
        effects = sensitivities(skeleton, sample, SAMPLED_FRAMES)
    except MczError:  # an unknown angle unit: there is no kinematics
        return degrees
    turning = (effects * degrees)[turns & (effects > 0)]
    average = float(np.sqrt(np.mean(turning**2))) if len(turning) else 1.0
    if not np.isfinite(average) or average <= 0:
        return degrees
    floor = average / degrees * LEAST_SHARE
    return np.where(effects > 0, average / np.maximum(effects, floor), degrees)
