"""Ranges, and rows chosen as NumPy indexes one axis: by integers, slices, lists, arrays, masks."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import numpy as np

from mcz.errors import OutOfRangeError
from mcz.model.types import Ints

Rows = int | range | Ints


def row_numbers(key: Any, n_rows: int, noun: str) -> Rows:
    """The rows among ``n_rows`` that ``key`` chooses, each 0 <= row < n_rows.

    An int for an integer, a range for a slice, otherwise int64 of the shape of the index; for a
    mask (bool, (n_rows,)) the numbers of its True entries. ``noun`` names a row in messages. Raises
    OutOfRangeError, which is also an IndexError.
    """
    if key is Ellipsis:
        key = slice(None)
    if isinstance(key, slice):
        try:
            return range(n_rows)[key]
        except (TypeError, ValueError) as error:
            raise OutOfRangeError(f"{noun}s {key}: {error}") from None
    if not isinstance(key, (bool, np.bool_)):
        with suppress(TypeError):  # not an integer
            return _single(operator.index(key), n_rows, noun)
    try:
        array = np.asarray(key)
    except ValueError:  # lists of different lengths
        raise OutOfRangeError(f"{noun}s cannot be indexed with {key!r}") from None
    if array.dtype == np.bool_:
        if array.shape not in ((n_rows,), (0,)):  # NumPy takes an empty mask of any axis
            raise OutOfRangeError(f"a mask of shape {array.shape} does not fit {n_rows} {noun}s")
        return np.flatnonzero(array)
    if array.size == 0 and not isinstance(key, np.ndarray):
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu":
        raise OutOfRangeError(
            f"index {noun}s with integers, slices or a mask, not with {array.dtype}"
        )
    wrong = array[(array < -n_rows) | (array >= n_rows)]
    if wrong.size:
        raise OutOfRangeError(f"{noun} {wrong[0]} is out of range; there are {n_rows}")
    numbers = array.astype(np.int64)
    return np.where(numbers < 0, numbers + n_rows, numbers)


def _single(number: int, n_rows: int, noun: str) -> int:
    if not -n_rows <= number < n_rows:
        raise OutOfRangeError(f"{noun} {number} is out of range; there are {n_rows}")
    return number % n_rows


def merged_ranges(ranges: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Sort ranges, and join those that touch.

    >>> merged_ranges([(8, 9), (0, 4), (4, 6)])
    [(0, 6), (8, 9)]
    """
    merged: list[tuple[int, int]] = []
    for start, stop in sorted(ranges):
        if merged and start <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(stop, merged[-1][1])
        else:
            merged.append((start, stop))
    return merged
