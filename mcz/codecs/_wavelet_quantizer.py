"""How an encoder of wavelets chooses thresholds and quantizer steps; a decoder needs none of it.

Source: Khan 2016, eq. 2, and SPEC.md, "Choices of an encoder" in "Codec 2: mrdwt".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MczError, OptionError
from mcz.kinematics import depths, reach, sensitivities
from mcz.motion import POSITION_KINDS, ROTATION_KINDS, Skeleton

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RULES = ("sensitivity", "depth", "flat")
DEAD_ZONE = 0.8  # of a step: what is smaller becomes 0, where the step follows the threshold
LEAST_SHARE = 1 / 16  # a channel counts at least so much of what rotations do on average
SAMPLED_FRAMES = 128  # where sensitivities are measured
MIDDLE_CODE = 128  # the step code of 1
LEAST_UNIT = 2.0**-100
GREATEST_LEAST = 2**39
TOO_LARGE = 2.0**41  # in place of what is beyond all integers: the coder refuses it, by name


@dataclass(frozen=True, slots=True)
class Quantizer:
    """Thresholds (n_channels,) and how a coefficient becomes an integer.

    With ``decimals`` it is rounded to so many, halves away from zero; otherwise steps follow the
    thresholds, as ``unit`` times what each channel's ``codes`` stand for.
    """

    thresholds: Floats
    decimals: int | None
    unit: float
    codes: tuple[int, ...]

    @property
    def least(self) -> int:
        """No detail that is not zero has a smaller magnitude."""
        if self.decimals is None or not len(self.thresholds):
            return 1
        found = math.floor(float(self.thresholds.min()) * 10.0**self.decimals + 0.5)
        return min(max(1, found), GREATEST_LEAST)

    def indices(self, coefficients: Floats, channel: int, *, detail: bool) -> Ints:
        """The integers of one band of a channel."""
        sizes = np.abs(coefficients)
        with np.errstate(over="ignore"):
            if self.decimals is not None:
                scaled = sizes * 10.0**self.decimals
                small = sizes <= self.thresholds[channel]
            else:
                scaled = sizes / (self.unit * ratio_of(self.codes[channel]))
                small = scaled < DEAD_ZONE
        found = np.floor(scaled + 0.5)
        if detail:
            found[small] = 0
        limited = np.where(found <= TOO_LARGE, found, TOO_LARGE)  # NaN too: sums have overflowed
        return np.where(coefficients < 0, -limited, limited).astype(np.int64)


def ratio_of(code: int) -> float:
    """What a step code stands for, about 2^((code - 128) / 4)."""
    return math.ldexp(4 + code % 4, code // 4 - 34)


def code_of(ratio: float) -> int:
    """The step code nearest to a ratio."""
    if ratio <= 0:
        return 0
    guess = int(4 * math.log2(ratio)) + MIDDLE_CODE
    near = range(max(0, guess - 2), min(255, guess + 3) + 1)
    return min(
        near, key=lambda c: abs(math.log(ratio_of(c) / ratio)), default=0 if guess < 0 else 255
    )


def make_quantizer(
    weights: Floats, T_g: float, decimals: int | None, name: str = "T_g"
) -> Quantizer:
    """The quantizer whose thresholds are T_g times ``weights``; ``name`` is that of T_g."""
    thresholds = T_g * weights
    unit = T_g / DEAD_ZONE if T_g > 0 else 1.0
    codes = tuple(code_of(float(weight)) for weight in weights)
    if decimals is None and (not T_g > 0 or unit < LEAST_UNIT):
        raise OptionError(
            f"{name} is {T_g:g} and Q is not given, so that there is no quantizer step"
        )
    return Quantizer(thresholds, decimals, unit, codes)


def weights_of(skeleton: Skeleton, sample: Floats, rule: str, *, unit_aware: bool) -> Floats:
    """The threshold of every channel at T_g = 1, (n_channels,), in source units.

    ``sample``: frames of the signal, unwrapped. ``rule`` is one of ``RULES``; ``unit_aware`` turns
    the T_g of a position channel from degrees into the length that the farthest point moves.
    """
    kinds = [channel.kind for channel in skeleton.channels]
    degree = math.pi / 180 if skeleton.angle_unit == "rad" else 1.0
    is_rotation = np.array([kind in ROTATION_KINDS for kind in kinds], np.bool_)
    if rule == "sensitivity":
        return _by_sensitivity(skeleton, sample, is_rotation, degree)
    weights = np.ones(len(kinds))
    if rule == "depth":
        counts = [len(joint.channels) for joint in skeleton.joints]
        weights = np.sqrt(np.log2(np.repeat(depths(skeleton), counts) + 2))
    if not unit_aware:
        return weights
    weights = np.where(is_rotation, weights * degree, weights)
    is_position = np.array([kind in POSITION_KINDS for kind in kinds], np.bool_)
    with np.errstate(over="ignore"):
        lever = reach(skeleton) * math.pi / 180
    return np.where(is_position, weights * (lever if 0 < lever < math.inf else 1.0), weights)


def _by_sensitivity(
    skeleton: Skeleton, sample: Floats, is_rotation: NDArray[np.bool_], degree: float
) -> Floats:
    """Thresholds that move the points alike: T_g is that of a rotation of average effect."""
    plain = np.where(is_rotation, degree, 1.0)
    try:
        effects = sensitivities(skeleton, sample, SAMPLED_FRAMES)
    except MczError:  # an unknown angle unit: there is no kinematics
        return plain
    turning = effects[is_rotation & (effects > 0)]
    average = float(np.sqrt(np.mean(turning**2))) * degree if len(turning) else 1.0
    if not np.isfinite(average) or average <= 0:
        return plain
    floor = average / degree * LEAST_SHARE
    return np.where(effects > 0, average / np.maximum(effects, floor), plain)
