"""Kernels: hot loops in Python, compiled by Cython when the package is built.

A kernel is a function of numbers, arrays and NamedTuples of both (``types``), with all functions
that it calls. The build declares their types in C and compiles them (``tools/kernels``); the same
source runs as plain Python, 50 to 500 times slower, if nothing was compiled or a source has
changed since. SPEC.md's integers are of 64 bits and wrap around; Python's do not, and no kernel
relies on more.

``MCZ_LOOPS`` in the environment chooses: ``compiled``; ``checked``, compiled with an IndexError for
an index out of range, for tests; ``sanitized``, for fuzzing; ``interpreted``, plain Python.
"""

from __future__ import annotations

import hashlib
import os
import struct
import warnings
from collections.abc import Callable
from functools import cache, wraps
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from threading import RLock
from types import ModuleType
from typing import TYPE_CHECKING, ParamSpec, TypeVar, cast

from mcz.kernels.units import UNIT_OF

if TYPE_CHECKING:
    from mcz.kernels.types import Bytes

P = ParamSpec("P")
T = TypeVar("T")

MODES = COMPILED, CHECKED, SANITIZED, INTERPRETED = (
    "compiled",
    "checked",
    "sanitized",
    "interpreted",
)
MODE = os.environ.get("MCZ_LOOPS") or COMPILED
if MODE not in MODES:
    raise ValueError(f"MCZ_LOOPS={MODE}: one of {', '.join(MODES)}")
PACKAGE = Path(__file__).parents[1]
_LOADING = RLock()
SPARE = 7  # bytes that ``eight_bytes`` reads, and ``put_eight_bytes`` writes, beyond one
SLOW = "kernels run as plain Python, 50 to 500 times slower: "


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """``function`` as Python calls it, compiled if possible; the first call loads its unit."""
    if MODE == INTERPRETED:
        return _interpreted(function)
    chosen: Callable[P, T] | None = None

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        nonlocal chosen
        if chosen is None:
            chosen = compiled_form(function)
        return chosen(*args, **kwargs)

    return call


def compiled_form(function: Callable[P, T]) -> Callable[P, T]:
    """The compiled form of ``function``; without one, plain Python that warns once."""
    unit, fault = _unit(UNIT_OF[function.__module__])
    name = f"{function.__module__.removeprefix('mcz.').replace('.', '_')}__{function.__name__}"
    compiled = getattr(unit, f"call_{name}", None)
    if compiled is not None:
        return cast(Callable[P, T], compiled)
    if unit is not None:  # it was compiled before the kernel was written, or had another module
        fault = f"{name} is newer than its compiled form; build the kernels again"

    interpret = _interpreted(function)

    def warn_and_interpret(*args: P.args, **kwargs: P.kwargs) -> T:
        _warn(SLOW + fault)
        return interpret(*args, **kwargs)

    return warn_and_interpret


def _interpreted(function: Callable[P, T]) -> Callable[P, T]:
    """``function`` as plain Python, with the silent arithmetic of compiled kernels."""

    @wraps(function)
    def interpret(*args: P.args, **kwargs: P.kwargs) -> T:
        import numpy as np

        with np.errstate(all="ignore"):  # compiled, numbers wrap and overflow silently
            return function(*args, **kwargs)

    return interpret


@cache
def lacks_compiled_kernels() -> bool:
    """Return True if kernels run as plain Python unasked: some callers then use numpy instead."""
    return MODE != INTERPRETED and any(_unit(name)[0] is None for name in set(UNIT_OF.values()))


def _unit(name: str) -> tuple[ModuleType | None, str]:
    with _LOADING:  # of two threads that import a module, one would see half of it
        return _loaded(name)


@cache
def _loaded(name: str) -> tuple[ModuleType | None, str]:
    return load_unit(PACKAGE / "kernels" / MODE, name)


def load_unit(folder: Path, name: str) -> tuple[ModuleType | None, str]:
    """A compiled module, or None and why there is none."""
    files = (folder / (name + suffix) for suffix in EXTENSION_SUFFIXES)
    path = next((file for file in files if file.is_file()), None)
    if path is None:
        return None, "no compiled ones are installed"
    full = f"mcz.kernels.{folder.name}.{name}"
    loader = ExtensionFileLoader(full, str(path))
    spec = spec_from_file_location(full, path, loader=loader)
    assert spec is not None
    try:
        if _is_cut(path):
            raise ImportError("the file is cut")
        module = module_from_spec(spec)
        loader.exec_module(module)
    except ImportError as error:
        return None, f"{path.name} cannot be loaded: {error}"
    changed = changed_source(module.SOURCES)
    if changed:
        return None, f"mcz/{changed} is newer than its compiled form; build the kernels again"
    return module, ""


def _is_cut(path: Path) -> bool:
    """Return True if an ELF file is truncated: the loader would kill the process, not raise."""
    with path.open("rb") as file:
        head = file.read(64)
    if head[:5] != b"\x7fELF\x02" or len(head) < 64:  # other loaders look at the size
        return False
    (start,) = struct.unpack_from("<Q", head, 40)
    size, count = struct.unpack_from("<2H", head, 58)
    return bool(path.stat().st_size < start + size * count)


def changed_source(digests: dict[str, str]) -> str:
    """Return the first source that differs from the compiled one, or "".

    ``digests``: SHA-256 of files in the package. A file that is not there changes nothing.
    """
    for path, digest in digests.items():
        try:
            current = _digest(PACKAGE / path)
        except OSError:
            continue
        if current != digest:
            return path
    return ""


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def _warn(text: str) -> None:
    warnings.warn(text, RuntimeWarning, stacklevel=4)


def bit_length(value: int) -> int:
    """Bits of ``value`` >= 0 without leading zeros."""
    return int(value).bit_length()


def trailing_zeros(value: int) -> int:
    """Zeros below the lowest bit that is set; 64 for 0."""
    return bit_length(value & -value) - 1 if value else 64


def eight_bytes(data: Bytes, at: int) -> int:
    """Eight bytes from ``at`` on, the lowest first; compiled, the highest bit is a sign."""
    return int.from_bytes(data[at : at + 8].tobytes(), "little")


def put_eight_bytes(data: Bytes, at: int, value: int) -> None:
    """Write the lowest 64 bits as eight bytes from ``at`` on, the lowest first."""
    struct.pack_into("<Q", data.data, at, int(value) & (1 << 64) - 1)


def wrapped(value: int) -> int:
    """The lowest 32 bits, with their sign."""
    return ((value + (1 << 31)) & 0xFFFFFFFF) - (1 << 31)


def truncated(value: float) -> int:
    """``int(value)`` for magnitudes below 2^63, but faster."""
    return int(value)
