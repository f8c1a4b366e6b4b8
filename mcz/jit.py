"""``kernel``: the one way in which this package compiles a loop.

Modules that import this one hold loops only and are themselves imported on first use, because
numba costs more than half a second.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
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
        _watch(compiled)
    except RuntimeError:  # numba finds no folder for its cache, and says so right here
        compiled = njit(nogil=True, error_model="numpy")(function)
    return cast(Loop, compiled)


def _watch(compiled: Any) -> None:
    """Let the cache of ``compiled`` end with a change of any shared loop, not of its own file only.

    numba looks at one file alone, so that a kernel would go on with old copies of what it calls.
    """
    files = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if files is not None:  # absent where compiling is switched off
        files._source_stamp = (files._source_stamp, _shared_stamp())


@cache
def _shared_stamp() -> tuple[tuple[str, int, int], ...]:
    """Name, time and size of every file of loops that others are compiled with."""
    package = Path(__file__).parent
    files = sorted([*package.glob("coding/*.py"), *package.glob("codecs/_*_kernels.py")])
    return tuple((file.name, file.stat().st_mtime_ns, file.stat().st_size) for file in files)


def inner(function: Loop) -> Loop:
    """``function`` compiled into the kernels of its module that call it, never called by itself."""
    return cast(Loop, njit(**_INNER)(function))
