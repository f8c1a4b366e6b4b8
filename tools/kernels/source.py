"""A module of kernels, read without importing it: its functions, NamedTuples and constants."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from tools.kernels.annotations import KernelError, Record, Type, simple_type

ROOT = Path(__file__).parents[2]
DECORATOR = "kernel"  # of functions that Python calls


@cache
def source(name: str) -> Source:
    """The module ``name``; each is read once."""
    return Source(name)


def path_of(name: str) -> Path | None:
    """The file of a module, or None where there is none."""
    path = ROOT.joinpath(*name.split("."))
    files = path.with_suffix(".py"), path / "__init__.py"
    return next((file for file in files if file.is_file()), None)


class Source:
    """The functions and names of one module."""

    def __init__(self, name: str) -> None:
        path = path_of(name)
        if path is None:
            raise KernelError(f"there is no module {name}")
        self.name, self.path = name, path
        self.tree = ast.parse(path.read_bytes())
        self.functions = {n.name: n for n in self.tree.body if isinstance(n, ast.FunctionDef)}
        self.classes = {n.name: n for n in self.tree.body if isinstance(n, ast.ClassDef)}
        self.imported: dict[str, tuple[str, str]] = {}  # name here: module, name there or nothing
        for node in self.tree.body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "mcz":
                for alias in node.names:
                    self._import(alias.asname or alias.name, node.module or "", alias.name)
        self.needed: set[str] = set()  # modules that its constants come from
        self._constants: dict[str, Any] | None = None

    def _import(self, name: str, module: str, original: str) -> None:
        is_module = path_of(f"{module}.{original}") is not None
        self.imported[name] = (f"{module}.{original}", "") if is_module else (module, original)

    def is_entry(self, name: str) -> bool:
        """True if Python calls a function of this module."""
        decorators = self.functions[name].decorator_list
        return any(isinstance(n, ast.Name) and n.id == DECORATOR for n in decorators)

    def find(self, name: str) -> tuple[Source, str] | None:
        """The module that defines a name that is used here, and its name there."""
        if name not in self.imported:
            return self, name
        module, original = self.imported[name]
        return source(module).find(original) if original else None

    def find_in(self, alias: str, name: str) -> tuple[Source, str] | None:
        """The same of ``alias.name``, where ``alias`` is an imported module."""
        module, original = self.imported.get(alias, ("", "other"))
        return None if original else source(module).find(name)

    def type_of(self, node: ast.expr) -> Type:
        """The type that an annotation of this module names."""
        found = simple_type(node)
        if found is not None:
            return found
        place = self.find(node.id) if isinstance(node, ast.Name) else None
        if place is not None:
            where, name = place
            if name in where.classes:
                return where.record(name)
            for statement in where.tree.body:  # an alias
                if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == name:
                    return where.type_of(statement.value)
        raise KernelError(f"{self.name}: no kernel has a {ast.unparse(node)}")

    def record(self, name: str) -> Record:
        """A NamedTuple of this module."""
        fields = [
            (ast.unparse(n.target), self.type_of(n.annotation))
            for n in self.classes[name].body
            if isinstance(n, ast.AnnAssign)
        ]
        return Record(mangle_name(self.name, name), self.name, tuple(fields))

    def constant(self, name: str) -> Any:
        """The number, or tuple of numbers, that a name stands for here, or None."""
        place = self.find(name)
        return None if place is None else place[0].constants.get(place[1])

    @property
    def constants(self) -> dict[str, Any]:
        """Numbers, and tuples of numbers, that this module assigns to names."""
        if self._constants is None:
            self._constants = {}  # of modules that import each other
            names: dict[str, Any] = {}
            for node in self.tree.body:
                if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
                    self._evaluate(node, node.value, names)
            self._constants = {name: value for name, value in names.items() if is_constant(value)}
        return self._constants

    def _evaluate(self, node: ast.stmt, value: ast.expr, names: dict[str, Any]) -> None:
        """Add what an assignment of the module assigns to ``names``, if that is a constant."""
        known = dict(names)
        used = {n.id for n in ast.walk(value) if isinstance(n, ast.Name)} & self.imported.keys()
        for name in used:
            module, original = self.imported[name]
            there = source(module)
            known[name] = (
                there.constant(original) if original else SimpleNamespace(**there.constants)
            )
        try:
            exec(compile(ast.Module([node], []), str(self.path), "exec"), known)
        except Exception:  # no constant: an array, a table, an alias of a type
            return
        found = {name: known[name] for name in known.keys() - names.keys() - used}
        if any(is_constant(item) for item in found.values()):
            self.needed |= {self.imported[name][0] for name in used}
        names.update((name, item) for name, item in found.items() if name != "__builtins__")


def sources_behind(modules: Iterable[str]) -> list[Source]:
    """These modules, and those that their constants come from."""
    found: dict[str, Source] = {}
    rest = list(modules)
    while rest:
        name = rest.pop()
        if name not in found:
            found[name] = source(name)
            found[name].constants  # noqa: B018 - finds what they need
            rest += found[name].needed
    return [found[name] for name in sorted(found)]


def is_constant(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(is_constant, value))
    return isinstance(value, bool | int | float | str)


def mangle_name(module: str, name: str) -> str:
    """A name for all of a unit."""
    return f"{module.removeprefix('mcz.').replace('.', '_')}__{name}"
