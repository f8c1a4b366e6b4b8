"""Text grids: tokens to ordinals, ordinals to text. SPEC.md, "Number grids".

A PRINTED grid prints the numbers of a base grid by another rule. Its digits name the base, its
style is a format of C for binary64: ``%.nf`` for n, ``%.nf`` of 17 digits and zeros for
``SHORT_FIXED`` + n, ``%.ng`` for ``SIGNIFICANT`` + n, ``%.ne`` for ``EXPONENT`` + n.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcz.kernels import SPARE
from mcz.model.numbers import decimal_kernels as kernels
from mcz.model.numbers.rules import (
    BASE_32,
    BASE_64,
    BASE_GENERAL,
    DECIMAL_LIMIT,
    EXPONENT,
    FIXED_TEXT,
    SHORT_FIXED,
    SIGNIFICANT,
    TENS,
    GridFlag,
    GridKind,
    binary32_magnitudes,
    binary32_values,
    general_magnitudes,
    general_split,
    limit,
    scaled_magnitudes,
)
from mcz.model.numbers.tokens import Texts, Tokens, nearest_double, scan_texts
from mcz.model.types import Bools, Floats, Ints

_UNLIMITED = 1_000_000  # more decimals, and a larger exponent, than any number has
WIDEST = 48  # bytes of a number from ``write``; the longest has 17 digits after "-0.00000"
_JAVASCRIPT = 1  # the ``digits`` of a TEXT64 grid that prints as JavaScript does


def printed_exponents(kind: GridKind, digits: int) -> tuple[int, int, int]:
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


def match_tokens(
    tokens: Tokens, kind: GridKind, digits: int, flags: int, allowed: int | None = None
) -> tuple[Ints, Bools, int]:
    """(ordinals, mask of the tokens that the grid prints exactly, count of the others).

    TEXT grids check only the shape. Stops after more than ``allowed`` misses.
    """
    general, low, high = printed_exponents(kind, digits)
    trim = kind != GridKind.FIXED and digits < FIXED_TEXT
    decimals = digits % FIXED_TEXT if general == 0 else _UNLIMITED
    text = kind in (GridKind.TEXT64, GridKind.TEXT32)
    largest = 2**62 if text else limit(kind, digits)
    rule = general, decimals, int(trim), low, high, flags, largest
    ordinals = np.empty(len(tokens), np.int64)
    printed = np.empty(len(tokens), np.bool_)
    most = len(tokens) if allowed is None else allowed
    misses = kernels.match(tokens.fields, rule, ordinals, printed, most)
    return ordinals, printed, misses


def uncertain_tokens(tokens: Tokens, kind: GridKind, digits: int, printed: Bools) -> Bools:
    """Mask of the tokens that need an exact check; ``printed`` marks those of the right shape.

    A normal number of 15 digits (6 in binary32) is its own shortest text.
    """
    power, shape = tokens.fields[:, 1], tokens.fields[:, 2]
    safe_digits, safe_power = (6, 30) if kind == GridKind.TEXT32 else (15, 290)
    if digits > _JAVASCRIPT:
        return printed | too_long(tokens)
    is_uncertain: Bools = (shape >> kernels.SIGNIFICANT & 31) > safe_digits
    is_uncertain |= np.abs(power) > safe_power
    return (printed & is_uncertain) | too_long(tokens)


def too_long(tokens: Tokens) -> Bools:
    """Mask of the numbers with more digits than a match examines."""
    marks = kernels.LONG | kernels.BAD | kernels.SPECIAL
    result: Bools = tokens.fields[:, 2] & marks == kernels.LONG
    return result


def token_ordinals32(tokens: Tokens) -> Ints:
    """Ordinals of the binary32 numbers nearest to tokens."""
    values = tokens.values()
    magnitudes = np.minimum(binary32_magnitudes(np.abs(values)), limit(GridKind.TEXT32, 0))
    return magnitudes ^ -np.signbit(values).astype(np.int64)


def grid_texts(kind: GridKind, digits: int, flags: int, magnitudes: Ints, negative: Bools) -> Texts:
    """Print the numbers of ``magnitudes``, which are within the limit."""
    general, low, high = printed_exponents(kind, digits)
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
    kernels.write(negative, np.ascontiguousarray(mantissas), fractions, rule, out, offsets)
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
    return mantissa, (shape >> kernels.FRACTION_DIGITS) - power


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


ROUND_TRIP = 17  # significant digits that identify every binary64
DECIMAL_TRIP = 16  # significant digits that identify numbers up to 2^51 on a decimal grid


def base_values(digits: int, magnitudes: Ints) -> Floats:
    """The binary64 that is printed."""
    if digits == BASE_32:
        return binary32_values(magnitudes)
    if digits == BASE_64:
        return magnitudes.view(np.float64)
    if digits > BASE_GENERAL:
        return nearest_double(*general_split(magnitudes, digits - BASE_GENERAL))
    result: Floats = np.divide(magnitudes, TENS[digits])
    return result


def printed_magnitudes(digits: int, values: Floats) -> Ints:
    """Magnitudes of the nearest numbers of the base, which the caller limits."""
    if digits == BASE_32:
        return binary32_magnitudes(values)
    if digits == BASE_64:
        return values.view(np.int64)
    if digits > BASE_GENERAL:
        return general_magnitudes(values.ravel(), digits - BASE_GENERAL).reshape(values.shape)
    return scaled_magnitudes(values, TENS[digits], False, DECIMAL_LIMIT)


def printed_values(digits: int, style: int, magnitudes: Ints) -> Floats:
    """The binary64 nearest to the printed text: the value that other readers of the text see."""
    printed = base_values(digits, magnitudes)
    if _is_reversible(digits, style):
        return printed
    unique, inverse = np.unique(printed, return_inverse=True)
    print_one = printer(style)
    values = np.array([float(print_one(x)) for x in unique.tolist()], np.float64)  # GRID-09
    return values[inverse].reshape(printed.shape)


def _is_reversible(digits: int, style: int) -> bool:
    """Return True if the text of a number differs from those of all others of its base."""
    if digits > BASE_GENERAL:
        return True
    n_digits = style - EXPONENT + 1 if style >= EXPONENT else style - SIGNIFICANT
    return n_digits >= (DECIMAL_TRIP if digits < BASE_32 else ROUND_TRIP)


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
    n_decimals = ROUND_TRIP - 1 - int(power)  # decimals of 17 digits
    if x == 0 or n_decimals >= decimals:
        return f"{x:.{decimals}f}"
    digits = mantissa.replace(".", "")
    whole = digits.rjust(n_decimals + 1, "0") if n_decimals > 0 else digits + "0" * -n_decimals
    point = len(whole) - max(n_decimals, 0)
    fraction = whole[point:].ljust(decimals, "0")
    return f"{whole[:point]}.{fraction}" if fraction else whole


def printed_texts(digits: int, style: int, flags: int, magnitudes: Ints, negative: Bools) -> Texts:
    """Print numbers of checked magnitudes."""
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
    exponent = power[1:].lstrip("0") if flags & GridFlag.EXPONENT1 else power[1:]
    width = 3 if flags & GridFlag.EXPONENT3 else 1
    return (
        mantissa + ("E" if flags & GridFlag.UPPER else e) + power[:1] + exponent.rjust(width, "0")
    )


def _general(values: Floats, digits: int, flags: int, negative: Bools) -> Texts:
    fields = scan_texts([f"{x:.{digits - 1}e}" for x in values.tolist()]).fields
    fractions = (fields[:, 2] >> kernels.FRACTION_DIGITS) - fields[:, 1]
    out = np.empty(len(values) * WIDEST + SPARE, np.uint8)
    offsets = np.zeros(len(values) + 1, np.int64)
    rule = 1, -4, digits, flags
    kernels.write(negative, np.ascontiguousarray(fields[:, 0]), fractions, rule, out, offsets)
    return Texts(out[: offsets[-1]].copy(), offsets)


def printed_shapes(tokens: Tokens, style: int) -> Bools:
    """Mask of the tokens in the shape that the style prints."""
    shape = tokens.fields[:, 2]
    matches: Bools = shape & (kernels.BAD | kernels.SPECIAL) == 0
    if SIGNIFICANT < style < EXPONENT:
        return matches
    decimals = style - EXPONENT if style >= EXPONENT else style % SHORT_FIXED
    matches &= (shape & kernels.EXPONENT != 0) == (style >= EXPONENT)
    matches &= shape >> kernels.FRACTION_DIGITS == decimals
    return matches
