"""The source text of loops: what is compiled, and what tells whether machine code is of it."""

from __future__ import annotations

import ast
import hashlib
import sys
from functools import cache
from types import FunctionType, ModuleType
from typing import Any

from mcz.jit.types import constant


@cache
def text_of(module: str) -> str:
    """The source of a module that is imported; raises OSError where there is none."""
    loader: Any = sys.modules[module].__loader__
    text = loader.get_source(module) if hasattr(loader, "get_source") else None
    if text is None:
        raise OSError(f"{module} has no source text")
    return str(text)


@cache
def _definitions(module: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse(text_of(module))
    return {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}


def definition_of(function: FunctionType) -> ast.FunctionDef:
    """The syntax tree of a function, which stands in its module outside of all others."""
    return _definitions(function.__module__)[function.__name__]


def digest_of(function: FunctionType) -> bytes:
    """Of all that a loop is compiled from: its module, and those that its loops come from."""
    found = hashlib.sha256()
    for name in sorted(_modules_of(function.__module__)):
        found.update(_digest(name))
    return found.digest()


def _modules_of(first: str) -> set[str]:
    """Names of the module and of all whose loops and numbers it can use."""
    packages = {"mcz", first.partition(".")[0]}
    found, left = {first}, [first]
    while left:
        for value in list(vars(sys.modules[left.pop()]).values()):
            name = _home_of(value)
            if name.partition(".")[0] in packages and name not in found:
                found.add(name)
                left.append(name)
    return found


def _home_of(value: Any) -> str:
    """The module that a loop comes from, or the module that it is; "" for anything else."""
    value = getattr(value, "loop", value)
    if isinstance(value, ModuleType):
        return value.__name__
    return str(value.__module__) if getattr(value, "__is_loop__", False) else ""


@cache
def _digest(module: str) -> bytes:
    """Of the source of a module, and of the numbers that it knows, which may come from others."""
    names = vars(sys.modules[module])
    numbers = {name: value for name, value in names.items() if constant(value) is not None}
    stated = f"{text_of(module)}\0{sorted(numbers.items())!r}"
    return hashlib.sha256(stated.encode()).digest()
