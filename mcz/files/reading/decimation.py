"""Every n-th frame of a motion: what a reader at a lower frame rate is given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Exceptions, FrameNotes, Motion, Signal

Item = TypeVar("Item", bound=np.generic)
JoinNotes = Callable[[Sequence[tuple[int, int, bytes]]], FrameNotes]


def decimated_rows(values: NDArray[Item], samples_per_frame: int, step: int) -> NDArray[Item]:
    """The rows of frames 0, step, 2 * step, ...; ``values`` has samples_per_frame rows a frame."""
    if samples_per_frame == 1:
        return values[::step]
    n_frames = len(values) // samples_per_frame
    frames = values.reshape(n_frames, samples_per_frame, values.shape[1])[::step]
    return frames.reshape(-1, values.shape[1])


def decimated(motion: Motion, step: int) -> Motion:
    """Frames 0, step, 2 * step, ... of ``motion``, with their numbers, at 1 / step of its rate.

    Its source is left out.
    """
    numbers = numbers_or_rows(motion.frame_numbers, motion.n_frames)
    return replace(
        motion,
        signals=tuple(_decimated_signal(signal, step) for signal in motion.signals),
        frame_rate=None if motion.frame_rate is None else motion.frame_rate / step,
        frame_numbers=numbers[::step],
        number_step=motion.number_step * step,
        source=None,
    )


def _decimated_signal(signal: Signal, step: int) -> Signal:
    per_frame = signal.samples_per_frame
    frames, samples = np.divmod(signal.exceptions.rows, per_frame)
    kept = np.flatnonzero(frames % step == 0)
    n_frames = -(-signal.n_frames // step)
    changes = {}
    for row, channel, grid in sorted(signal.grid_changes, key=lambda change: change[0]):
        frame = -(-(row // per_frame) // step)  # the first kept one that it holds for
        if frame < n_frames:
            changes[frame * per_frame, channel] = grid

    def thin(values: NDArray[Item]) -> NDArray[Item]:
        return decimated_rows(values, per_frame, step)

    return replace(
        signal,
        values=thin(signal.values),
        stored=thin(signal.stored),
        mask=None if signal.mask is None else thin(signal.mask),
        ordinals=None if signal.ordinals is None else thin(signal.ordinals),
        exceptions=Exceptions(
            frames[kept] // step * per_frame + samples[kept],
            signal.exceptions.channels[kept],
            tuple(signal.exceptions.texts[i] for i in kept),
        ),
        grid_changes=tuple((row, channel, grid) for (row, channel), grid in changes.items()),
    )


def picked_notes(join_notes: JoinNotes, notes: FrameNotes, frames: range) -> FrameNotes:
    """The notes of some frames alone, numbered from 0."""
    if frames.step == 1:
        return notes.part(frames.start, frames.stop)
    return join_notes([(i, i + 1, notes.cut(f, f + 1)) for i, f in enumerate(frames)])
