"""Data sets: windows of many clips as arrays, for training and statistics.

``dataset`` finds the clips; ``field_table`` computes arrays from them; ``open_files`` reads the
frames, ``feature_blocks`` computes and caches features; ``Dataset`` counts, cuts, shuffles and
splits.
"""

from __future__ import annotations

from mcz.exchange.datasets.feature_blocks import FieldStatistics
from mcz.exchange.datasets.humanml import humanml3d, humanml3d_positions
from mcz.exchange.datasets.member_list import dataset
from mcz.exchange.datasets.windows import Dataset, Window

__all__ = [
    "Dataset",
    "FieldStatistics",
    "Window",
    "dataset",
    "humanml3d",
    "humanml3d_positions",
]
