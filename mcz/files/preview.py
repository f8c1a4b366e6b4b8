"""What a clip shows of itself without being decoded: few frames, of which little is read.

Part of the joint between motion, codec and container (see ``file.py``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.files.clip import Clip
from mcz.files.signal_info import SignalInfo
from mcz.files.signals import SignalReader
from mcz.motion import Motion, Signal


@dataclass(frozen=True, slots=True)
class Preview:
    """Some frames of a clip, ascending and counted from 0; a row of values for each.

    ``mask`` is None where all values are valid. ``step``: the frames between two of them, but for
    the last, which may be nearer.
    """

    frames: NDArray[np.int64]
    values: NDArray[Any]
    mask: NDArray[np.bool_] | None
    step: int

    @property
    def is_regular(self) -> bool:
        """Whether every frame is ``step`` behind the one before."""
        return bool((np.diff(self.frames) == self.step).all())

    def masked(self) -> NDArray[Any]:
        """The values, NaN where invalid."""
        return self.values if self.mask is None else np.where(self.mask, self.values, np.nan)


def preview(clip: Clip, joints: Sequence[int | str] | None = None) -> Preview:
    """The frames that ``clip`` can show without decoding the rest; see ``Clip.preview``."""
    info = clip.signals[0]
    frames, step = _frames(clip, info)
    groups, places = clip.places(info, joints)
    resolution = info.counts.n_resolutions - 1
    reader = SignalReader(clip.container, info, groups, resolution, clip.name)
    per_frame = info.layout.samples_per_frame
    parts, masks = [], []
    for start, stop, values, mask in reader.blocks(info.skip, info.skip + clip.n_frames):
        a, b = np.searchsorted(frames, (start - info.skip, stop - info.skip)).tolist()
        picked = frames[a:b] + info.skip - start
        rows = (picked[:, None] * per_frame + np.arange(per_frame)).ravel()
        parts.append(values[rows])
        masks.append(np.ones(parts[-1].shape, np.bool_) if mask is None else mask[rows])
    if not parts:
        values, mask = reader.read(0, 0)
        parts, masks = [values], [np.ones(values.shape, np.bool_)]
    valid = np.concatenate(masks)[:, places]
    values = np.concatenate(parts)[:, places]
    return Preview(frames, values, None if valid.all() else valid, step)


def _frames(clip: Clip, info: SignalInfo) -> tuple[NDArray[np.int64], int]:
    """The frames that are shown, counted from the first of the clip, and how far apart they are."""
    codec = info.codec
    if codec.preview is not None:
        stored = codec.preview(info.header, info.layout, info.spans)
        frames = stored - info.skip
        frames = frames[(frames >= 0) & (frames < clip.n_frames)]
        return frames, int(frames[1] - frames[0]) if len(frames) > 1 else 1
    if info.counts.n_resolutions == 1:
        raise OptionError(
            f"clip {clip.name!r}: codec {codec.name} has stored it in one resolution, so that "
            "there is nothing to show without decoding it"
        )
    step = 2 ** (info.counts.n_resolutions - 1)
    return np.arange(0, clip.n_frames, step, dtype=np.int64), step


def preview_motion(clip: Clip) -> Motion:
    """The preview as a motion at a lower frame rate, without the further signals and the source.

    A last frame that is nearer to the one before is left out.
    """
    found = preview(clip)
    gaps = np.diff(found.frames)
    n_frames = len(found.frames) - int(len(gaps) > 0 and gaps[-1] != found.step)
    info, rate = clip.signals[0], clip.frame_rate
    n_rows = n_frames * info.layout.samples_per_frame
    signal = Signal(
        values=found.values[:n_rows],
        grids=info.grids,
        name=info.name,
        samples_per_frame=info.layout.samples_per_frame,
        mask=None if found.mask is None else found.mask[:n_rows],
        channels=info.channels,
    )
    return Motion(
        skeleton=clip.skeleton,
        signals=(signal,),
        frame_rate=None if rate is None else rate / found.step,
        frame_rate_exact=clip.frame_rate_exact,
        name=clip.name,
        metadata={k: v for k, v in clip.metadata.items() if k != "frame-numbers"},
        frame_numbers=clip.frame_numbers[found.frames[:n_frames]],
    )
