"""A decoder that breaks one rule of SPEC.md fails vectors that the manifest names for that rule."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from tests.amounts import some
from tests.broken import answers, by_hand, find, marks
from tools import requirements

FOUND = find.read_catches()
PARTS = 8  # of all vectors by which anything is caught
LONG = [pytest.param(part, marks=pytest.mark.long) for part in range(1, PARTS)]
RULES = {rule.id: rule for rule in requirements.rules((marks.ROOT / "SPEC.md").read_text("utf-8"))}


@pytest.fixture(scope="module")
def nursery() -> Iterator[find.Nursery]:
    with find.Nursery() as process:
        yield process


@pytest.mark.parametrize("rule", some(find.rules(), 3))
def test_a_broken_rule_is_caught(rule: str, nursery: find.Nursery) -> None:
    """By what was found before; where the code has changed since, by what is found now."""
    known = FOUND.get(rule, [])
    answer = [find.bites(rule, nursery.ask(rule, c.variant, [c.vector])) for c in known]
    caught = bool(answer) and all(answer)
    assert caught or find.search(nursery, rule, known), (
        f"no vector notices that {rule} is broken at {marks.places().get(rule)}: is its mark where "
        f"it is enforced? Try python -m tests.broken --find {rule}"
    )


@pytest.mark.parametrize("part", [0, *LONG])
def test_without_a_break_nothing_is_caught(part: int, nursery: find.Nursery) -> None:
    """One part shows that the nursery adds no fault; all parts, that no loop has one of its own."""
    vectors = sorted({catch.vector for catches in FOUND.values() for catch in catches})
    assert nursery.ask("", "", vectors[part::PARTS], 10 * find.LONG) is None


def test_what_is_found_is_of_rules_and_their_vectors() -> None:
    """Only a rule that can be seen is in found.txt, and only by vectors that the manifest names."""
    assert FOUND.keys() <= set(find.rules())
    for rule, catches in FOUND.items():
        assert {catch.vector for catch in catches} <= set(answers.of_rules()[rule])


def test_marks_are_rules() -> None:
    unknown = marks.places().keys() - RULES.keys()
    assert not unknown, unknown
    sections = {id_.partition("-")[0] for id_ in RULES}
    for module in marks.modules():
        for line in marks.source(module).splitlines():
            comment = line.partition("# ")[2]
            odd = {f"{a}-{b}" for a, b in re.findall(r"\b([A-Z][A-Z0-9]+)-(\d+)\b", comment)}
            odd = {id_ for id_ in odd if id_.partition("-")[0] in sections} - RULES.keys()
            assert not odd, f"{module}: {odd}"


def test_rules_have_marks() -> None:
    """Each rule with vectors stands in the code where it is enforced, or is broken by hand."""
    there = marks.places().keys() | by_hand.BREAKS.keys()
    binding = {rule.id for rule in RULES.values() if rule.binds}
    lacking = sorted(binding - there)
    print(f"{len(binding & there)} of {len(binding)} rules are marked; not {', '.join(lacking)}")
    assert not answers.of_rules().keys() - there


def test_few_rules_are_broken_by_hand() -> None:
    """Bounds of declared fields aside, whose check is one statement for all of them."""
    table = (marks.ROOT / "tests" / "broken" / "by_hand.txt").read_text("utf-8")
    declared = table.count("- if not self.test(obj")
    assert len(by_hand.BREAKS) + len(by_hand.CRASH) - declared <= 60
