"""Length units by name, in centimeters, axes that point up, ratios of units of one quantity."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from fractions import Fraction

from mcz.errors import MotionError, OptionError
from mcz.model.motion import Skeleton
from mcz.model.skeleton import AXES, HANDS

UNIT_CM = {"mm": 0.1, "cm": 1.0, "dm": 10.0, "m": 100.0, "in": 2.54, "ft": 30.48}

_LENGTH = re.compile(r"([0-9]{0,15}\.?[0-9]{0,15}) ?([a-z]+)")
LEAST_CM, MOST_CM = 1e-6, 1e9


def unit_cm_of(unit: str) -> float:
    """Centimeters of a length unit, a key of ``UNIT_CM``, or of a multiple; raises OptionError.

    >>> unit_cm_of("in"), unit_cm_of("5.6444cm")
    (2.54, 5.6444)
    """
    match = _LENGTH.fullmatch(unit)
    if not match or match[2] not in UNIT_CM or match[1] == ".":
        names = ", ".join(UNIT_CM)
        raise OptionError(
            f"unit {unit!r} is unknown; it must be one of {names}, or a length such as 5.6444cm"
        )
    size = float(Fraction(match[1] or 1) * Fraction(str(UNIT_CM[match[2]])))
    if not LEAST_CM <= size <= MOST_CM:
        raise OptionError(f"unit {unit!r} is out of range: {LEAST_CM:g} to {MOST_CM:g} cm")
    return size


def in_unit(skeleton: Skeleton, unit: str | None) -> Skeleton:
    """``skeleton`` in the named length unit, unchanged for None; raises OptionError."""
    return skeleton if unit is None else replace(skeleton, unit_cm=unit_cm_of(unit))


def axes_of(skeleton: Skeleton) -> tuple[str, str, str]:
    """Up axis, forward axis and handedness."""
    return skeleton.up_axis, skeleton.forward_axis, skeleton.handedness


def with_axes(
    skeleton: Skeleton, up: str | None, forward: str | None = None, handedness: str | None = None
) -> Skeleton:
    """``skeleton`` with these axes and handedness, unchanged for None; raises OptionError.

    With other axes than before, it is no longer the skeleton of its own source file.
    """
    for word, axis in (("up", up), ("forward", forward)):
        if axis is not None and axis.removeprefix("+") not in AXES[1:]:
            raise OptionError(f"{word} axis {axis!r} is not one of {', '.join(AXES[1:])}")
    if handedness not in (None, *HANDS[1:]):
        raise OptionError(f"handedness {handedness!r} is neither right nor left")
    try:
        result = replace(
            skeleton,
            up_axis=up or skeleton.up_axis,
            forward_axis=forward or skeleton.forward_axis,
            handedness=handedness or skeleton.handedness,
        )
    except MotionError as error:  # parallel axes
        raise OptionError(str(error)) from None
    return skeleton if axes_of(result) == axes_of(skeleton) else replace(result, source=None)


def _quantities() -> dict[str, tuple[str, float]]:
    """Units of physical quantities -> (quantity, size)."""
    units = {unit: ("length", size / 100) for unit, size in UNIT_CM.items()}
    units |= {"deg": ("angle", math.pi / 180), "°": ("angle", math.pi / 180)}
    units |= {"Nmm": ("moment", 1e-3), "Ncm": ("moment", 1e-2), "nt": ("N", 1.0)}
    units |= {"ntmm": ("moment", 1e-3), "g": ("acceleration", 9.80665), "m/s2": ("acceleration", 1)}
    prefixes = {"": 1.0, "k": 1e3, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "n": 1e-9}
    quantities = {"Nm": "moment", "rad": "angle"}
    for base in ("V", "N", "Nm", "W", "Pa", "Hz", "s", "rad"):
        units |= {p + base: (quantities.get(base, base), f) for p, f in prefixes.items()}
    words = {"Volt": "V", "Volts": "V", "Newton": "N", "Newtons": "N", "N-m": "Nm", "N-mm": "Nmm"}
    units |= {name: units[unit] for word, unit in words.items() for name in (word, word.lower())}
    return units | {"N-M": units["Nm"]}


_QUANTITIES = _quantities()


def unit_ratio(unit: str, other: str) -> float | None:
    """The size of ``unit`` in ``other``; None if they measure different quantities.

    >>> unit_ratio("mrad", "rad"), unit_ratio("N.m", "Nmm"), unit_ratio("mV", "N")
    (0.001, 1000.0, None)
    >>> unit_ratio("mV", "Volts"), unit_ratio("N", "Newtons"), unit_ratio("Nm", "N-M")
    (0.001, 1.0, 1.0)
    """
    plain_unit, other_unit = (re.sub(r"[\s.*·]", "", text) for text in (unit, other))
    if plain_unit == other_unit:
        return 1.0
    (quantity, size), (other_quantity, whole) = (
        _QUANTITIES.get(u, (u, 1.0)) for u in (plain_unit, other_unit)
    )
    return size / whole if quantity == other_quantity else None
