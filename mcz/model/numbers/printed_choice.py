"""Encoder choice of the PRINTED grid of a run of tokens."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mcz.model.numbers.rules import (
    BASE_32,
    BASE_64,
    BASE_GENERAL,
    DECIMAL_LIMIT,
    EXPONENT,
    MOST_DECIMALS,
    SHORT_FIXED,
    SIGNIFICANT,
    GridFlag,
    GridKind,
)
from mcz.model.numbers.tokens import TENS, Floats, Ints, Tokens, kernels

NEARLY_ALL = 0.99  # of the tokens: a stray one costs little
MANY_BITS = 2.0**26  # of a number of decimals: no chance that it is a binary32

Candidate = tuple[float, tuple[GridKind, int, int, float, int]]


def printed_candidates(tokens: Tokens) -> Iterator[Candidate]:
    """Grids worth a try, for a sample of the tokens, with the bits of an ordinal, a guess."""
    loops = kernels()
    shape = tokens.fields[:, 2]
    known = shape & (loops.BAD | loops.SPECIAL) == 0
    tokens, shape = tokens[known], shape[known]
    if not len(tokens):
        return
    with_exponent = shape & loops.EXPONENT != 0
    decimals = np.minimum(shape >> loops.FRACTION_DIGITS, 63)
    if np.count_nonzero(with_exponent) * 2 > len(tokens):
        yield from _exponents(tokens[with_exponent], decimals[with_exponent])
    significant = shape >> loops.SIGNIFICANT & 31
    if significant.max() < 10:
        return
    values = np.abs(tokens.values())
    values = values[np.isfinite(values)]
    if not len(values):
        return
    plain = decimals[~with_exponent]
    fixed = int(np.bincount(plain).argmax()) if len(plain) else 0
    if significant.max() >= 16:
        for base in (*_decimals(values), BASE_64):
            if 16 < fixed <= MOST_DECIMALS:
                yield _with_bits(base, 0, SHORT_FIXED + fixed)
            if base != BASE_64:  # TEXT64 has that
                yield _with_bits(base, 0, SIGNIFICANT + 17)
    if _are_binary32(values, values * 2e-16 * 5):
        for digits in (16, 17):
            yield _with_bits(BASE_32, 0, SIGNIFICANT + digits)
    many = 4 <= fixed <= 15 and np.median(values) * TENS[fixed] > MANY_BITS
    if many and _are_binary32(values, np.full(len(values), 0.51 / TENS[fixed])):
        yield _with_bits(BASE_32, 0, fixed)


def printed_bits(base: int, style: int) -> float:
    """Estimate the bits of an ordinal without context."""
    if base == BASE_32:
        return 7.0 + 3.33 * style if style < SHORT_FIXED else 40.5  # the first is below FIXED
    if base == BASE_64:
        return 66.0
    return 10.0 + 3.33 * (base if base < BASE_32 else base - BASE_GENERAL)


def _with_bits(base: int, flags: int, style: int) -> Candidate:
    return printed_bits(base, style), (GridKind.PRINTED, base, flags, 1.0, style)


def _exponents(tokens: Tokens, decimals: Ints) -> Iterator[Candidate]:
    """Candidates for numbers that mostly have exponents and equal digits: %.ne."""
    loops = kernels()
    n = int(np.bincount(decimals).argmax())
    if n > MOST_DECIMALS:
        return
    shape, power = tokens.fields[:, 2], tokens.fields[:, 1]
    written, short = shape >> loops.EXPONENT_DIGITS & 255, np.abs(power) < 100
    flags = 0
    if np.count_nonzero(short & (written == 3)) > np.count_nonzero(short & (written == 2)):
        flags = int(GridFlag.EXPONENT3)
    elif np.count_nonzero(written == 1) > np.count_nonzero((written == 2) & (np.abs(power) < 10)):
        flags = int(GridFlag.EXPONENT1)
    if np.count_nonzero(shape & loops.UPPER) * 2 > len(tokens):
        flags |= int(GridFlag.UPPER)
    if np.count_nonzero(shape & loops.PLUS) > np.count_nonzero(
        shape & (loops.PLUS | loops.MINUS) == 0
    ):
        flags |= int(GridFlag.PLUS)
    if n < 15:
        yield _with_bits(BASE_GENERAL + n + 1, flags, EXPONENT + n)
        return
    values = np.abs(tokens.values())
    values = values[np.isfinite(values)]
    for base in (*_decimals(values), BASE_64):
        yield _with_bits(base, flags, EXPONENT + n)
    if _are_binary32(values, np.zeros(len(values))):
        yield _with_bits(BASE_32, flags, EXPONENT + n)


def _decimals(values: Floats) -> Iterator[int]:
    """The fewest decimals that give nearly all values, if there are any."""
    for digits in range(1, 16):
        with np.errstate(over="ignore"):
            scaled = np.rint(values * TENS[digits])
        same = (scaled / TENS[digits] == values) & (scaled <= DECIMAL_LIMIT)
        if len(values) and np.mean(same) >= NEARLY_ALL:
            yield digits
            return


def _are_binary32(values: Floats, tolerance: Floats) -> bool:
    """Return True if nearly all values lie within ``tolerance`` of a binary32."""
    with np.errstate(over="ignore"):
        near = values.astype(np.float32).astype(np.float64)
    misses = np.abs(np.where(np.isfinite(near), near, 0.0) - values)
    return bool(len(values)) and float(np.mean(misses <= tolerance)) >= NEARLY_ALL
