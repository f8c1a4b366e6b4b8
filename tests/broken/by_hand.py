"""Breaks of by_hand.txt, of rules for which no change of a marked statement will do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

# Of these only a crash can be seen: what the rule keeps out leads beyond the ends of what is there.
CRASH = frozenset(
    "AMC-03 C3D-02 CHUNK-05 FRAME-02 LIMIT-02 NOTES-03 ONLINE-02 PACK-13 RESID-02 SRC-08 "
    "SRC-11".split()
)

# Of these the vector is large, and what is broken is no loop: loops are compiled, with checks.
LARGE = frozenset("LIMIT-05 LIMIT-10 WIND-17".split())


@dataclass(frozen=True)
class Break:
    """One way to break a rule: a variant of its marked places, and (old, new) texts."""

    variant: str
    patches: tuple[tuple[str, str], ...]


def parse_breaks(text: str) -> dict[str, list[Break]]:
    """The breaks of each rule, from the blocks of by_hand.txt behind the words at its head."""
    breaks: dict[str, list[Break]] = {}
    for block in text.strip().split("\n\n")[2:]:
        head, *lines = block.splitlines()
        rule, _, variant = head.partition(" ")
        patches: list[tuple[list[str], list[str]]] = []
        before = "+"
        for line in lines:
            if line[0] == "-" and before == "+":
                patches.append(([], []))
            before = line[0]
            patches[-1][before == "+"].append(line[2:])
        texts = (("\n".join(old), "\n".join(new)) for old, new in patches)
        breaks.setdefault(rule, []).append(Break(variant, tuple(texts)))
    return breaks


BREAKS = parse_breaks(Path(__file__).with_suffix(".txt").read_text("utf-8"))
