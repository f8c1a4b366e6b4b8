"""The preview of a clip as a motion at a lower frame rate."""

from __future__ import annotations

import numpy as np

from mcz.clock import Timeline
from mcz.motion import Motion, Signal
from mcz.reading.clip import Clip


def preview_motion(clip: Clip) -> Motion:
    """The preview as a motion at a lower frame rate, without the further signals and the source.

    A last frame that is nearer to the one before is left out.
    """
    found = clip.previewed()
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
        role=info.role if info.of is None else "",
    )
    frames, timeline = found.frames[:n_frames], clip.timeline
    motion = Motion(
        skeleton=clip.skeleton,
        signals=(signal,),
        frame_rate=None if rate is None else rate / found.step,
        frame_rate_exact=clip.frame_rate_exact,
        name=clip.name,
        metadata=clip.metadata,
        frame_numbers=clip.frame_numbers[frames],
        number_step=found.step,
    )
    if timeline is not None:
        timeline = Timeline(timeline.times[frames], motion.frame_rate, timeline.rounding)
    return motion.at_times(timeline)
