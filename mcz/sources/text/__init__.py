"""Motion as text: ASF, AMC and BVH.

``rows`` finds tokens and learns the patterns that lay them out; ``layout`` has these patterns, and
the frames that deviate from them. ``source`` has encodings, and the sources of tables too.
"""

from typing import NamedTuple

from mcz.kernels.types import Bytes, Ints

MARKUP, WORDS, FULL, BLANKS, FREE = (
    -2,
    -1,
    0,
    1,
    2,
)  # kinds of tokens in a row, see text_kernels.match_rows


class Items(NamedTuple):
    """A pattern as parallel arrays, one entry an item: where its gap lies in ``gaps``, its column
    (-1: the frame number), its width. The last gap is the tail."""

    gaps: Bytes
    gap_start: Ints
    gap_stop: Ints
    columns: Ints
    widths: Ints
