"""Conversion of arrays to the layout and type that compiled kernels require."""

from __future__ import annotations

from collections.abc import Iterable
from operator import index
from typing import Any

import numpy as np

from mcz.kernels.types import Items

Moved = list[tuple[Items, Items]]  # what was given, what was taken for it
SOUND = 0x1 | 0x100  # flags of an array: contiguous, aligned
WRITEABLE = 0x400


def fit(
    given: object,
    dtype: np.dtype[np.generic],
    rank: int,
    dense: bool,
    is_written: bool,
    moved: Moved,
) -> Items:
    """``given`` with this dtype and number of axes, aligned, contiguous where ``dense``.

    It is copied where it is not so. A copy of an array that the kernel writes is noted in
    ``moved``, for ``restore``. Raises TypeError for other dtypes and for what is to be written and
    no array, ValueError for another number of axes and for a read-only array that is to be written.
    """
    if type(given) is np.ndarray and given.dtype is dtype:
        wanted = SOUND | WRITEABLE if is_written else SOUND
        if given.flags.num & wanted == wanted and given.ndim == rank:
            return given.view(np.uint8) if dtype.kind == "b" else given
    if is_written and not isinstance(given, np.ndarray):
        raise TypeError(f"a kernel writes to this {type(given).__name__}, which is no array")
    array = np.asarray(given)
    if array.ndim != rank:
        raise ValueError(f"an array of {array.ndim} axes where a kernel has {rank}")
    if array.dtype.newbyteorder("=") != dtype:
        raise TypeError(f"an array of {array.dtype} where a kernel has {dtype}")
    if is_written and not array.flags.writeable:
        raise ValueError("a kernel writes to this array, which is read-only")
    flags = array.flags
    if not (flags.aligned and array.dtype.isnative and (flags.c_contiguous or not dense)):
        copy = np.array(array, dtype=dtype, order="C")
        if is_written:
            moved.append((array, copy))
        array = copy
    return array.view(np.uint8) if dtype.kind == "b" else array


def items(given: Iterable[Any], are_integers: tuple[bool, ...]) -> tuple[Any, ...]:
    """``given`` as a tuple; raises TypeError where an integer is none, ValueError by its length."""
    return tuple(
        index(item) if is_integer else item
        for item, is_integer in zip(given, are_integers, strict=True)
    )


def restore(moved: Moved) -> None:
    """Copy results that a kernel wrote to copies back to the caller's arrays."""
    for given, copy in moved:
        given[...] = copy
