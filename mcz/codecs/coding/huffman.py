"""Canonical prefix codes after Huffman, and integers in classes with such codes.

SPEC.md, "Prefix codes", is normative. Source: D. A. Huffman, A method for the construction of
minimum-redundancy codes, 1952; lengths limited by package-merge (Larmore and Hirschberg, 1990).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcz.errors import FormatError
from mcz.model.types import Ints

MAX_LENGTH = 15  # SPACE-13
DIRECT = 16  # integers below it are classes of their own
N_CLASSES = 90  # up to 2^41 (SPACE-14)


def class_of(value: int) -> tuple[int, int]:
    """The class of an integer from 0 to 2^41 - 1, and how many of its low bits follow it.

    >>> class_of(3), class_of(16), class_of(24), class_of(2**41 - 1)
    ((3, 0), (16, 3), (17, 3), (89, 39))
    """
    if value < DIRECT:
        return value, 0
    n = value.bit_length()
    return DIRECT + 2 * (n - 5) + (value >> (n - 2) & 1), n - 2


def code_lengths(counts: Sequence[int]) -> list[int]:
    """The length of each symbol's code, 0 if its count is 0, at most ``MAX_LENGTH``.

    The code is the shortest one of such lengths. If one symbol occurs alone, its length is 1.

    >>> code_lengths([5, 0, 1, 1])
    [1, 0, 2, 2]
    """
    used = [symbol for symbol, count in enumerate(counts) if count]
    lengths = [0] * len(counts)
    if len(used) == 1:
        lengths[used[0]] = 1
        return lengths
    # A package is its weight and how often each symbol is in it.
    single = sorted((counts[symbol], (symbol,)) for symbol in used)
    packages: list[tuple[int, tuple[int, ...]]] = []
    for _ in range(MAX_LENGTH):
        merged = sorted(single + packages)
        pairs = zip(merged[::2], merged[1::2], strict=False)
        packages = [(a[0] + b[0], a[1] + b[1]) for a, b in pairs]
    for _, symbols in packages[: max(0, len(used) - 1)]:
        for symbol in symbols:
            lengths[symbol] += 1
    return lengths


def codes_of(lengths: Sequence[int], where: str) -> Ints:
    """Canonical code of each symbol: shorter codes first, equal lengths in symbol order.

    Raises FormatError unless the lengths make a complete code: every string of bits begins with
    one. A single symbol of length 1 is a code as well.
    """
    used = [length for length in lengths if length]
    if any(length > MAX_LENGTH for length in used):
        raise FormatError(f"{where}: a code has {max(used)} bits; at most {MAX_LENGTH} are allowed")
    room = sum(1 << (MAX_LENGTH - length) for length in used)
    if used not in ([], [1]) and room != 1 << MAX_LENGTH:  # PREFIX-04, PREFIX-05
        raise FormatError(f"{where}: the code lengths make no complete prefix code")
    codes = np.zeros(len(lengths), np.int64)
    code = 0
    for length in range(1, MAX_LENGTH + 1):
        for symbol, own in enumerate(lengths):
            if own == length:
                codes[symbol] = code
                code += 1
        code <<= 1
    return codes
