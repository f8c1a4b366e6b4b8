"""The value hash of a signal, computed piece by piece. SPEC.md, "CEND", is normative."""

from __future__ import annotations

import hashlib
import math

import numpy as np
from numpy.typing import NDArray

from mcz.model.types import Values

ROWS = 4096  # at a time, so that hashing needs little memory
PIECE = 2**20  # bytes of a mask that are made at a time


def canonical(values: Values) -> bytes:
    """The bytes that hashes and conformance compare: little-endian, row after row, one NaN."""
    return _canonical(values).tobytes()


def _canonical(values: Values) -> Values:
    """The canonical array, ``values`` itself if it has these bytes."""
    if values.dtype == np.int64:
        return np.ascontiguousarray(values, "<i8")  # CEND-03
    if values.size and np.isnan(values.min()):  # some are
        values = np.where(np.isnan(values), math.nan, values)
    return np.ascontiguousarray(values, "<f8")  # CEND-03


def value_hash(values: Values, mask: NDArray[np.bool_] | None) -> bytes:
    """SHA-256 of the canonical array and, if any value is invalid, of the mask."""
    digest = ValueDigest()
    for start in range(0, len(values), ROWS):
        rows = slice(start, start + ROWS)
        digest.update(values[rows], None if mask is None else mask[rows])
    return digest.digest()


class ValueDigest:
    """SHA-256 of the canonical array and, if any value is invalid, of the mask after it.

    So masks are kept until the end, a mask that is all valid as a count.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._masks: list[bytes | int] = []

    def update(self, values: Values, mask: NDArray[np.bool_] | None) -> None:
        """Add rows; ``mask`` None: all are valid."""
        self._hash.update(_canonical(values).data)
        if mask is not None and not mask.all():
            self._masks.append(mask.astype("u1").tobytes())  # CEND-04
        elif self._masks and isinstance(self._masks[-1], int):
            self._masks[-1] += values.size
        else:
            self._masks.append(values.size)

    def digest(self) -> bytes:
        """The hash of all that was added."""
        whole = self._hash.copy()
        if any(isinstance(mask, bytes) for mask in self._masks):  # CEND-04
            for mask in self._masks:
                for part in _parts(mask):
                    whole.update(part)
        return whole.digest()


def _parts(mask: bytes | int) -> list[bytes]:
    if isinstance(mask, bytes):
        return [mask]
    pieces, rest = divmod(mask, PIECE)
    return [b"\1" * PIECE] * pieces + [b"\1" * rest]
