"""Marks of SPEC.md's rules in the code: comments such as ``# CHUNK-06`` beside the check.

A mark ends the line of the statement or expression that enforces the rule, or stands on the line
before. It is ids alone, or the ids in brackets behind the words of a comment.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
_IDS = r"([A-Z][A-Z0-9]*-\d\d(?:, [A-Z][A-Z0-9]*-\d\d)*)"
MARK = re.compile(rf"# {_IDS}|#.*\({_IDS}\)")
_BLANK = (tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.COMMENT)


@dataclass(frozen=True, order=True)
class Place:
    """A line of code with a mark."""

    module: str
    line: int


@dataclass(frozen=True)
class Slot:
    """Place of a node in its tree: a field of another node, or an item of such a field."""

    holder: ast.AST
    field: str
    index: int | None

    @property
    def node(self) -> ast.AST:
        value = getattr(self.holder, self.field)
        child: ast.AST = value if self.index is None else value[self.index]
        return child

    def put(self, node: ast.AST) -> None:
        if self.index is None:
            setattr(self.holder, self.field, node)
        else:
            getattr(self.holder, self.field)[self.index] = node


@cache
def modules() -> dict[str, Path]:
    """The files of the package by the names of their modules."""
    files = sorted((ROOT / "mcz").rglob("*.py"))
    names = (file.relative_to(ROOT).with_suffix("").as_posix() for file in files)
    return {
        name.removesuffix("/__init__").replace("/", "."): file
        for name, file in zip(names, files, strict=True)
    }


@cache
def source(module: str) -> str:
    return modules()[module].read_text("utf-8")


@cache
def parse_module(module: str) -> ast.Module:
    return ast.parse(source(module))


def marks(text: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """(line of the code that is meant, ids) of each mark of a source."""
    if not MARK.search(text):
        return
    waiting: list[str] = []
    code = 0  # the last line with code
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and (match := MARK.fullmatch(token.string)):
            ids = (match[1] or match[2]).split(", ")
            if token.start[0] == code:
                yield code, tuple(ids)
            else:
                waiting += ids
        elif token.type not in _BLANK:
            if waiting:
                yield token.start[0], tuple(waiting)
                waiting = []
            code = token.end[0]


@cache
def places() -> dict[str, tuple[Place, ...]]:
    """The marked places of each rule, in the order of modules and lines."""
    places_by_rule: dict[str, set[Place]] = {}
    for module in modules():
        for line, ids in marks(source(module)):
            for id_ in ids:
                places_by_rule.setdefault(id_, set()).add(Place(module, line))
    return {id_: tuple(sorted(set_)) for id_, set_ in sorted(places_by_rule.items())}


def places_in(rule: str, texts: Mapping[str, str]) -> list[Place]:
    """The places of ``rule`` in modules with these sources."""
    lines = ((module, *row) for module, text in texts.items() for row in marks(text))
    return sorted({Place(module, line) for module, line, ids in lines if rule in ids})


def slots(node: ast.AST) -> Iterator[Slot]:
    """The slots of the children of ``node``."""
    for field, value in ast.iter_fields(node):
        if isinstance(value, ast.AST):
            yield Slot(node, field, None)
        elif isinstance(value, list):
            yield from (Slot(node, field, i) for i, h in enumerate(value) if isinstance(h, ast.AST))


def targets(tree: ast.Module, line: int) -> list[Slot]:
    """Slots that a mark at ``line`` refers to: the statement that begins there, else expressions.

    If none begins there, it is the smallest expression that contains the line.
    """
    slots_here = list(_slots_at(tree, line))
    statements = [slot for slot in slots_here if isinstance(slot.node, ast.stmt)]
    return statements or slots_here or [_smallest(tree, line)]


def _slots_at(node: ast.AST, line: int) -> Iterator[Slot]:
    for slot in slots(node):
        if getattr(slot.node, "lineno", None) == line:
            yield slot
        else:
            yield from _slots_at(slot.node, line)


def _smallest(tree: ast.Module, line: int) -> Slot:
    smallest: Slot | None = None
    node: ast.AST = tree
    while True:
        inner = [s for s in slots(node) if _spans(s.node, line)]
        if not inner:
            assert smallest is not None, f"a mark of nothing at line {line}"
            return smallest
        smallest = inner[-1]
        node = smallest.node


def _spans(node: ast.AST, line: int) -> bool:
    end = getattr(node, "end_lineno", None)
    return end is not None and getattr(node, "lineno", line + 1) <= line <= end
