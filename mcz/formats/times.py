"""The times of a table: whether they follow from frame numbers, and their frame rate."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.formats.rates import DECIMAL, MAX_TERM
from mcz.formats.table_layout import Clock
from mcz.numbers import Grid, GridKind, Tokens

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNITS = (Fraction(1), Fraction(1000, 1001), *(Fraction(1, 10**n) for n in (1, 2, 3)))
MOST = 2**61  # of products, so that they are exact
LARGEST_DENOMINATOR = 10**6  # of a rate that is no round number
MOST_DECIMALS = 15


def stated_rate(text: str) -> Fraction | None:
    """A rate as a header prints it; None where it is no positive number."""
    text = text.strip()
    if len(text) > 64 or not DECIMAL.fullmatch(text) or not 1e-9 <= float(text) <= 1e9:
        return None
    rate = Fraction(text)
    return rate if max(rate.numerator, rate.denominator) <= MAX_TERM else None


def find_clock(tokens: Tokens, numbers: Ints, stated: Sequence[Fraction]) -> Clock | None:
    """How the times follow from the frame numbers, None where they do not.

    ``stated``: rates that the file states. Tried are these and round ones near the mean.
    """
    if len(tokens) < 2:
        return None
    places = _decimals(tokens)
    for grid in (Grid(GridKind.FIXED, places), Grid(GridKind.TRIMMED, max(places, 1))):
        ordinals, known = grid.ordinals_of_tokens(tokens)
        if known.all() and ordinals.min() >= 0:
            break
    else:
        return None
    distance = int(numbers[-1] - numbers[0])
    if distance <= 0 or ordinals[-1] <= ordinals[0]:
        return None
    unit = 10**grid.digits
    mean = Fraction(distance * unit, int(ordinals[-1] - ordinals[0]))
    for rate in dict.fromkeys((*stated, *_round(mean))):
        step = unit / rate
        offset = _offset(ordinals, numbers, step.numerator, step.denominator)
        if offset is not None:
            return Clock(grid, step.numerator, step.denominator, offset)
    return None


def _decimals(tokens: Tokens) -> int:
    from mcz.numbers import kernels

    places = int((tokens.fields[:, 2] >> kernels.FRACTION_DIGITS).max())
    return min(places, MOST_DECIMALS)


def _round(rate: Fraction) -> list[Fraction]:
    """Round rates near ``rate``, and itself."""
    found = [round(rate / unit) * unit for unit in UNITS]
    return [r for r in (*found, rate.limit_denominator(LARGEST_DENOMINATOR)) if r > 0]


def _offset(ordinals: Ints, numbers: Ints, numerator: int, denominator: int) -> int | None:
    """An offset with (number * numerator + offset) div denominator = ordinal for all; None: none.

    The one nearest to 0 of those that there are.
    """
    largest = max(int(np.abs(ordinals).max()) + 1, 1) * denominator
    if max(largest, int(np.abs(numbers).max()) * numerator) > MOST:
        return None
    least = ordinals * denominator - numbers * numerator
    low, high = int(least.max()), int(least.min()) + denominator - 1
    return None if low > high else min(max(low, 0), high)


def uniform_rate(
    times: Floats, half_digit: float, stated: Sequence[Fraction] = ()
) -> tuple[Fraction | None, bool]:
    """The rate of times that are uniform to ``half_digit``, half a unit of their last digit.

    Returns None where they are not; and whether the rate is a round or a stated one.
    """
    if len(times) < 2 or not np.isfinite(times).all() or not times[-1] > times[0]:
        return None, True
    with np.errstate(over="ignore"):
        mean = float((len(times) - 1) / (times[-1] - times[0]))
    if not 1e-9 < mean < 1e9:
        return None, True
    tolerance = 2 * half_digit + 8 * float(np.spacing(np.abs(times).max()))
    index = np.arange(len(times))
    for rate in dict.fromkeys((*stated, *_round(Fraction(mean)))):
        if np.abs(times - (times[0] + index / float(rate))).max() <= tolerance:
            is_round = rate in stated or any((rate / unit).denominator == 1 for unit in UNITS)
            return rate, is_round
    return None, True


def half_digit_of(tokens: Tokens) -> float:
    """Half a unit of the last digit that the times have."""
    return 0.5 * 10.0 ** -_decimals(tokens)
