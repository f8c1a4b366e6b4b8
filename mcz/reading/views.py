"""``clip.values``: the motion signal as something to slice."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mcz.indexing import Rows, row_numbers
from mcz.types import Values


class Masked(NamedTuple):
    """Numbers as they are stored, and which of them are valid (bool, same shape; None: all)."""

    values: Values
    mask: NDArray[np.bool_] | None


class FrameValues(NamedTuple):
    """Some frames, ascending and counted from 0, (n,), and a row of values for each."""

    frames: NDArray[np.int64]
    values: Values


class Readable(Protocol):
    """What a clip has that its values need."""

    n_frames: int

    @property
    def n_channels(self) -> int: ...

    def read(self, frames: tuple[int, int] | None = None) -> Values: ...


class ClipValues:
    """The motion signal of a clip, sliced by frames like an array of shape ``shape``."""

    dtype = np.dtype("<f8")

    def __init__(self, clip: Readable) -> None:
        self._clip = clip

    @property
    def shape(self) -> tuple[int, int]:
        return self._clip.n_frames, self._clip.n_channels

    def __len__(self) -> int:
        return self._clip.n_frames

    def __repr__(self) -> str:
        n_frames, n_channels = self.shape
        return f"<ClipValues: {n_frames} frames, {n_channels} channels, not yet decoded>"

    def __getitem__(self, key: Any) -> Values:
        """Frames, and some of their channels: ``[100]``, ``[10:20, 3:6]``, as of an array.

        Only the frames that are asked for are decoded, from the first to the last of them.
        """
        rows, *rest = (key if isinstance(key, tuple) else (key,)) or (Ellipsis,)
        if not _is_one_axis(rows):
            whole: Values = np.asarray(self)[key]
            return whole
        chosen = row_numbers(rows, self._clip.n_frames, "frame")
        first, stop = _span(chosen)
        found = self._clip.read(frames=(first, stop))
        if isinstance(chosen, range):
            return found[(slice(None, None, chosen.step), *rest)]
        part: Values = found[(chosen - first, *rest)]
        return part

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Values:
        return np.asarray(self._clip.read(), dtype=dtype)


def _is_one_axis(key: object) -> bool:
    """False for an index that adds an axis, or takes more than one."""
    if key is None or key is Ellipsis or isinstance(key, (bool, np.bool_)):
        return False
    return isinstance(key, slice) or getattr(key, "ndim", 1) < 2


def _span(rows: Rows) -> tuple[int, int]:
    """The frames from the first to the last of ``rows``, (0, 0) for none."""
    if isinstance(rows, int):
        return rows, rows + 1
    if not len(rows):
        return 0, 0
    ends = (rows[0], rows[-1]) if isinstance(rows, range) else (rows.min(), rows.max())
    return int(min(ends)), int(max(ends)) + 1
