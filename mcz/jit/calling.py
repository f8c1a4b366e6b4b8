"""A kernel as Python calls it: its arguments told apart, its machine code found or made."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import mmap
import operator
import threading
import warnings
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from mcz.jit import store
from mcz.jit.sources import digest_of
from mcz.jit.types import BOOL, FLOAT, INT, ITEMS, Array, Scalar, Tuple, Type

ITEM_OF = {np.dtype(item): item for item in ITEMS}
DECLARED: dict[str, Scalar] = {"int": INT, "float": FLOAT, "bool": BOOL}
_LOCK = threading.Lock()  # one thread compiles


class Kernel:
    """A loop that is compiled for each kind of arguments that it is called with."""

    def __init__(self, function: FunctionType, *, checked: bool) -> None:
        functools.update_wrapper(self, function)
        self.loop = function
        self.checked = checked
        names = function.__code__.co_varnames[: function.__code__.co_argcount]
        self._declared = [DECLARED.get(function.__annotations__.get(name, "")) for name in names]
        self._compiled: dict[tuple[Any, ...], _Compiled] = {}

    def __call__(self, *arguments: Any) -> Any:
        flat: list[Any] = []
        kinds: list[Any] = []
        _spread(arguments, self._declared, flat, kinds)
        compiled = self._compiled.get(tuple(kinds))
        if compiled is None:
            if not _has_compiler():
                with np.errstate(all="ignore"):  # compiled, numbers wrap and overflow silently
                    return self.loop(*arguments)
            compiled = self._compile(tuple(kinds), arguments)
        return compiled(flat)

    def _compile(self, kinds: tuple[Any, ...], arguments: tuple[Any, ...]) -> _Compiled:
        if len(arguments) != len(self._declared):
            raise TypeError(f"{self.loop.__name__} takes {len(self._declared)} arguments")
        types = tuple(map(_type_of, arguments, self._declared))
        with _LOCK:
            if kinds not in self._compiled:
                self._compiled[kinds] = _Compiled(self.loop, types, self.checked)
            return self._compiled[kinds]


def _has_compiler() -> bool:
    """Whether there is one; says once where there is none."""
    fault = missing_compiler()
    if fault:
        _warn(fault)
    return not fault


@cache
def missing_compiler() -> str:
    """Why there is no compiler, or nothing where there is one."""
    try:
        import llvmlite.binding  # noqa: F401
    except (ImportError, OSError) as error:
        if lacks_memory_for_compiler():
            raise MemoryError("the compiler of loops cannot be loaded") from None
        return str(error)
    return ""


@cache
def _warn(fault: str) -> None:
    warnings.warn(f"loops run as plain Python, very slowly: {fault}", RuntimeWarning, stacklevel=4)


def lacks_memory_for_compiler() -> bool:
    """Whether the process may not have the memory that LLVM's library takes: without it loops would
    run for minutes that take a moment."""
    found = find_spec("llvmlite")
    folders = found.submodule_search_locations or [] if found else []
    libraries = [path for folder in folders for path in Path(folder, "binding").glob("*llvmlite.*")]
    try:
        for path in libraries:
            mmap.mmap(-1, path.stat().st_size).close()
    except OSError:
        return True
    return False


def _spread(
    arguments: tuple[Any, ...], declared: list[Scalar | None], flat: list[Any], kinds: list[Any]
) -> None:
    """Add to ``flat`` what the machine gets of arguments, to ``kinds`` what tells them apart.

    In the place of an array goes what ``_address`` says, then its lengths and its strides.
    """
    for argument, scalar in zip(arguments, declared, strict=False):
        if isinstance(argument, np.ndarray):
            shape, flags = argument.shape, argument.flags.num & SOUND
            kinds.append((argument.dtype, len(shape), flags))
            flat.append(_address(argument))
            flat += shape
            if flags != SOUND:
                flat += [stride // argument.itemsize for stride in argument.strides]
            elif len(shape) > 1:
                flat += _strides(shape)
        elif isinstance(argument, tuple):
            kinds.append(type(argument))
            _spread(argument, _declared_items(type(argument), len(argument))[1], flat, kinds)
            kinds.append(None)
        else:
            kind = scalar or _kind_of(argument)
            kinds.append(kind.name)
            flat.append(_number(argument, kind))


CONTIGUOUS, ALIGNED = 0x1, 0x100
SOUND = CONTIGUOUS | ALIGNED  # of the flags of an array
HEAD = object.__basicsize__  # what each object has in front of what is its own


def _address(argument: Any) -> int:
    """Where the items of an array lie: the first field of its record, as NumPy's C API has it.

    ``argument.ctypes.data`` is the same and takes as long as all else of a call.
    """
    found = ctypes.c_void_p.from_address(id(argument) + HEAD).value
    return found or 0


if _address(HEADED := np.arange(3)) != HEADED.ctypes.data:  # another Python or another NumPy

    def _address(argument: Any) -> int:
        return int(argument.ctypes.data)


def _strides(shape: tuple[int, ...]) -> list[int]:
    """How far apart the items of each axis but the last are, where nothing lies between."""
    strides = [shape[-1]]
    for length in shape[-2:0:-1]:
        strides.insert(0, strides[0] * length)
    return strides


def _number(argument: Any, kind: Scalar) -> Any:
    if kind is FLOAT:
        return float(argument)
    if kind is BOOL:
        return bool(argument)
    number = operator.index(argument)
    if not LEAST <= number <= GREATEST:
        raise OverflowError(f"{number} has more than 64 bits")
    return number


LEAST, GREATEST = -(1 << 63), (1 << 63) - 1


def _kind_of(number: Any) -> Scalar:
    """What a number is that no annotation tells of."""
    if isinstance(number, float):
        return FLOAT
    return BOOL if isinstance(number, bool) else INT


def _type_of(argument: Any, declared: Scalar | None) -> Type:
    if isinstance(argument, np.ndarray):
        if argument.dtype not in ITEM_OF or not argument.flags.aligned:
            raise TypeError(f"a loop has no arrays of {argument.dtype}")
        return Array(ITEM_OF[argument.dtype], argument.ndim, bool(argument.flags.c_contiguous))
    if isinstance(argument, tuple):
        names, items = _declared_items(type(argument), len(argument))
        return Tuple(tuple(map(_type_of, argument, items)), names)
    return declared or _kind_of(argument)


@cache
def _declared_items(kind: type, n_items: int) -> tuple[tuple[str, ...], list[Scalar | None]]:
    """The names of a NamedTuple's items and the numbers that some are; none of a plain tuple."""
    names: tuple[str, ...] = getattr(kind, "_fields", ())
    stated = [kind.__annotations__[name] for name in names] or [""] * n_items
    return names, [DECLARED.get(getattr(item, "__forward_arg__", item)) for item in stated]


class _Compiled:
    """Machine code for one kind of arguments."""

    def __init__(self, function: FunctionType, types: tuple[Type, ...], checked: bool) -> None:
        from mcz.jit import machine

        self.function, self.checked = function, checked
        name = _name_of(function, types, checked)
        found = store.load(name)
        kind, code = found.split(b"\0", 1) if found else (None, b"")
        if kind is None:
            from mcz.jit.program import assembly

            text, result = assembly(function, types, name, checked=checked)
            kind, code = _spelled(result), machine.compile_assembly(text)
            store.save(name, kind + b"\0" + code)
        self.results = kind.decode().split(" ") if kind else []
        self.is_tuple = self.results[:1] == ["tuple"]
        self.results = self.results[self.is_tuple :]
        address = machine.load(code, name)
        parameters = ["ptr"] * (checked + self.is_tuple)
        parameters += [part for type_ in types for part in type_.parts()]
        returned = self.results[0] if self.results and not self.is_tuple else None
        self.call = machine.function_at(address, returned, parameters)

    def __call__(self, flat: list[Any]) -> Any:
        if not self.is_tuple and not self.checked:
            return self.call(*flat)
        results, line = np.zeros(len(self.results), np.int64), ctypes.c_int64()
        hidden: list[Any] = [ctypes.byref(line)] if self.checked else []
        hidden += [results.ctypes.data] if self.is_tuple else []
        found = self.call(*hidden, *flat)
        if line.value:
            raise IndexError(f"{self.function.__module__}, line {line.value}: out of range")
        if not self.is_tuple:
            return found
        floats = results.view(np.float64)
        return tuple(
            float(floats[n]) if kind == "double" else int(results[n])
            for n, kind in enumerate(self.results)
        )


def _spelled(result: Type) -> bytes:
    parts = result.parts()
    return " ".join(["tuple", *parts] if isinstance(result, Tuple) and parts else parts).encode()


def _name_of(function: FunctionType, types: tuple[Type, ...], checked: bool) -> str:
    """A name for machine code, which says all that it depends on."""
    from mcz.jit import machine

    stated = f"{machine.identity()}\0{types!r}\0{checked}\0{function.__qualname__}".encode()
    digest = hashlib.sha256(_own_digest() + digest_of(function) + stated).hexdigest()
    return f"{function.__name__}-{digest[:32]}"


@cache
def _own_digest() -> bytes:
    """Of the compiler's own sources."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).digest()
