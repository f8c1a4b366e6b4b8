"""``kernel``: the one way in which this package compiles a loop.

Modules that import this one hold loops only and are themselves imported on first use, because
numba costs more than half a second.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

# Wrappers that nobody calls would cost half of the time of compiling.
_INNER: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}

Loop = TypeVar("Loop", bound=Callable[..., object])


def kernel(function: Loop) -> Loop:
    """``function`` compiled on its first call, cached on disk where a folder is writable."""
    try:
        compiled = njit(cache=True, nogil=True, error_model="numpy")(function)
    except RuntimeError:  # numba finds no folder for its cache, and says so right here
        compiled = njit(nogil=True, error_model="numpy")(function)
    return cast(Loop, compiled)


def inner(function: Loop) -> Loop:
    """``function`` compiled into the kernels of its module that call it, never called by itself."""
    return cast(Loop, njit(**_INNER)(function))
