"""Mean errors of joints in words: ``feet=0.5mm,head=1mm``."""

from __future__ import annotations

import re

from mcz.errors import OptionError
from mcz.units import UNIT_CM

_ENTRY = re.compile(r"(?P<name>.+)=(?P<number>[0-9.e+-]+) ?(?P<unit>[a-z]+)")


def joint_limits(text: object) -> tuple[tuple[str, float], ...]:
    """Joints or groups, and their limits in cm; raises OptionError.

    >>> joint_limits("feet=0.5mm, lhand=2cm")
    (('feet', 0.05), ('lhand', 2.0))
    """
    if isinstance(text, tuple):
        return text
    found = []
    for entry in str(text).split(","):
        match = _ENTRY.fullmatch(entry.strip())
        if match is None or match["unit"] not in UNIT_CM:
            units = ", ".join(UNIT_CM)
            raise OptionError(f"quality is {entry!r}, not like feet=0.5mm; units are {units}")
        try:
            limit = float(match["number"]) * UNIT_CM[match["unit"]]
        except ValueError:
            raise OptionError(f"quality is {entry!r}: {match['number']!r} is no number") from None
        if not 0 < limit < 1e9:
            raise OptionError(f"quality is {entry!r}: a limit must be more than 0")
        found.append((match["name"], limit))
    return tuple(found)


def limit_words(limits: tuple[tuple[str, float], ...]) -> str:
    """
    >>> limit_words((("feet", 0.05), ("lhand", 2.0)))
    'feet=0.05cm,lhand=2.0cm'
    """
    return ",".join(f"{name}={limit!r}cm" for name, limit in limits)
