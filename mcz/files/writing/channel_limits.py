"""Bounds as text, ``0.5mV`` or ``1N,10Nmm``, and the limit that they are for each channel."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, Channel, Skeleton
from mcz.model.units import unit_ratio

MAX_ERROR, MEAN_ERROR = "max_error", "mean_error"
_BOUND = re.compile(r"([0-9.]+(?:[eE][-+]?[0-9]+)?) ?([^\s0-9.,].*)?")
LENGTHS = (*POSITION_KINDS, "length")


def parse_bound(key: str, text: str) -> tuple[float, str]:
    """A bound and its unit, "" for the channel's own; raises OptionError.

    >>> parse_bound("analog.max_error", "0.5 mV"), parse_bound("analog.max_error", "2")
    ((0.5, 'mV'), (2.0, ''))
    """
    match = _BOUND.fullmatch(text.strip())
    try:
        size = float(match[1]) if match else math.nan
    except ValueError:
        size = math.nan
    if match is None or not 0 <= size < math.inf:
        raise OptionError(f"{key} is {text!r}, not a number and perhaps a unit, such as 0.5mV")
    return size, match[2] or ""


def limits_of(
    skeleton: Skeleton, channels: Sequence[Channel], key: str, text: object
) -> NDArray[np.float64]:
    """The limit of each channel in its own unit: the first of the bounds in ``text`` that fits it.

    Raises OptionError for a channel that none fits.
    """
    bounds = [parse_bound(key, one) for one in str(text).split(",")]
    found = []
    for number, channel in enumerate(channels):
        ratios = [(size, _ratio(skeleton, channel, unit) if unit else 1.0) for size, unit in bounds]
        fitting = [size * ratio for size, ratio in ratios if ratio is not None]
        if not fitting:
            units = " and ".join(unit for _, unit in bounds)
            own = _unit_of(skeleton, channel)
            raise OptionError(
                f"{key}: channel {channel.label or number} is in {own or 'no unit that is known'}, "
                f"which {units} does not fit; several bounds may be given, such as 1N,10Nmm,5"
            )
        found.append(fitting[0])
    return np.array(found)


def _unit_of(skeleton: Skeleton, channel: Channel) -> str:
    if channel.kind in ANGLE_KINDS:
        return skeleton.angle_unit
    if channel.kind in LENGTHS:
        return "" if skeleton.unit_cm is None else f"{skeleton.unit_cm:g} cm"
    return channel.unit


def _ratio(skeleton: Skeleton, channel: Channel, unit: str) -> float | None:
    """The size of ``unit`` in that of the channel; None where it does not fit."""
    if channel.kind not in LENGTHS:
        return unit_ratio(unit, _unit_of(skeleton, channel))
    ratio = unit_ratio(unit, "cm")
    return None if ratio is None or skeleton.unit_cm is None else ratio / skeleton.unit_cm
