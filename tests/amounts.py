"""The amount of an exhaustive test: all of it with MCZ_LONG=1, as in .ci/full, else a sample."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

Item = TypeVar("Item")

LONG = bool(os.environ.get("MCZ_LONG"))


def some(items: Sequence[Item], every: int) -> Sequence[Item]:
    """All items, or in a short run one of ``every``, the same each time."""
    return items if LONG else items[::every]


def amount(count: int, short: int) -> int:
    """``count``, or ``short`` in a short run."""
    return count if LONG else min(count, short)
