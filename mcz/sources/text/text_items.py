"""Patterns of text as the kernels that match and write rows have them."""

from __future__ import annotations

from typing import NamedTuple

from mcz.kernels.types import Bytes, Ints

WORDS, FULL, BLANKS, FREE = -1, 0, 1, 2  # kinds of tokens in a row, see text_kernels.match_rows


class Items(NamedTuple):
    """A pattern as parallel arrays, one entry an item: where its gap lies in ``gaps``, its column
    (-1: the frame number), its width. The last gap is the tail."""

    gaps: Bytes
    gap_start: Ints
    gap_stop: Ints
    columns: Ints
    widths: Ints
