"""Text grids: tokens to ordinals and ordinals to text. SPEC.md, "Number grids"."""

from __future__ import annotations

import numpy as np

from mcz.kernels import SPARE
from mcz.model.numbers.magnitudes import binary32_magnitudes, general_split
from mcz.model.numbers.rules import FIXED_TEXT, GridKind, limit
from mcz.model.numbers.tokens import Texts, Tokens, kernels, scan_texts
from mcz.model.types import Bools, Floats, Ints

_UNLIMITED = 1_000_000  # more decimals, and a larger exponent, than any number has
WIDEST = 48  # bytes of a number from ``write``; the longest has 17 digits after "-0.00000"
_JAVASCRIPT = 1  # the ``digits`` of a TEXT64 grid that prints as JavaScript does


def exponents(kind: GridKind, digits: int) -> tuple[int, int, int]:
    """(digits, low, high): exponents X < low and X >= high are printed; digits 0 for none."""
    match kind:
        case GridKind.FIXED | GridKind.TRIMMED:
            return 0, -_UNLIMITED, _UNLIMITED
        case GridKind.GENERAL:
            return digits, -4, digits  # TEXT-01
        case GridKind.TEXT32:
            return 9, -4, 16
    if digits >= FIXED_TEXT:
        return 0, -_UNLIMITED, _UNLIMITED
    if digits >= 16:
        return digits, -4, digits
    return (17, -6, 21) if digits == _JAVASCRIPT else (17, -4, 16)  # TEXT-01


def match(
    tokens: Tokens, kind: GridKind, digits: int, flags: int, allowed: int | None = None
) -> tuple[Ints, Bools, int]:
    """(ordinals, mask of the tokens that the grid prints exactly so, count of the others).

    Of TEXT grids only the shape is checked. Stops after more than ``allowed`` misses.
    """
    general, low, high = exponents(kind, digits)
    trim = kind != GridKind.FIXED and digits < FIXED_TEXT
    decimals = digits % FIXED_TEXT if general == 0 else _UNLIMITED
    text = kind in (GridKind.TEXT64, GridKind.TEXT32)
    largest = 2**62 if text else limit(kind, digits)
    rule = general, decimals, int(trim), low, high, flags, largest
    ordinals = np.empty(len(tokens), np.int64)
    printed = np.empty(len(tokens), np.bool_)
    most = len(tokens) if allowed is None else allowed
    misses = kernels().match(tokens.fields, rule, ordinals, printed, most)
    return ordinals, printed, misses


def uncertain(tokens: Tokens, kind: GridKind, digits: int, printed: Bools) -> Bools:
    """Mask of the tokens that need an exact check; ``printed`` are those of the right shape.

    A normal number of 15 digits (6 in binary32) is its own shortest text.
    """
    loops = kernels()
    power, shape = tokens.fields[:, 1], tokens.fields[:, 2]
    digits_kept, far = (6, 30) if kind == GridKind.TEXT32 else (15, 290)
    if digits > _JAVASCRIPT:
        return printed | too_long(tokens)
    many: Bools = (shape >> loops.SIGNIFICANT & 31) > digits_kept
    many |= np.abs(power) > far
    return (printed & many) | too_long(tokens)


def too_long(tokens: Tokens) -> Bools:
    """Mask of the numbers with more digits than a match examines."""
    loops = kernels()
    result: Bools = tokens.fields[:, 2] & (loops.LONG | loops.BAD | loops.SPECIAL) == loops.LONG
    return result


def token_ordinals32(tokens: Tokens) -> Ints:
    """Ordinals of the binary32 nearest to tokens."""
    values = tokens.values()
    magnitudes = np.minimum(binary32_magnitudes(np.abs(values)), limit(GridKind.TEXT32, 0))
    return magnitudes ^ -np.signbit(values).astype(np.int64)


def texts(kind: GridKind, digits: int, flags: int, magnitudes: Ints, negative: Bools) -> Texts:
    """Print the numbers of these magnitudes, which are already within the limit."""
    general, low, high = exponents(kind, digits)
    if kind == GridKind.TEXT64 and digits >= FIXED_TEXT:  # TEXT-01
        return _fixed_texts(magnitudes.view(np.float64), negative, digits - FIXED_TEXT)
    if general == 0:
        mantissas, fractions = magnitudes, np.full(len(magnitudes), digits)
    elif kind == GridKind.GENERAL:
        mantissas, powers = general_split(magnitudes, digits)
        fractions = -powers
    else:
        mantissas, fractions = float_digits(kind, digits, magnitudes)
    out = np.empty(len(magnitudes) * WIDEST + SPARE, np.uint8)
    offsets = np.zeros(len(magnitudes) + 1, np.int64)
    rule = int(kind != GridKind.FIXED), low, high, flags
    kernels().write(negative, np.ascontiguousarray(mantissas), fractions, rule, out, offsets)
    return Texts(out[: offsets[-1]].copy(), offsets)


def float_digits(kind: GridKind, digits: int, magnitudes: Ints) -> tuple[Ints, Ints]:
    """(mantissas, decimals) of binary floats: the fewest digits that read back, or fixed."""
    if kind == GridKind.TEXT32:
        words = magnitudes.astype(np.uint32).view(np.float32)
        tokens = scan_texts([str(value) for value in words])
    elif digits >= 16:
        tokens = scan_texts([f"{x:.{digits - 1}e}" for x in magnitudes.view(np.float64).tolist()])
    else:
        tokens = scan_texts([repr(x) for x in magnitudes.view(np.float64).tolist()])
    mantissa, power, shape = tokens.fields.T
    return mantissa, (shape >> kernels().FRACTION_DIGITS) - power


def text32_values(magnitudes: Ints) -> Floats:
    """The binary64 nearest to the shortest text of a binary32, not that binary32 itself."""
    words, inverse = np.unique(magnitudes.astype(np.uint32), return_inverse=True)
    # GRID-09
    values = np.array([float(str(value)) for value in words.view(np.float32)], np.float64)
    return values[inverse].reshape(magnitudes.shape)


def _fixed_texts(values: Floats, negative: Bools, decimals: int) -> Texts:
    pairs = zip(values.tolist(), negative.tolist(), strict=True)
    lines = [f"-{x:.{decimals}f}" if minus else f"{x:.{decimals}f}" for x, minus in pairs]
    offsets = np.concatenate(([0], np.cumsum([len(line) for line in lines], dtype=np.int64)))
    return Texts(np.frombuffer("".join(lines).encode(), np.uint8), offsets.astype(np.int64))
