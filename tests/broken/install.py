"""Changed code into this process: into modules that are there, or into the import of them."""

from __future__ import annotations

import gc
import importlib
import inspect
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, FunctionType, ModuleType

from tests.broken.marks import modules
from tests.broken.variants import whole

Live = dict[CodeType, list[FunctionType]]


class _Loader(SourceFileLoader):
    """Loads a module from its changed code."""

    changed: CodeType

    def get_code(self, fullname: str) -> CodeType:
        return self.changed


class _Finder(MetaPathFinder):
    def __init__(self, codes: Mapping[str, CodeType]) -> None:
        self.codes = codes

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(fullname, path) if fullname in self.codes else None
        if spec is None or spec.origin is None:
            return None
        loader = _Loader(fullname, spec.origin)
        loader.changed = self.codes[fullname]
        spec.loader = loader
        return spec


def install(codes: Mapping[str, CodeType], *, loops: str = "interpreted") -> None:
    """Have modules of mcz imported as ``codes``; those that are there are forgotten.

    What is compiled is looked up by the source of modules, which does not change: ``loops`` may be
    "checked" only where none of ``codes`` has loops.
    """
    for name in [name for name in sys.modules if name.partition(".")[0] == "mcz"]:
        del sys.modules[name]
    os.environ["MCZ_LOOPS"] = loops
    sys.meta_path.insert(0, _Finder(codes))
    forget_known_answers()


def forget_known_answers() -> None:
    """Leave it to vectors to notice what is broken: the first decode would refuse it by itself."""
    importlib.import_module("mcz.codecs.known_answers").known_answers().clear()


def live() -> Live:
    """All functions of mcz that are there, by their code."""
    functions: Live = {}
    for thing in gc.get_objects():
        if isinstance(thing, FunctionType) and thing.__module__ in modules():
            functions.setdefault(thing.__code__, []).append(thing)
    return functions


def swap(codes: Mapping[str, CodeType], functions: Live) -> bool:
    """Give functions that are there their changed code; False where more than functions changed.

    Many times faster than an import, and of no effect on what was called while importing.
    """
    pairs = []
    for module, code in codes.items():
        found = _pairs(whole(module), code)
        if found is None:
            return False
        pairs += found
    for old, new in pairs:
        for function in functions.get(old, []):
            if len(function.__closure__ or ()) != len(new.co_freevars):
                return False
            function.__code__ = new
    return bool(pairs)


def _pairs(old: CodeType, new: CodeType) -> list[tuple[CodeType, CodeType]] | None:
    """(before, after) of each function that has changed; None if what runs on import has."""
    if _own(old) != _own(new):
        return None
    pairs = []
    for a, b in zip(_inner(old), _inner(new), strict=True):
        if a == b:
            continue
        if not a.co_flags & inspect.CO_OPTIMIZED:  # the body of a class
            inner = _pairs(a, b)
            if inner is None:
                return None
            pairs += inner
        elif a.co_name.startswith("<") and a.co_name != "<lambda>":  # a loop that runs on import
            return None
        else:
            pairs += _below(a, b)
    return pairs


def _below(old: CodeType, new: CodeType) -> list[tuple[CodeType, CodeType]]:
    """A function and, as far as they are the same in number, those within it."""
    pairs = [(old, new)]
    inner = _inner(old), _inner(new)
    if len(inner[0]) == len(inner[1]):
        for a, b in zip(*inner, strict=True):
            if a != b:
                pairs += _below(a, b)
    return pairs


def _inner(code: CodeType) -> list[CodeType]:
    return [const for const in code.co_consts if isinstance(const, CodeType)]


def _own(code: CodeType) -> tuple[object, ...]:
    """Key of a module's or class's own code, without its functions."""
    consts = [
        (c.co_qualname, c.co_firstlineno) if isinstance(c, CodeType) else (type(c), repr(c))
        for c in code.co_consts
    ]
    return code.co_code, code.co_names, code.co_exceptiontable, consts
