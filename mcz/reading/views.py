"""``clip.values``: the motion signal as something to slice."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class Masked(NamedTuple):
    """Numbers as they are stored, and which of them are valid (bool, same shape; None: all)."""

    values: NDArray[Any]
    mask: NDArray[np.bool_] | None


class FrameValues(NamedTuple):
    """Some frames, ascending and counted from 0, (n,), and a row of values for each."""

    frames: NDArray[np.int64]
    values: NDArray[Any]


class Readable(Protocol):
    """What a clip has that its values need."""

    n_frames: int

    @property
    def n_channels(self) -> int: ...

    def read(self, frames: tuple[int, int] | None = None) -> NDArray[Any]: ...


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

    def __getitem__(self, key: Any) -> NDArray[Any]:
        """Frames, and some of their channels: ``[100]``, ``[10:20, 3:6]``, as of an array.

        Only the frames that are asked for are decoded, from the first to the last of them.
        """
        rows, *rest = (key if isinstance(key, tuple) else (key,)) or (Ellipsis,)
        if isinstance(rows, slice):
            found = self._slice(rows)
            return found[(slice(None), *rest)] if rest else found
        if isinstance(rows, (int, np.integer)) and not isinstance(rows, bool):
            return self._row(int(rows))[tuple(rest)] if rest else self._row(int(rows))
        chosen = None if rows is None or rows is Ellipsis else np.asarray(rows)
        if chosen is None or chosen.ndim != 1:
            whole: NDArray[Any] = np.asarray(self)[key]
            return whole
        found = self._chosen(chosen)
        return found[(np.arange(len(found)), *rest)] if rest else found

    def _slice(self, key: slice) -> NDArray[Any]:
        start, stop, step = key.indices(self._clip.n_frames)
        if step > 0:
            return self._clip.read(frames=(start, max(start, stop)))[::step]
        frames = range(start, stop, step)
        if not frames:
            return self._clip.read(frames=(0, 0))
        return self._clip.read(frames=(frames[-1], frames[0] + 1))[::-1][::-step]

    def _row(self, key: int) -> NDArray[Any]:
        index = key + self._clip.n_frames if key < 0 else key
        if not 0 <= index < self._clip.n_frames:
            raise IndexError(f"frame {key} of {self._clip.n_frames}")
        row: NDArray[Any] = self._clip.read(frames=(index, index + 1))[0]
        return row

    def _chosen(self, key: NDArray[Any]) -> NDArray[Any]:
        """The frames of a list of numbers or of a mask."""
        if key.dtype == np.bool_ and len(key) != self._clip.n_frames:
            raise IndexError(f"a mask of {len(key)} for {self._clip.n_frames} frames")
        if key.dtype.kind not in "bui" and key.size:
            raise IndexError(f"frames are chosen by numbers, slices or a mask, not by {key.dtype}")
        numbers = np.flatnonzero(key) if key.dtype == np.bool_ else key.astype(np.int64)
        numbers = np.where(numbers < 0, numbers + self._clip.n_frames, numbers)
        if not numbers.size:
            return self._clip.read(frames=(0, 0))
        first, last = int(numbers.min()), int(numbers.max())
        if first < 0 or last >= self._clip.n_frames:
            raise IndexError(f"frames {first} to {last} of {self._clip.n_frames}")
        return self._clip.read(frames=(first, last + 1))[numbers - first]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self._clip.read(), dtype=dtype)
