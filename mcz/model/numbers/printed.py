"""The PRINTED grid: numbers of one sort, printed by another rule. SPEC.md, "Number grids".

Its digits define the numbers, its style how C prints them as binary64: ``%.nf`` for n, ``%.nf`` of
17 digits and zeros for ``SHORT_FIXED`` + n, ``%.ng`` for ``SIGNIFICANT`` + n, ``%.ne`` for
``EXPONENT`` + n.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcz.kernels import SPARE
from mcz.model.numbers.magnitudes import (
    binary32_magnitudes,
    binary32_values,
    general_magnitudes,
    general_split,
    scaled_magnitudes,
)
from mcz.model.numbers.rules import (
    BASE_32,
    BASE_64,
    BASE_GENERAL,
    DECIMAL_LIMIT,
    EXPONENT,
    SHORT_FIXED,
    SIGNIFICANT,
    GridFlag,
)
from mcz.model.numbers.tokens import TENS, Texts, Tokens, kernels, nearest, scan_texts
from mcz.model.types import Bools, Floats, Ints

ROUND_TRIP = 17  # significant digits that identify every binary64
DECIMAL_TRIP = 16  # significant digits that identify numbers up to 2^51 on a decimal grid


def base_values(digits: int, magnitudes: Ints) -> Floats:
    """The binary64 that is printed."""
    if digits == BASE_32:
        return binary32_values(magnitudes)
    if digits == BASE_64:
        return magnitudes.view(np.float64)
    if digits > BASE_GENERAL:
        return nearest(*general_split(magnitudes, digits - BASE_GENERAL))
    result: Floats = np.divide(magnitudes, TENS[digits])
    return result


def magnitudes_of(digits: int, values: Floats) -> Ints:
    """The magnitude of the nearest number of the base; the caller bounds it."""
    if digits == BASE_32:
        return binary32_magnitudes(values)
    if digits == BASE_64:
        return values.view(np.int64)
    if digits > BASE_GENERAL:
        return general_magnitudes(values.ravel(), digits - BASE_GENERAL).reshape(values.shape)
    return scaled_magnitudes(values, TENS[digits], False, DECIMAL_LIMIT)


def values_of(digits: int, style: int, magnitudes: Ints) -> Floats:
    """The binary64 nearest to the printed text: the value that other readers of the text see."""
    printed = base_values(digits, magnitudes)
    if _is_reversible(digits, style):
        return printed
    unique, inverse = np.unique(printed, return_inverse=True)
    print_one = printer(style)
    values = np.array([float(print_one(x)) for x in unique.tolist()], np.float64)  # GRID-09
    return values[inverse].reshape(printed.shape)


def _is_reversible(digits: int, style: int) -> bool:
    """Return True if the text determines the number among all of its base."""
    if digits > BASE_GENERAL:
        return True
    shown = style - EXPONENT + 1 if style >= EXPONENT else style - SIGNIFICANT
    return shown >= (DECIMAL_TRIP if digits < BASE_32 else ROUND_TRIP)


def printer(style: int) -> Callable[[float], str]:
    """Return a function that prints a binary64 >= 0, without flags."""
    if style >= EXPONENT:
        return f"{{:.{style - EXPONENT}e}}".format
    if style >= SIGNIFICANT:
        return f"{{:.{style - SIGNIFICANT}g}}".format
    if style >= SHORT_FIXED:
        return lambda x: _short_fixed(x, style - SHORT_FIXED)
    return f"{{:.{style}f}}".format


def _short_fixed(x: float, decimals: int) -> str:
    """``%.nf`` as in older C libraries of Windows: zeros after 17 digits."""
    mantissa, _, power = f"{x:.{ROUND_TRIP - 1}e}".partition("e")
    known = ROUND_TRIP - 1 - int(power)  # decimals of 17 digits
    if x == 0 or known >= decimals:
        return f"{x:.{decimals}f}"
    digits = mantissa.replace(".", "")
    whole = digits.rjust(known + 1, "0") if known > 0 else digits + "0" * -known
    point = len(whole) - max(known, 0)
    fraction = whole[point:].ljust(decimals, "0")
    return f"{whole[:point]}.{fraction}" if fraction else whole


def texts(digits: int, style: int, flags: int, magnitudes: Ints, negative: Bools) -> Texts:
    """Print numbers whose magnitudes are already checked."""
    values = base_values(digits, magnitudes)
    if SIGNIFICANT < style < EXPONENT:
        return _general(values, style - SIGNIFICANT, flags, negative)
    print_one = printer(style)  # TEXT-06
    plus = "+" if flags & GridFlag.PLUS else ""
    lines = [
        ("-" if minus else plus) + print_one(x)
        for x, minus in zip(values.tolist(), negative.tolist(), strict=True)
    ]
    if flags & ~GridFlag.PLUS:
        lines = [_restyle(line, flags) for line in lines]
    offsets = np.zeros(len(lines) + 1, np.int64)
    np.cumsum([len(line) for line in lines], out=offsets[1:])
    return Texts(np.frombuffer("".join(lines).encode(), np.uint8), offsets)


def _restyle(line: str, flags: int) -> str:
    mantissa, e, power = line.partition("e")
    size = power[1:].lstrip("0") if flags & GridFlag.EXPONENT1 else power[1:]
    width = 3 if flags & GridFlag.EXPONENT3 else 1
    return mantissa + ("E" if flags & GridFlag.UPPER else e) + power[:1] + size.rjust(width, "0")


def _general(values: Floats, digits: int, flags: int, negative: Bools) -> Texts:
    fields = scan_texts([f"{x:.{digits - 1}e}" for x in values.tolist()]).fields
    loops = kernels()
    fractions = (fields[:, 2] >> loops.FRACTION_DIGITS) - fields[:, 1]
    out = np.empty(len(values) * 48 + SPARE, np.uint8)  # as in textgrids: the longest has 17 digits
    offsets = np.zeros(len(values) + 1, np.int64)
    rule = 1, -4, digits, flags
    loops.write(negative, np.ascontiguousarray(fields[:, 0]), fractions, rule, out, offsets)
    return Texts(out[: offsets[-1]].copy(), offsets)


def plausible(tokens: Tokens, style: int) -> Bools:
    """Tokens of the shape that the style prints."""
    loops = kernels()
    shape = tokens.fields[:, 2]
    good: Bools = shape & (loops.BAD | loops.SPECIAL) == 0
    if SIGNIFICANT < style < EXPONENT:
        return good
    decimals = style - EXPONENT if style >= EXPONENT else style % SHORT_FIXED
    good &= (shape & loops.EXPONENT != 0) == (style >= EXPONENT)
    good &= shape >> loops.FRACTION_DIGITS == decimals
    return good
