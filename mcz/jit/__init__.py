"""Loops in Python, compiled to machine code: ``kernel`` for those that are called from outside.

A loop is a function of numbers, arrays and tuples of numbers, written in a small part of Python
that reads the same in any language: see ``expressions``, ``statements`` and ``calls``. It is
compiled by LLVM on its first call, and its machine code is kept in a folder (``store``), from which
the next process takes it while no source has changed. The same source runs, slowly, as plain
Python.

Without llvmlite loops run as plain Python, too, and say so once. What is read most has a way of its
own for that, see ``lacks_compiler``.

The environment says how loops run: ``MCZ_LOOPS=interpreted`` as plain Python; ``checked`` compiled,
with an IndexError for an index out of range; otherwise compiled.

Why not numba: it takes 0.3 s to import and half a second for each function, nearly all of it before
LLVM begins, so that the first use of a codec took up to 38 s.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

from mcz.jit.functions import bit_length as bit_length
from mcz.jit.functions import truncated as truncated

Loop = TypeVar("Loop", bound=Callable[..., object])

MODES = COMPILED, CHECKED, INTERPRETED = "compiled", "checked", "interpreted"
MODE = os.environ.get("MCZ_LOOPS") or COMPILED
if MODE not in MODES:
    raise ValueError(f"MCZ_LOOPS={MODE}: one of {', '.join(MODES)}")


def kernel(function: Loop) -> Loop:
    """``function``, to be called from Python: compiled on its first call."""
    function = inner(function)
    if MODE == INTERPRETED:
        return function
    from mcz.jit.calling import Kernel

    return cast(Loop, Kernel(cast(Any, function), checked=MODE == CHECKED))


def lacks_compiler() -> bool:
    """Whether loops that are to be compiled cannot be: then some work has a quicker way in Python.

    Not where loops are said to be interpreted, which is how their source is tested.
    """
    if MODE == INTERPRETED:
        return False
    from mcz.jit.calling import missing_compiler

    return bool(missing_compiler())


def inner(function: Loop) -> Loop:
    """``function``, to be called by other loops: compiled with each kernel that needs it."""
    function.__is_loop__ = True  # type: ignore[attr-defined]
    return function


def inlined(function: Loop) -> Loop:
    """``inner``, compiled into its callers whatever its size: for what is done once a value."""
    function.__is_inlined__ = True  # type: ignore[attr-defined]
    return inner(function)
