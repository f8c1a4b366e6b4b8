"""Compiled: split ordinals into leads and tails, and write residuals and tails as bits.

SPEC.md, "Codec 1: fast", is normative. Imported on first use only.
"""

from __future__ import annotations

from mcz.coding.fast.plan_kernels import grown
from mcz.coding.fast.residual_kernels import PLAIN
from mcz.coding.fast.tail_kernels import (
    BASE,
    DIGITS,
    DROP,
    FAR_DIGITS,
    FIRST,
    LEADING,
    LOW,
    NEAR,
    PER_CLASS,
    POWERS,
    REST,
    TINY,
    TOP,
    settle,
)
from mcz.kernels import bit_length, kernel, wrapped
from mcz.kernels.types import Bytes, Ints, Ints2, Words2


def put(out: Bytes, bit: int, value: int, n: int) -> int:
    """Write ``n`` bits, at most 56, the lowest first; returns the bit behind them."""
    at = bit >> 3
    value = value << (int(bit) & 7) | int(out[at])
    n_bytes = ((bit & 7) + n + 7) >> 3
    for place in range(n_bytes):
        out[at + place] = value >> (8 * place) & 255
    return bit + n


def put_code(out: Bytes, bit: int, residual: int, scale: int) -> int:
    """Write a residual; returns the bit behind its code."""
    k = bit_length(scale >> 4)
    folded = 2 * residual if residual >= 0 else -2 * residual - 1
    high = folded >> k
    if high <= PLAIN:
        return put(out, bit, 1 << high | (folded & (1 << k) - 1) << (high + 1), high + 1 + k)
    more = bit_length((high - 6) >> 1)
    bit = put(out, bit, 1 << (PLAIN + more), PLAIN + more + 1)
    return put(out, bit, folded - (6 + (1 << more) << k), k + more)


def put_decimal_9(out: Bytes, bit: int, value: int, n: int) -> int:
    limit = POWERS[n]
    n_bits = bit_length(limit) - 1
    cut = (2 << n_bits) - limit
    if value < cut:
        return put(out, bit, value, n_bits)
    if value < 1 << n_bits:
        return put(out, bit, value, n_bits + 1)
    return put(out, bit, value - (limit - (1 << n_bits)) | 1 << n_bits, n_bits + 1)


def put_decimal(out: Bytes, bit: int, value: int, n: int) -> int:
    """Write a number below 10^n; returns the bit behind it."""
    if n > 9:
        bit = put_decimal_9(out, bit, value // POWERS[9], n - 9)
        value = value % POWERS[9]
        n = 9
    return put_decimal_9(out, bit, value, n)


def put_tail(out: Bytes, bit: int, value: int, n: int, base: int) -> int:
    return put_decimal(out, bit, value, n) if base == 10 else put(out, bit, value, n)


def power(base: int, n: int) -> int:
    return POWERS[n] if base == 10 else 1 << n


def split(magnitude: int, lattice: Ints) -> tuple[int, int]:
    """The class of a magnitude, -1 of zero, and its mantissa."""
    if magnitude == 0:
        return -1, 0
    magnitude -= lattice[FIRST]
    number = magnitude // lattice[PER_CLASS]
    return number, magnitude - number * lattice[PER_CLASS] + lattice[LOW]


@kernel
def find_leads(ordinals: Ints2, lattices: Ints2, leads: Words2) -> None:
    """Fill ``leads`` from ``ordinals``, both (lanes, rows); note lanes with tiny values."""
    for lane in range(len(lattices)):
        lattice = lattices[lane]
        settle(lattices, lane)
        for row in range(ordinals.shape[1]):
            ordinal = ordinals[lane, row]
            if lattice[BASE] == 0:
                leads[lane, row] = wrapped(ordinal >> lattice[DROP])
                continue
            minus = ordinal >> 63
            number, mantissa = split((ordinal ^ minus) >> lattice[DROP], lattice)
            lead, below = 0, lattice[TOP] - number
            if number >= 0 and below < lattice[LEADING]:
                n = below + lattice[DIGITS] - lattice[LEADING]
                lead = mantissa // power(lattice[BASE], n)
            elif number >= 0:
                lattice[TINY] = 1
            leads[lane, row] = wrapped(lead ^ minus)


@kernel
def write_residuals(residuals: Words2, scales: Ints, start: int, stop: int, out: Bytes) -> int:
    """Write the residuals of lanes start <= l < stop, (lanes, rows); returns their bytes.

    ``out`` is zero; ``scales``, in sixteenths, go along.
    """
    bit = 0
    for row in range(1, residuals.shape[1]):
        for lane in range(start, stop):
            residual = int(residuals[lane, row])
            bit = put_code(out, bit, residual, scales[lane])
            scales[lane] = grown(scales[lane], residual)
    return (bit + 7) >> 3


def put_tail_of(out: Bytes, bit: int, ordinal: int, rest: int, lattice: Ints) -> int:
    """Write what the lead of an ordinal leaves out, or a rest; returns the bit behind it."""
    base = lattice[BASE]
    if lattice[REST] >= 0:
        bit = put_code(out, bit, rest, lattice[REST])
        lattice[REST] = grown(lattice[REST], rest)
        return bit
    if base == 0:
        return put(out, bit, ordinal & (1 << lattice[DROP]) - 1, lattice[DROP])
    number, mantissa = split((ordinal ^ (ordinal >> 63)) >> lattice[DROP], lattice)
    below = lattice[TOP] - number
    if number >= 0 and below < lattice[LEADING]:
        n = below + lattice[DIGITS] - lattice[LEADING]
        unit = power(base, n)
        return put_tail(out, bit, mantissa - mantissa // unit * unit, n, base)
    return put_tiny(out, bit, number, mantissa, lattice) if lattice[TINY] else bit


def put_tiny(out: Bytes, bit: int, number: int, mantissa: int, lattice: Ints) -> int:
    """Write the class and the mantissa of an ordinal whose lead is 0."""
    if number < 0:
        return put_decimal(out, bit, 0, 1)
    below = lattice[TOP] - number - (lattice[LEADING] - 1)
    bit = put_decimal(out, bit, min(below, NEAR), 1)
    if below >= NEAR:
        bit = put_decimal(out, bit, below - NEAR, FAR_DIGITS)
    if lattice[BASE] == 10:
        return put_decimal(out, bit, mantissa, lattice[DIGITS])
    return put(out, bit, mantissa - lattice[LOW], lattice[DIGITS] - 1)


@kernel
def write_tails(
    ordinals: Ints2, rests: Ints2, lattices: Ints2, start: int, stop: int, out: Bytes
) -> int:
    """Write the tails of lanes start <= l < stop; returns their bytes. ``out`` is zero.

    ``ordinals`` and ``rests``: (lanes, rows); the scales of rests, in ``lattices``, go along.
    """
    bit = 0
    for row in range(ordinals.shape[1]):
        for lane in range(start, stop):
            bit = put_tail_of(out, bit, ordinals[lane, row], rests[lane, row], lattices[lane])
    return (bit + 7) >> 3
