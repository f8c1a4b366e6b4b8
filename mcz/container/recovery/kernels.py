"""Compiled: products of blocks in GF(2^16), and the transform between values and coefficients.

Blocks are rows of int64, four elements in each. Imported on first use only.
"""

from __future__ import annotations

from mcz.kernels import kernel
from mcz.kernels.types import Ints, Ints2

REDUCED = 0x1100B


def fill_table(table: Ints, factor: int) -> int:
    """``table`` (512,): the products of ``factor`` with each low byte, then with each high one."""
    table[0] = 0
    table[256] = 0
    for high in range(2):
        base = 256 * high
        for bit in range(8):
            size = 1 << bit
            for i in range(size):
                table[base + size + i] = table[base + i] ^ factor
            factor <<= 1
            if factor > 65535:
                factor ^= REDUCED
    return 0


def product(table: Ints, x: int) -> int:
    """The products of the four elements in ``x``."""
    a = table[x & 255] ^ table[256 + ((x >> 8) & 255)]
    b = table[(x >> 16) & 255] ^ table[256 + ((x >> 24) & 255)]
    c = table[(x >> 32) & 255] ^ table[256 + ((x >> 40) & 255)]
    d = table[(x >> 48) & 255] ^ table[256 + ((x >> 56) & 255)]
    return int(a | (b << 16) | (c << 32) | (d << 48))


@kernel
def add_product(target: Ints, source: Ints, factor: int, table: Ints) -> int:
    """target += factor * source, both (n,)."""
    fill_table(table, factor)
    for i in range(len(target)):
        target[i] ^= product(table, source[i])
    return 0


def skew_at(skews: Ints2, level: int, point: int) -> int:
    value = 0
    for bit in range(16):
        if (point >> bit) & 1:
            value ^= skews[level, bit]
    return value


@kernel
def to_coefficients(blocks: Ints2, levels: int, offset: int, skews: Ints2, table: Ints) -> int:
    """Values at ``offset`` + 0 ... 2^levels - 1 in place to coefficients; a row each."""
    n, width = blocks.shape
    for level in range(levels):
        half = 1 << level
        for pair in range(n >> (level + 1)):
            start = pair * 2 * half
            factor = skew_at(skews, level, offset + start)
            fill_table(table, factor)
            for i in range(start, start + half):
                for c in range(width):
                    blocks[i + half, c] ^= blocks[i, c]
                if factor != 0:
                    for c in range(width):
                        blocks[i, c] ^= product(table, blocks[i + half, c])
    return 0


@kernel
def to_values(blocks: Ints2, levels: int, offset: int, skews: Ints2, table: Ints) -> int:
    """The inverse of ``to_coefficients``."""
    n, width = blocks.shape
    for step in range(levels):
        level = levels - 1 - step
        half = 1 << level
        for pair in range(n >> (level + 1)):
            start = pair * 2 * half
            factor = skew_at(skews, level, offset + start)
            fill_table(table, factor)
            for i in range(start, start + half):
                if factor != 0:
                    for c in range(width):
                        blocks[i, c] ^= product(table, blocks[i + half, c])
                for c in range(width):
                    blocks[i + half, c] ^= blocks[i, c]
    return 0
