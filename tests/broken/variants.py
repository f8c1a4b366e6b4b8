"""The ways in which one rule may be broken, by name, and what each makes of the modules.

``2.off.1`` is the first change of the operator ``off`` at the second marked place of the rule;
``1.off.1+2.drop.2`` are two changes at once, for a rule that stands in two places; ``hand.1`` is
the first break of the rule in by_hand.py.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable
from functools import cache
from itertools import product
from types import CodeType

from tests.broken import by_hand
from tests.broken.changes import OPERATORS, changes
from tests.broken.marks import Slot, modules, parse_module, places, places_in, source, targets

ALL = "all"  # places at once
HAND = "hand"
CHECKS = ("off", "unchecked", "drop", "out")  # operators that may have to go at all places at once
MOST = 64  # changes of all places at once


class StaleError(Exception):
    """There is no such variant: the code or its marks have changed."""


def names(rule: str) -> list[str]:
    """The variants of ``rule``: by hand, or by operator, those of all its places last."""
    if rule in by_hand.BREAKS:
        return [f"{HAND}.{number + 1}" for number in range(len(by_hand.BREAKS[rule]))]
    variants: list[str] = []
    checks: list[list[str]] = []
    there = places().get(rule, ())
    for number, place in enumerate(there, 1):
        tree = parse_module(place.module)
        counts = Counter(name for name, _, _ in changes(targets(tree, place.line)))
        own = [f"{number}.{name}.{i + 1}" for name in counts for i in range(counts[name])]
        checks.append([name for name in own if _operator(name) in CHECKS])
        variants += own
    variants.sort(key=lambda name: list(OPERATORS).index(_operator(name)))
    if len(there) < 2 or not all(checks):
        return variants
    each = max(1, int(MOST ** (1 / len(there))))
    return variants + ["+".join(row) for row in product(*(own[:each] for own in checks))]


def place_of(name: str) -> str:
    return ALL if "+" in name else name.partition(".")[0]


def _operator(name: str) -> str:
    return name.split(".")[1]


def codes(rule: str, name: str) -> dict[str, CodeType]:
    """The modules that variant ``name`` of ``rule`` changes, compiled."""
    trees: dict[str, ast.Module] = {}
    there = places().get(rule, ())
    if name.startswith(HAND):
        broken = by_hand.BREAKS[rule][int(name.partition(".")[2]) - 1]
        texts = _patch_sources(rule, broken.patches)
        trees = {module: ast.parse(text) for module, text in texts.items()}
        now = {place.module: source(place.module) for place in there} | texts
        there = tuple(places_in(rule, now))
        name = broken.variant
    edits = []
    for one in name.split("+") if name else ():
        number, operator, ordinal = one.split(".")
        if int(number) > len(there):
            raise StaleError(f"{rule} has no place {number}")
        place = there[int(number) - 1]
        tree = trees.setdefault(place.module, parse_module(place.module))
        edits.append(_edit(tree, place.line, operator, int(ordinal)))
    before = [slot.node for slot, _ in edits]
    for slot, node in edits:
        node = ast.copy_location(node, slot.node)
        slot.put(ast.fix_missing_locations(node))
    try:
        return {module: compile_module(module, tree) for module, tree in trees.items()}
    finally:
        for (slot, _), node in zip(edits, before, strict=True):
            slot.put(node)


def compile_module(module: str, tree: ast.Module) -> CodeType:
    return compile(tree, str(modules()[module]), "exec", dont_inherit=True)


@cache
def whole(module: str) -> CodeType:
    """Compile a module unchanged."""
    return compile_module(module, parse_module(module))


def _edit(tree: ast.Module, line: int, operator: str, ordinal: int) -> tuple[Slot, ast.AST]:
    rows = [(slot, node) for _, slot, node in changes(targets(tree, line), [operator])]
    if len(rows) < ordinal:
        raise StaleError(f"line {line} has no {operator}.{ordinal}")
    return rows[ordinal - 1]


def _patch_sources(rule: str, patches: Iterable[by_hand.Patch]) -> dict[str, str]:
    """The sources that have the texts of ``patches``, each of which stands in one of them once."""
    texts: dict[str, str] = {}
    for old, new in patches:
        counts = {module: texts.get(module, source(module)).count(old) for module in modules()}
        where = [module for module in counts if counts[module]]
        if sum(counts.values()) != 1:
            raise StaleError(f"{rule}: not once, but in {where}: {old}")
        texts[where[0]] = texts.get(where[0], source(where[0])).replace(old, new)
    return texts
