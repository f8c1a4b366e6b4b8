"""Size of one channel in codec ``fast``, by which an encoder compares grids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.fast.encoder import StreamBuilder
from mcz.model.numbers import Grid

BLOCK_ROWS = 1024


def channel_bytes(ordinals: NDArray[np.int64], grid: Grid) -> int:
    """Size in bytes of the streams of one channel, (n_rows,), coded alone."""
    builder, starts = StreamBuilder([grid], [[0]]), range(0, len(ordinals), BLOCK_ROWS)
    blocks = (ordinals[start : start + BLOCK_ROWS, None] for start in starts)
    return sum(len(builder.build(block, (grid,))[0]) for block in blocks)
