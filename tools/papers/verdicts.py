"""Verdict on a claim of a paper, in a word."""

from __future__ import annotations

from collections.abc import Sequence


def verdict(held: Sequence[bool]) -> str:
    """
    >>> verdict([True, True]), verdict([False]), verdict([True, False, True]), verdict([])
    ('yes', 'no', 'on 2 of 3', '-')
    """
    if not held:
        return "-"
    return {len(held): "yes", 0: "no"}.get(sum(held), f"on {sum(held)} of {len(held)}")
