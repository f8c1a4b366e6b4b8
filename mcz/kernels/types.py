"""Array types of kernels: item and number of axes. The last axis is contiguous, except of columns.

A kernel is compiled for the types that its parameters are annotated with: these, ``int`` (64 bits),
``float`` (64 bits), ``bool``, tuples of numbers, and NamedTuples of all of these. ``fit`` converts
the arrays of a caller to the type and layout that a compiled kernel requires.
"""

from __future__ import annotations

from collections.abc import Iterable
from operator import index
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Ints2 = NDArray[np.int64]
Ints3 = NDArray[np.int64]
Words = NDArray[np.int32]
Words2 = NDArray[np.int32]
IntColumn = NDArray[np.int64]
IntColumns = NDArray[np.int64]  # two axes
Floats = NDArray[np.float64]
Floats2 = NDArray[np.float64]
Floats3 = NDArray[np.float64]
Floats4 = NDArray[np.float64]
FloatColumn = NDArray[np.float64]
FloatColumns = NDArray[np.float64]  # two axes
Bytes = NDArray[np.uint8]
Bytes2 = NDArray[np.uint8]
Flags = NDArray[np.bool_]
Items = NDArray[np.generic]  # numbers or words of any type, as a file or a caller has them


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
    """``given`` with this dtype and number of axes, aligned, contiguous if ``dense``.

    It is copied if it is not so. A copy of an array that the kernel writes is noted in
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
    """``given`` as a tuple; raises TypeError for a wrong item, ValueError by length."""
    return tuple(
        index(item) if is_integer else item
        for item, is_integer in zip(given, are_integers, strict=True)
    )


def restore(moved: Moved) -> None:
    """Copy results that a kernel wrote to copies back to the caller's arrays."""
    for given, copy in moved:
        given[...] = copy
