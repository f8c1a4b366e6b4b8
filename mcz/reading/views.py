"""``clip.values``: the motion signal as something to slice."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


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

    def __getitem__(self, key: int | slice) -> NDArray[Any]:
        if isinstance(key, slice):
            start, stop, step = key.indices(self._clip.n_frames)
            if step > 0:
                return self._clip.read(frames=(start, max(start, stop)))[::step]
            frames = range(start, stop, step)
            if not frames:
                return self._clip.read(frames=(0, 0))
            return self._clip.read(frames=(frames[-1], frames[0] + 1))[::-1][::-step]
        index = key + self._clip.n_frames if key < 0 else key
        if not 0 <= index < self._clip.n_frames:
            raise IndexError(f"frame {key} of {self._clip.n_frames}")
        row: NDArray[Any] = self._clip.read(frames=(index, index + 1))[0]
        return row

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self._clip.read(), dtype=dtype)
