"""A stream of bits around a compiled loop: the coder started, the loop run, the bytes ended.

SPEC.md, "Entropy coding", is normative. A loop takes the coder's state and the bytes, codes or
decodes what it was made for, and says whether all went well.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError

Ints = NDArray[np.int64]
Loop = Callable[[Ints, NDArray[np.uint8]], bool]


@cache
def _coder() -> ModuleType:
    from mcz.codecs.coding import mixing

    return mixing


def bare_state() -> Ints:
    """The state of a coder that codes numbers of even bits alone, with no contexts."""
    return np.zeros(_coder().SQUASH, np.int64)


def code(start: Ints, size: int, loop: Loop, what: str) -> bytes:
    """The bytes that ``loop`` writes from the state ``start``; about ``size`` are expected."""
    while True:
        data, state = np.zeros(size, np.uint8), start.copy()
        _coder().start(state, data, 1)
        if not loop(state, data):
            raise AssertionError(f"{what} has no code")
        used = _coder().finish(state, data)
        if used <= size:
            return data[:used].tobytes()
        size = used + 256


def uncode(stream: bytes, start: Ints, loop: Loop, what: str, *, whole: bool) -> None:
    """Run ``loop`` on ``stream``; ``whole``: all its bytes must be needed.

    Raises FormatError, with ``what`` in front, where it is no code or has other bytes.
    """
    data = np.frombuffer(stream, np.uint8).copy()  # compiled once: for writable bytes
    state = start.copy()
    _coder().start(state, data, 0)
    if not loop(state, data):
        raise FormatError(f"{what} is out of range")
    if whole and _coder().coded_size(state) != len(data):  # RANGE-04
        raise FormatError(f"{what}: a stream of {len(data)} bytes takes another number")


def scale_of(halves: int) -> int:
    """The scale that half octaves stand for, about 2^(h / 2)."""
    return (2 + (halves & 1)) << (halves >> 1) >> 1


def halves_of(typical: float, most: int) -> int:
    """The half octaves, at most ``most``, of the least scale that is at least ``typical``."""
    return next((h for h in range(most) if scale_of(h) >= typical), most)
