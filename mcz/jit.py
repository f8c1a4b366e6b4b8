"""``kernel``: the one way in which this package compiles a loop.

Modules that import this one hold loops only and are themselves imported on first use, because
numba costs more than half a second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Loop = TypeVar("Loop", bound=Callable[..., object])


def kernel(function: Loop) -> Loop:
    """``function`` compiled on its first call, cached on disk where a folder is writable."""
    try:
        compiled = njit(cache=True, nogil=True)(function)
    except RuntimeError:  # numba finds no folder for its cache, and says so right here
        compiled = njit(nogil=True)(function)
    return cast(Loop, compiled)
