"""Functions that loops may call, and that are plain Python where loops are interpreted."""

from __future__ import annotations


def bit_length(value: int) -> int:
    """Bits of ``value`` >= 0 without leading zeros."""
    return int(value).bit_length()


def truncated(value: float) -> int:
    """``int(value)``, quicker than that, of values below 2^63 in size."""
    return int(value)
