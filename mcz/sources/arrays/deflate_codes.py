"""The bits and prefix codes of raw deflate (RFC 1951), read and written by kernels.

SPEC.md, "Deflated contents", is normative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcz.kernels import eight_bytes, put_eight_bytes
from mcz.kernels.types import Bytes, Ints, Ints2

STORED, FIXED, DYNAMIC = 0, 1, 2  # kinds of blocks
SHORTEST, LONGEST = 3, 258  # bytes of a match
N_LITERALS, N_DISTANCES = 288, 32  # symbols of the two codes
BLOCK_END, FIRST_LENGTH = 256, 257  # symbols
MOST_BITS = 15  # of a code
SPARE = 16  # bytes beyond an end that loops may read, or write unchanged


class Codes(NamedTuple):
    """The literal and the distance codes of a block; ``which`` is 0 or 1."""

    lengths: Ints  # (320,), bits of each code
    counts: Ints2  # (2, 16), codes of each length
    symbols: Ints2  # (2, 320), in the order of their codes
    bits: Ints  # (320,), the codes, first bit lowest
    order: Ints  # (19,), of the code lengths in a DYNAMIC block


def read_bits(data: Bytes, at: int, n: int) -> int:
    """The ``n`` <= 16 bits from bit ``at`` on."""
    first = at >> 3
    word = int(data[first]) | int(data[first + 1]) << 8 | int(data[first + 2]) << 16
    return (word >> (at & 7)) & ((1 << n) - 1)


def put_bits(out: Bytes, at: int, value: int, n: int) -> int:
    """Write ``n`` <= 32 bits at bit ``at``; return the bit after them."""
    put_eight_bytes(out, at >> 3, eight_bytes(out, at >> 3) | int(value) << int(at & 7))
    return at + n


def set_fixed_lengths(lengths: Ints) -> None:
    """Set the lengths of the codes of a FIXED block."""
    for symbol in range(N_LITERALS):
        lengths[symbol] = 8
    for symbol in range(144, 256):
        lengths[symbol] = 9
    for symbol in range(256, 280):
        lengths[symbol] = 7
    for symbol in range(N_DISTANCES):
        lengths[N_LITERALS + symbol] = 5


def read_lengths(data: Bytes, at: int, end: int, codes: Codes) -> int:
    """Read the codes of a DYNAMIC block at bit ``at``; return the bit after them, -1 for a fault.

    ``end`` is the bit after the last; ``data`` has SPARE bytes beyond it.
    """
    if at + 14 > end:
        return -1
    n_literals = read_bits(data, at, 5) + 257
    n_distances = read_bits(data, at + 5, 5) + 1
    n_lengths = read_bits(data, at + 10, 4) + 4
    at += 14
    if n_literals > 286 or n_distances > 30 or at + 3 * n_lengths > end:
        return -1
    lengths = codes.lengths
    for symbol in range(N_LITERALS + N_DISTANCES):
        lengths[symbol] = 0
    small = np.zeros(N_LITERALS + N_DISTANCES, np.int64)
    for k in range(n_lengths):
        small[codes.order[k]] = read_bits(data, at, 3)
        at += 3
    if not _sort_symbols(small, 0, 19, 0, codes) or not _is_whole(codes, 0):
        return -1
    n = 0
    while n < n_literals + n_distances:
        symbol, at = read_symbol(data, at, end, 0, codes)
        if symbol < 0:
            return -1
        repeats = 1
        value = symbol
        if symbol == 16:
            if n == 0:
                return -1
            value = small[n - 1]
            repeats = 3 + read_bits(data, at, 2)
            at += 2
        elif symbol == 17:
            value = 0
            repeats = 3 + read_bits(data, at, 3)
            at += 3
        elif symbol == 18:
            value = 0
            repeats = 11 + read_bits(data, at, 7)
            at += 7
        if at > end or n + repeats > n_literals + n_distances:
            return -1
        for k in range(n, n + repeats):
            small[k] = value
        n += repeats
    for symbol in range(n_literals):
        lengths[symbol] = small[symbol]
    for symbol in range(n_distances):
        lengths[N_LITERALS + symbol] = small[n_literals + symbol]
    return at


def _sort_symbols(lengths: Ints, start: int, n: int, which: int, codes: Codes) -> bool:
    """Sort the ``n`` symbols from ``start`` on by their codes; False if they are no codes."""
    counts = codes.counts
    for length in range(MOST_BITS + 1):
        counts[which, length] = 0
    for symbol in range(n):
        counts[which, lengths[start + symbol]] += 1
    first = np.zeros(MOST_BITS + 2, np.int64)
    free = 1
    for length in range(1, MOST_BITS + 1):
        free = 2 * free - counts[which, length]
        if free < 0:
            return False
        first[length + 1] = first[length] + counts[which, length]
    for symbol in range(n):
        length = lengths[start + symbol]
        if length:
            codes.symbols[which, first[length]] = symbol
            first[length] += 1
    return True


def read_symbol(data: Bytes, at: int, end: int, which: int, codes: Codes) -> tuple[int, int]:
    """Read a symbol at bit ``at``; return it, -1 for a fault, and the bit after it."""
    word = read_bits(data, at, MOST_BITS)
    code = 0
    first = 0
    index = 0
    for length in range(1, MOST_BITS + 1):
        code |= word & 1
        word >>= 1
        count = codes.counts[which, length]
        if code - count < first:
            if at + length > end:
                return -1, at
            return codes.symbols[which, index + code - first], at + length
        index += count
        first = 2 * (first + count)
        code <<= 1
    return -1, at


def set_codes(codes: Codes, start: int, which: int) -> None:
    """Set the bits of the codes of sorted symbols."""
    code = 0
    index = 0
    for length in range(1, MOST_BITS + 1):
        code <<= 1
        for _ in range(codes.counts[which, length]):
            value = 0
            for bit in range(length):
                value |= ((code >> bit) & 1) << (length - 1 - bit)
            codes.bits[start + codes.symbols[which, index]] = value
            code += 1
            index += 1


def _is_whole(codes: Codes, which: int) -> bool:
    """Return True if every sequence of bits begins with a code."""
    free = 1
    for length in range(1, MOST_BITS + 1):
        free = 2 * free - codes.counts[which, length]
    return free == 0


def sort_codes(codes: Codes) -> bool:
    """Sort the symbols of both codes of a block; False if they are not whole."""
    if not _sort_symbols(codes.lengths, 0, N_LITERALS, 0, codes):
        return False
    if not _sort_symbols(codes.lengths, N_LITERALS, N_DISTANCES, 1, codes):
        return False
    for which in range(2):
        n_used = 0
        for length in range(1, MOST_BITS + 1):
            n_used += codes.counts[which, length]
        is_short = n_used <= 1 and codes.counts[which, 1] == n_used
        if not is_short and not _is_whole(codes, which):
            return False
    return True


def length_base(symbol: int) -> tuple[int, int]:
    """The least match length of a symbol, and its extra bits."""
    k = symbol - FIRST_LENGTH
    if k < 8:
        return 3 + k, 0
    if k == 28:
        return LONGEST, 0
    extra = (k >> 2) - 1
    return 3 + ((4 + (k & 3)) << extra), extra


def distance_base(symbol: int) -> tuple[int, int]:
    """The least distance of a symbol, and its extra bits."""
    if symbol < 4:
        return 1 + symbol, 0
    extra = (symbol >> 1) - 1
    return 1 + ((2 + (symbol & 1)) << extra), extra


def _length_symbol(length: int) -> int:
    if length == LONGEST:
        return FIRST_LENGTH + 28
    k = length - SHORTEST
    extra = 0
    while k >> extra >= 8:
        extra += 1
    return FIRST_LENGTH + 4 * extra + (k >> extra)


def _distance_symbol(distance: int) -> int:
    k = distance - 1
    extra = 0
    while k >> extra >= 4:
        extra += 1
    return 2 * extra + (k >> extra)


def put_token(out: Bytes, at: int, literal: int, length: int, distance: int, codes: Codes) -> int:
    """Write a token at bit ``at``; return the bit after it, -1 if a symbol has no code."""
    if length == 1:
        if codes.lengths[literal] == 0:
            return -1
        return put_bits(out, at, codes.bits[literal], codes.lengths[literal])
    symbol = _length_symbol(length)
    if codes.lengths[symbol] == 0:
        return -1
    at = put_bits(out, at, codes.bits[symbol], codes.lengths[symbol])
    base, extra = length_base(symbol)
    at = put_bits(out, at, length - base, extra)
    symbol = _distance_symbol(distance)
    if codes.lengths[N_LITERALS + symbol] == 0:
        return -1
    at = put_bits(out, at, codes.bits[N_LITERALS + symbol], codes.lengths[N_LITERALS + symbol])
    base, extra = distance_base(symbol)
    return put_bits(out, at, distance - base, extra)
