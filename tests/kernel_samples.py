"""Small kernels for the edges of what kernels compute; ``kernel_builds`` has them compiled.

The kernels of the package are compared with their sources themselves: ``kernel_twins``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from mcz.kernels import bit_length, eight_bytes, put_eight_bytes, trailing_zeros, truncated
from mcz.kernels.types import Bytes, Bytes2, Flags, FloatColumn, Floats2, Ints, Ints2

WEIGHTS = (3, -1, 4, 1 << 40)
PAIRS = ((1, 0.5), (-2, 0.25), (3, -1.0))
LEAST = -(1 << 63)


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Mark a function for the build; here it stays plain Python, to compare with."""
    return function


# Integers


@kernel
def divide(a: int, b: int) -> int:
    return a // b


@kernel
def remainder(a: int, b: int) -> int:
    return a % b


@kernel
def by_constants(a: int) -> tuple[int, int, int, int]:
    return a // 8, a % 8, a // 7, a % -7


@kernel
def arithmetic(a: int, b: int) -> tuple[int, int, int, int]:
    return a + b, a - b, a * b, -a


@kernel
def bits(a: int, b: int) -> tuple[int, int, int]:
    return a & b, a | b, a ^ b


@kernel
def shifts(a: int, n: int) -> tuple[int, int, int]:
    return a << n, a >> n, (1 << n) - 1


@kernel
def extremes(a: int, b: int, c: int) -> tuple[int, int, int]:
    return min(a, b, c), max(a, b, c), abs(a)


@kernel
def length_of(a: int) -> int:
    return bit_length(a)


@kernel
def move_bytes(data: Bytes, at: int, to: int) -> int:
    found = eight_bytes(data, at)
    put_eight_bytes(data, to, found)
    return trailing_zeros(found)


@kernel
def compare(a: int, b: int, c: int) -> tuple[bool, bool, bool, int]:
    return a < b <= c, a == b != c, not a > b >= c, (a < b) + (b < c)


@kernel
def choose(a: int, b: int) -> int:
    if a < b <= 10 or not (a == 3 and b != 4):
        return 1 if a > b else 2 if a == b else 3
    return 4


@kernel
def is_true(a: int, x: float, flag: bool) -> tuple[bool, bool, bool]:
    one = two = three = False
    if a:
        one = True
    if x:
        two = True
    if not flag:
        three = True
    return one, two, three


# Floats


@kernel
def compute(a: float, b: float) -> tuple[float, float, float, float]:
    return a * b + a, a - b / 3, (a + b) ** 2, -a


@kernel
def round_off(a: float) -> tuple[float, float, float]:
    return np.floor(a), np.rint(a), abs(a)


@kernel
def order(a: float, b: float, c: float) -> tuple[bool, bool, bool, bool]:
    return a < b, not a <= b, a != b, a < b < c


@kernel
def float_extremes(a: float, b: float, c: float) -> tuple[float, float]:
    return min(a, b, c), max(a, b, c)


@kernel
def scale(a: float, power: int) -> float:
    return math.ldexp(a, power)


@kernel
def to_integer(a: float) -> int:
    return int(a)


@kernel
def to_integer_in_range(a: float) -> int:
    return truncated(a)


@kernel
def mix(a: int, x: float, flag: bool) -> tuple[float, float, int]:
    return a + x, 2.0 * (a if flag else x), flag + flag


# Tuples and constant tables


@kernel
def pair_sum(pair: tuple[int, float]) -> float:
    return pair[0] + pair[1]


@kernel
def table(at: int) -> tuple[int, float, int]:
    total, weighted = 0, 0.0
    for weight in WEIGHTS:
        total = 3 * total + weight
    for size, part in PAIRS:
        weighted += size * part
    for step in (1, -1, 5):
        total += step
    return total, weighted, WEIGHTS[at] + WEIGHTS[1]


# Arrays


@kernel
def lengths(row: Ints, grid: Floats2) -> tuple[int, int, int, bool]:
    n_rows, n_columns = grid.shape
    return len(row) - 5, n_rows - len(row), n_columns * -1, len(row) - 5 < grid.shape[0]


@kernel
def slices(row: Ints, start: int, stop: int) -> tuple[int, int, int, int]:
    part, head, tail = row[start:stop], row[:stop], row[start:]
    total = 0
    for value in part:
        total = 3 * total + value
    return len(part), len(head), len(tail), total


@kernel
def store_bytes(values: Ints, out: Bytes, table: Bytes2) -> int:
    total = 0
    for i in range(len(values)):
        out[i] = values[i]
        table[i & 1, 0] = out[i]
        total += int(out[i]) << 40
    return total


@kernel
def store_flags(values: Ints, marks: Flags) -> tuple[int, bool]:
    count, is_any = 0, False
    for i in range(len(values)):
        marks[i] = (values[i] & 6) != 0
        if marks[i] and not marks[0]:
            is_any = True
        count += marks[i]
    return count, is_any


@kernel
def allocate(n: int, m: int) -> tuple[int, int, float]:
    whole, grid = np.zeros(n, np.int64), np.empty((n, m))
    marks, row = np.zeros(m, np.bool_), np.zeros(n, np.uint8)
    for i in range(n):
        for k in range(m):
            grid[i, k] = i - k
        whole[i] = row[i] + i
    total = 0.0
    for i in range(n):
        for k in range(m):
            total += grid[i, k] * whole[i]
    return len(whole) + len(marks), grid.shape[1], total


@kernel
def add(values: Floats2, factor: float, out: Floats2) -> float:
    """Add ``factor`` times ``values`` to ``out``; the sum of what is written."""
    total = 0.0
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            out[i, k] += factor * values[i, k]
            total += out[i, k]
    return total


@kernel
def add_column(values: FloatColumn, out: FloatColumn) -> None:
    for i in range(len(values)):
        out[i] += values[i]


@kernel
def item(row: Ints, at: int) -> int:
    return row[at]


@kernel
def item_pair(grid: Ints2, at: int) -> tuple[int, int]:
    return grid[0, at], grid[at, 0]


@kernel
def set_item(row: Ints, at: int) -> None:
    row[at] += 1


@kernel
def fill_long(marks: Ints, n: int) -> int:
    """Compute for long: ``marks`` say first that this began, last that it ended."""
    value = 1
    marks[0] = 1
    for i in range(n):
        value = (value * 5 + i) & 0xFFFFFF
        marks[1 + (value & 1)] = value
    marks[3] = 1
    return value
