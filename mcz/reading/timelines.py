"""The times of a clip, of which at most the column of times is decoded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mcz.clock import Column, Counting, Timeline, column_of, has_times, time_signal, timeline_of
from mcz.container.reader import Container
from mcz.motion import Skeleton
from mcz.reading.signal_info import SignalInfo
from mcz.reading.source_info import read_clock


class Stored(Protocol):
    """What a clip has that says when its frames were."""

    container: Container

    @property
    def _fields(self) -> Any: ...
    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def signals(self) -> Sequence[SignalInfo]: ...
    @property
    def frame_rate(self) -> Fraction | None: ...
    @property
    def frame_numbers(self) -> NDArray[np.int64]: ...
    @property
    def timeline(self) -> Timeline | None: ...
    @property
    def metadata(self) -> Mapping[str, str]: ...
    def read(
        self,
        frames: tuple[int, int] | None = None,
        joints: Any = None,
        *,
        signal: int | str = 0,
    ) -> NDArray[Any]: ...


def clip_timeline(clip: Stored) -> Timeline | None:
    """When every frame of a clip was, None where neither times nor a rate are known."""
    column = times_column(clip)
    clock = read_clock(clip.container, clip._fields, clip.signals[0])
    counting = Counting(clip.frame_numbers, clip.frame_rate)
    return timeline_of(counting, clip.metadata, clock, column)


def timeline_at(clip: Stored, rate: Fraction | None) -> Timeline | None:
    """That of a clip, by ``rate`` where it states neither a rate nor times."""
    found = clip.timeline
    if found is None and rate is not None:
        return timeline_of(Counting(clip.frame_numbers, rate), clip.metadata)
    return found


def times_column(clip: Stored) -> Column | None:
    """The times that stand among the values; None where there are none."""
    first = clip.signals[0]
    if first.channels is None and first.samples_per_frame == 1 and has_times(clip.skeleton):
        times = clip.read(joints=[0])[:, 0]
        return column_of(times, first.grids[0], clip.skeleton.channels[0].unit)
    index = time_signal(clip.signals)
    if index is None:
        return None
    info = clip.signals[index]
    unit = info.channels[0].unit if info.channels else "s"
    return column_of(clip.read(signal=index)[:, 0], info.grids[0], unit)
