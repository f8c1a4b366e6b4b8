"""Data sets: windows of many clips as arrays, for whoever trains or measures on them.

``dataset`` finds the clips, ``fields`` says what arrays are made of them, ``features`` makes these
of a part of a clip, ``caches`` keeps them, ``Dataset`` counts, cuts, shuffles and splits.
"""

from __future__ import annotations

from mcz.exchange.datasets.member_list import dataset
from mcz.exchange.datasets.windows import Dataset, Window

__all__ = ["Dataset", "Window", "dataset"]
