"""Parts of a clip: values to slice, few frames as a preview, and every n-th frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mcz.errors import OptionError
from mcz.files.reading.signal_info import SignalInfo
from mcz.files.reading.signal_reader import SignalReader
from mcz.model.checks import Rows, row_numbers
from mcz.model.clock import numbers_or_rows
from mcz.model.motion import Exceptions, FrameNotes, Motion, Signal
from mcz.model.types import Values

if TYPE_CHECKING:
    from mcz.kinematics.frames import MotionLike


class Masked(NamedTuple):
    """Numbers as stored, and their validity (bool, same shape; None: all)."""

    values: Values
    mask: NDArray[np.bool_] | None


class FrameValues(NamedTuple):
    """Some frames, ascending and counted from 0, (n,), and a row of values for each."""

    frames: NDArray[np.int64]
    values: Values


class ClipValues:
    """The motion signal of a clip, sliced by frames like an array of shape ``shape``."""

    dtype = np.dtype("<f8")
    ndim = 2  # dask.array.from_array needs it

    def __init__(self, read: Callable[..., Values], shape: tuple[int, int]) -> None:
        self._read, self.shape = read, shape

    def __len__(self) -> int:
        return self.shape[0]

    def __repr__(self) -> str:
        n_frames, n_channels = self.shape
        return f"<ClipValues: {n_frames} frames, {n_channels} channels, not yet decoded>"

    def __getitem__(self, key: Any) -> Values:
        """Frames, and some of their channels: ``[100]``, ``[10:20, 3:6]``, as of an array.

        Only the requested frames are decoded, from the first to the last of them.
        """
        rows, *rest = (key if isinstance(key, tuple) else (key,)) or (Ellipsis,)
        if not _is_one_axis(rows):
            whole: Values = np.asarray(self)[key]
            return whole
        chosen = row_numbers(rows, len(self), "frame")
        first, stop = _span(chosen)
        values = self._read(frames=(first, stop))
        if isinstance(chosen, range):
            return values[(slice(None, None, chosen.step), *rest)]
        part: Values = values[(chosen - first, *rest)]
        return part

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Values:
        return np.asarray(self._read(), dtype=dtype)


def _is_one_axis(key: object) -> bool:
    """False for an index that adds an axis, or takes more than one."""
    if key is None or key is Ellipsis or isinstance(key, (bool, np.bool_)):
        return False
    return isinstance(key, slice) or getattr(key, "ndim", 1) < 2


def _span(rows: Rows) -> tuple[int, int]:
    if isinstance(rows, int):
        return rows, rows + 1
    if not len(rows):
        return 0, 0
    ends = (rows[0], rows[-1]) if isinstance(rows, range) else (rows.min(), rows.max())
    return int(min(ends)), int(max(ends)) + 1


@dataclass(frozen=True, slots=True)
class Preview:
    """Some frames of a clip, ascending and counted from 0; a row of values for each.

    ``mask`` is None if all values are valid. ``step``: the frames between two of them; only the
    last may be nearer.
    """

    frames: NDArray[np.int64]
    values: Values
    mask: NDArray[np.bool_] | None
    step: int

    @property
    def is_regular(self) -> bool:
        """True if every frame is ``step`` after the previous one."""
        return bool((np.diff(self.frames) == self.step).all())

    def masked(self) -> Values:
        return self.values if self.mask is None else np.where(self.mask, self.values, np.nan)


def preview(
    reader: SignalReader, n_frames: int, columns: Sequence[int] | slice = slice(None)
) -> Preview:
    """The frames that a clip of ``n_frames`` can show without decoding the rest.

    ``reader`` reads the motion signal in its coarsest resolution; ``columns`` are kept.
    """
    info = reader.info
    frames, step = _preview_frames(info, n_frames, reader.name)
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


def _preview_frames(info: SignalInfo, n_frames: int, name: str) -> tuple[NDArray[np.int64], int]:
    """The shown frames, counted from the first of the clip, and their distance."""
    codec = info.codec
    if codec.preview is not None:
        stored = codec.preview(info.header, info.layout, info.spans)
        frames = stored - info.skip
        frames = frames[(frames >= 0) & (frames < n_frames)]
        return frames, int(frames[1] - frames[0]) if len(frames) > 1 else 1
    if info.counts.n_resolutions == 1:
        raise OptionError(
            f"codec {codec.name} stored it at a single resolution, so it has no preview", clip=name
        )
    step = 2 ** (info.counts.n_resolutions - 1)
    return np.arange(0, n_frames, step, dtype=np.int64), step


Item = TypeVar("Item", bound=np.generic)
JoinNotes = Callable[[Sequence[tuple[int, int, bytes]]], FrameNotes]


def decimate_rows(values: NDArray[Item], samples_per_frame: int, step: int) -> NDArray[Item]:
    """The rows of frames 0, step, 2 * step, ...; ``values`` has samples_per_frame rows a frame."""
    if samples_per_frame == 1:
        return values[::step]
    n_frames = len(values) // samples_per_frame
    frames = values.reshape(n_frames, samples_per_frame, values.shape[1])[::step]
    return frames.reshape(-1, values.shape[1])


def decimate_motion(motion: Motion, step: int) -> Motion:
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
    rows = np.flatnonzero(frames % step == 0)
    n_frames = -(-signal.n_frames // step)
    changes = {}
    for row, channel, grid in sorted(signal.grid_changes, key=lambda change: change[0]):
        frame = -(-(row // per_frame) // step)  # the first kept one that it applies to
        if frame < n_frames:
            changes[frame * per_frame, channel] = grid

    def thin(values: NDArray[Item]) -> NDArray[Item]:
        return decimate_rows(values, per_frame, step)

    return replace(
        signal,
        values=thin(signal.values),
        stored=thin(signal.stored),
        mask=None if signal.mask is None else thin(signal.mask),
        ordinals=None if signal.ordinals is None else thin(signal.ordinals),
        exceptions=Exceptions(
            frames[rows] // step * per_frame + samples[rows],
            signal.exceptions.channels[rows],
            tuple(signal.exceptions.texts[i] for i in rows),
        ),
        grid_changes=tuple((row, channel, grid) for (row, channel), grid in changes.items()),
    )


def pick_notes(join_notes: JoinNotes, notes: FrameNotes, frames: range) -> FrameNotes:
    """The notes of some frames, numbered from 0."""
    if frames.step == 1:
        return notes.part(frames.start, frames.stop)
    return join_notes([(i, i + 1, notes.cut(f, f + 1)) for i, f in enumerate(frames)])


P = ParamSpec("P")
T = TypeVar("T")


class PoseMethod:
    """A function of ``mcz.kinematics.poses`` as a method of its name, imported on first use."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._owner, self._name = owner, name

    def __get__(self, instance: object, owner: type) -> object:
        function = getattr(import_module("mcz.kinematics.poses"), self._name)
        setattr(self._owner, self._name, function)
        return function.__get__(instance, owner)


def method_of(
    function: Callable[Concatenate[MotionLike, P], T],
) -> Callable[Concatenate[Any, P], T]:
    """Type of a method: checkers need not find out whether a clip is a ``ClipLike``."""
    return function
