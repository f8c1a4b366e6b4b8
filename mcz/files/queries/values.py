"""Values of queries and their comparison: text, numbers and truths, any of them maybe missing.

A comparison is true, false, or None where it is unknown.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from math import isfinite
from typing import Any

Value = str | bool | int | float | None  # None: missing
Lookup = Callable[[str], Value]  # the value of a name

NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
LONGEST_NUMBER = 100  # characters; Python refuses to read integers of some thousand digits
_NUMBER = re.compile(NUMBER)

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def as_number(text: str) -> int | float | None:
    """The number that all of ``text`` reads as, None where it is none or not finite.

    >>> as_number("05"), as_number("-2.50"), as_number("1e3"), as_number("5 cm")
    (5, -2.5, 1000.0, None)
    """
    if len(text) > LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    if text.lstrip("+-").isdigit():
        return int(text)
    number = float(text)
    return number if isfinite(number) else None


def compared(left: Value, sign: str, right: Value) -> bool | None:
    """Compare ``left`` and ``right`` by a sign of ``COMPARISONS``; None: unknown.

    >>> compared("05", "==", 5), compared("05", "==", "5"), compared("a", "<", 5)
    (True, False, None)
    """
    if left is None or right is None:
        return None
    if isinstance(left, bool) or isinstance(right, bool):
        same_kind = isinstance(left, bool) and isinstance(right, bool)
        return COMPARISONS[sign](left, right) if same_kind and is_equality(sign) else None
    if isinstance(left, str) != isinstance(right, str):
        left, right = _number(left), _number(right)
        if left is None or right is None:  # a text that is no number
            return sign == "!=" if is_equality(sign) else None
    return COMPARISONS[sign](left, right)


def is_equality(sign: str) -> bool:
    return sign in ("==", "!=")


def _number(value: str | int | float) -> int | float | None:
    return as_number(value) if isinstance(value, str) else value
