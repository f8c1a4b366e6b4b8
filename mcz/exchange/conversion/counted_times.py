"""Times in files that state none, but count frames: BVH, AMC and C3D."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mcz.model.clock import EXACT, TIMES, numbers_or_rows
from mcz.model.motion import Motion

COUNTING = ("bvh", "amc", "c3d")


def with_counted_times(motion: Motion, to: str) -> Motion:
    """``motion`` as a file that counts frames can have it: without a signal of times.

    The first frame of a C3D has the number that gives its time.
    """
    if to == "c3d":
        first = first_number(motion)
        if first != numbers_or_rows(motion.frame_numbers, motion.n_frames)[:1].sum():
            numbers = first + np.arange(motion.n_frames)
            motion = replace(motion, frame_numbers=numbers, first_time=None, number_step=1)
    if not motion.signals_of(TIMES):
        return motion
    return motion.with_signals([k for k, s in enumerate(motion.signals) if s.role != TIMES])


def first_number(motion: Motion) -> int:
    """The number of the first frame in a C3D, where frame 1 is at 0 s; else that of the motion."""
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    line, rate = motion.timeline, motion.frame_rate
    own = int(numbers[0]) if len(numbers) else 0
    if line is None or rate is None or not len(line.times):
        return own
    first = float(line.even[0]) * float(rate) + 1
    if abs(first - own) / float(rate) <= line.rounding / 2 + EXACT or not 0 <= first < 2**32:
        return own
    return round(first)


def lost_times(motion: Motion, to: str) -> Iterator[str]:
    """Times that such a file cannot state, in words: their begin, and gaps."""
    line, rate, name = motion.timeline, motion.frame_rate, to.upper()
    if line is None or not len(line.times):
        return
    if rate is None:
        yield f"left out: times, which {name} cannot state without a frame rate"
        return
    numbers, step = numbers_or_rows(motion.frame_numbers, motion.n_frames), 1
    frames = np.arange(len(numbers), dtype=np.float64)
    if to == "amc":
        yield f"left out: the frame rate, {float(rate):g} a second"
        frames, step = numbers.astype(np.float64) - 1, motion.number_step
    elif to == "c3d":
        frames += first_number(motion) - 1
    stated, times = frames / float(rate * step), line.even
    allowed = line.rounding + EXACT
    if abs(times[0] - stated[0]) > allowed:
        first = f"{times[0]:.6g} s: {name} begins at {stated[0]:.6g} s"
        yield f"left out: the time of the first frame, {first}"
    off = (times - times[0]) - (stated - stated[0])
    if np.abs(off).max() <= 2 * allowed:
        return
    gaps = np.diff(times)[np.isnan(line.steps)]
    if len(gaps):
        many = f"{len(gaps)} gaps in time, the longest" if len(gaps) > 1 else "a gap in time"
        yield f"left out: {many} of {gaps.max():.6g} s: {name} has frame after frame"
    else:
        yield f"left out: times that are not uniform: {name} has frame after frame"
