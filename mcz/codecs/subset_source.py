"""A signal source restricted to some channel groups, for re-encoding."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import SignalSource
from mcz.model.motion import Joint, Skeleton
from mcz.model.numbers import Grid
from mcz.model.types import Bools, Floats, Ints

Item = TypeVar("Item", bound=np.generic)
Read = Callable[[int, int], NDArray[Item]]  # frames first <= f < stop


class SubsetSource:
    """A SignalSource of some groups of ``source``, numbered from 0, their channels side by side.

    The skeleton keeps only their channels. If ``n_frames`` exceeds the frames of ``source``, as in
    a clip that was cut, the last frame is repeated.
    """

    def __init__(self, source: SignalSource, groups: Sequence[int], n_frames: int) -> None:
        layout = source.layout
        self._source, self._n_read = source, layout.n_frames
        self._columns = [column for group in groups for column in layout.groups[group]]
        ends = accumulate((len(layout.groups[group]) for group in groups), initial=0)
        skeleton = layout.skeleton
        self.layout = replace(
            layout,
            n_frames=n_frames,
            groups=tuple(tuple(range(start, stop)) for start, stop in pairwise(ends)),
            skeleton=None if skeleton is None else _cut(skeleton, set(self._columns)),
            grids=tuple(layout.grids[column] for column in self._columns),
        )
        self.breaks = source.breaks

    def ordinals(self, start: int, stop: int) -> Ints:
        return self._read_columns(self._source.ordinals, start, stop)

    def grids(self, frame: int) -> tuple[Grid, ...]:
        grids = self._source.grids(frame)
        return tuple(grids[column] for column in self._columns)

    def values(self, start: int, stop: int) -> Floats:
        return self._read_columns(self._source.values, start, stop)

    def valid(self, start: int, stop: int) -> Bools | None:
        if self._source.valid(0, 0) is None:
            return None
        return self._read_columns(cast("Read[np.bool_]", self._source.valid), start, stop)

    def _read_columns(self, read: Read[Item], start: int, stop: int) -> NDArray[Item]:
        """Read these columns; past the end, repeat the last frame."""
        end = self._n_read
        rows = read(min(start, end), min(stop, end))[:, self._columns]
        missing = stop - max(start, end)
        if missing <= 0:
            return rows
        last = read(end - 1, end)[:, self._columns]
        return np.concatenate([rows, *([last] * missing)])


def _cut(skeleton: Skeleton, columns: set[int]) -> Skeleton:
    """Return ``skeleton`` with only these channels."""

    def keep_channels(index: int, joint: Joint) -> Joint:
        pairs = zip(skeleton.columns(index), joint.channels, strict=True)
        return replace(joint, channels=tuple(c for column, c in pairs if column in columns))

    return replace(
        skeleton, joints=tuple(keep_channels(i, joint) for i, joint in enumerate(skeleton.joints))
    )
