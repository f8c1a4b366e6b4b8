"""Frame time as printed -> frame rate, and back."""

from __future__ import annotations

import re
from decimal import Decimal
from fractions import Fraction

MAX_TERM = 2**53 - 1  # of a frame rate's numerator and denominator
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def frame_rate(frame_time: str) -> tuple[Fraction | None, bool]:
    """Frames a second, and whether that is exactly the reciprocal of the seconds printed.

    A rate whose reciprocal rounds to the printed digits is taken for the true one, if it is an
    integer, or an integer divided by 1.001, or, where at least 6 more digits are printed than
    would tell such rates apart, one of at most 3 decimals; in this order. Otherwise it is the
    reciprocal itself. None where the frame time is zero, negative, absurd or not a number.
    """
    if len(frame_time) > 64 or not DECIMAL.fullmatch(frame_time):
        return None, True
    if not 1e-9 <= float(frame_time) <= 1e9:
        return None, True
    time = Fraction(frame_time)
    half_digit = Fraction(10) ** int(Decimal(frame_time).as_tuple().exponent) / 2
    half_digit += time / 2**53  # it may have been a binary64 before, itself rounded
    reciprocal = 1 / time
    spread = half_digit / time * reciprocal  # of the rates that print alike, about
    units = [Fraction(1), Fraction(1000, 1001)]
    units += [Fraction(1, n) for n in (10, 100, 1000) if spread * 10**6 < Fraction(1, n)]
    for unit in units:
        rate = round(reciprocal / unit) * unit
        if rate and abs(1 / rate - time) <= half_digit and rate.numerator <= MAX_TERM:
            return rate, 1 / rate == time
    if max(reciprocal.numerator, reciprocal.denominator) <= MAX_TERM:
        return reciprocal, True
    return reciprocal.limit_denominator(min(MAX_TERM, int(MAX_TERM / (reciprocal + 1)))), False


def frame_time(rate: Fraction | None) -> str:
    """The seconds a frame takes, as the shortest decimal of its binary64; 0 where unknown."""
    return "0" if rate is None else repr(float(1 / rate))
