"""What a clip shows of itself without being decoded: few frames, of which little is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.reading.signal_info import SignalInfo
from mcz.reading.signal_reader import SignalReader
from mcz.types import Values


@dataclass(frozen=True, slots=True)
class Preview:
    """Some frames of a clip, ascending and counted from 0; a row of values for each.

    ``mask`` is None where all values are valid. ``step``: the frames between two of them, but for
    the last, which may be nearer.
    """

    frames: NDArray[np.int64]
    values: Values
    mask: NDArray[np.bool_] | None
    step: int

    @property
    def is_regular(self) -> bool:
        """Whether every frame is ``step`` behind the one before."""
        return bool((np.diff(self.frames) == self.step).all())

    def masked(self) -> Values:
        """The values, NaN where invalid."""
        return self.values if self.mask is None else np.where(self.mask, self.values, np.nan)


def preview(
    reader: SignalReader, n_frames: int, columns: Sequence[int] | slice = slice(None)
) -> Preview:
    """The frames that a clip of ``n_frames`` can show without decoding the rest.

    ``reader`` reads the motion signal in its coarsest resolution; of what it gives these
    ``columns`` are kept.
    """
    info = reader.info
    frames, step = _frames(info, n_frames, reader.name)
    per_frame = info.layout.samples_per_frame
    parts, masks = [], []
    for block in reader.blocks(info.skip, info.skip + n_frames):
        a, b = np.searchsorted(frames, (block.start - info.skip, block.stop - info.skip)).tolist()
        picked = frames[a:b] + info.skip - block.start
        rows = (picked[:, None] * per_frame + np.arange(per_frame)).ravel()
        parts.append(block.values[rows])
        valid = np.ones(parts[-1].shape, np.bool_) if block.mask is None else block.mask[rows]
        masks.append(valid)
    if not parts:
        values, _ = reader.read(0, 0)
        parts, masks = [values], [np.ones(values.shape, np.bool_)]
    valid = np.concatenate(masks)[:, columns]
    values = np.concatenate(parts)[:, columns]
    return Preview(frames, values, None if valid.all() else valid, step)


def _frames(info: SignalInfo, n_frames: int, name: str) -> tuple[NDArray[np.int64], int]:
    """The frames that are shown, counted from the first of the clip, and how far apart they are."""
    codec = info.codec
    if codec.preview is not None:
        stored = codec.preview(info.header, info.layout, info.spans)
        frames = stored - info.skip
        frames = frames[(frames >= 0) & (frames < n_frames)]
        return frames, int(frames[1] - frames[0]) if len(frames) > 1 else 1
    if info.counts.n_resolutions == 1:
        raise OptionError(
            f"codec {codec.name} has stored it in one resolution, so that "
            "there is nothing to show without decoding it",
            clip=name,
        )
    step = 2 ** (info.counts.n_resolutions - 1)
    return np.arange(0, n_frames, step, dtype=np.int64), step
