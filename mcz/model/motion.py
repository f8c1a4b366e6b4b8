"""The data model: Motion and, from their own modules, its parts, checked on creation.

SPEC.md, "CLIP", has the stored form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from mcz.errors import MotionError, OutOfRangeError
from mcz.model import text_format
from mcz.model.checks import (
    INTEGER,
    NUMBER,
    TEXT,
    TEXT_MAP,
    TRUTH,
    ArgumentType,
    array_of,
    check_fields,
    of_type,
    optional,
    row_numbers,
    several,
)
from mcz.model.clock import (
    TIMES,
    Counting,
    Timeline,
    check_numbers,
    column_of,
    known_timeline,
    numbering_of,
    numbers_or_rows,
    part_first_time,
    timeline_of,
    times_fault,
    times_signal_fault,
    unit_of_times,
)
from mcz.model.notebook import html_of
from mcz.model.numbers.grid import grid_blocks as grid_blocks
from mcz.model.signal import ROLES as ROLES
from mcz.model.signal import Exceptions as Exceptions
from mcz.model.signal import Signal as Signal
from mcz.model.signal import check_poses as check_poses
from mcz.model.skeleton import ANGLE_KINDS as ANGLE_KINDS
from mcz.model.skeleton import CHANNEL_KINDS as CHANNEL_KINDS
from mcz.model.skeleton import CHANNELS as CHANNELS
from mcz.model.skeleton import ORIGIN as ORIGIN
from mcz.model.skeleton import POSITION_KINDS as POSITION_KINDS
from mcz.model.skeleton import QUATERNION_KINDS as QUATERNION_KINDS
from mcz.model.skeleton import ROTATION_KINDS as ROTATION_KINDS
from mcz.model.skeleton import TURNING_KINDS as TURNING_KINDS
from mcz.model.skeleton import VECTOR_KINDS as VECTOR_KINDS
from mcz.model.skeleton import Channel as Channel
from mcz.model.skeleton import FrameNotes as FrameNotes
from mcz.model.skeleton import Joint as Joint
from mcz.model.skeleton import Skeleton as Skeleton
from mcz.model.skeleton import Source as Source
from mcz.model.skeleton import Vector as Vector
from mcz.model.skeleton import joint_columns as joint_columns
from mcz.model.types import Floats, Ints, Values


def frame_rate_of(rate: Any, name: str) -> Fraction:
    """Convert a number to the nearest frame rate, a Fraction; raises MotionError."""
    if isinstance(rate, (bool, np.bool_)) or np.ndim(rate):
        raise MotionError(f"frame rate {rate!r} is not a positive number", clip=name)
    with suppress(TypeError, ValueError, OverflowError):  # not a number, NaN, infinite
        exact = isinstance(rate, Fraction)
        value: Fraction = rate if exact else Fraction(float(rate)).limit_denominator(2**52)
        if value > 0:
            return value
    raise MotionError(f"frame rate {rate!r} is not a positive number", clip=name)


MOTION_ROLE, RESIDUALS = "motion", "residuals"
MOTION = {
    "name": TEXT,
    "skeleton": of_type(Skeleton, "a Skeleton"),
    "signals": several(of_type(Signal, "a Signal"), "Signals"),
    "frame_rate_exact": TRUTH,
    "metadata": TEXT_MAP,
    "source": optional(of_type(Source, "a Source")),
    "frame_numbers": optional(array_of("i8", 1, "int64 of one dimension")),
    "number_step": INTEGER,
    "first_time": optional(NUMBER),
}


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A skeleton in motion: the motion signal first, then any others (analog, ...).

    ``frame_rate`` in frames a second, None while unknown; ``frame_rate_exact`` is False if the
    source has a rounded frame time. ``frame_numbers`` (int64, ascending) is None for 1, 2, 3, ...;
    they usually rise by ``number_step``, more than 1 if frames were left out evenly.
    ``first_time`` is the time of the first frame in seconds; None if its number implies it:
    frame 1 is at 0 s. ``metadata`` maps keys of SPEC.md's registry, or private ``x-`` keys, to
    text. ``times`` has the time of each frame.
    """

    skeleton: Skeleton
    signals: tuple[Signal, ...]
    frame_rate: Fraction | None = None
    frame_rate_exact: bool = True
    name: str = "motion"
    metadata: Mapping[str, str] = field(default_factory=dict)
    source: Source | None = None
    frame_numbers: Ints | None = None
    number_step: int = 1
    first_time: float | None = None

    __repr__ = text_format.motion_text
    _repr_html_ = html_of

    def __post_init__(self) -> None:
        check_fields(self, MOTION)
        if not self.signals:
            raise MotionError("a motion needs at least one signal", clip=self.name)
        for signal in self.signals:
            if signal.channels is None and signal.n_channels != self.skeleton.n_channels:
                raise MotionError(
                    f"{signal.n_channels} columns, "
                    f"but the skeleton has {self.skeleton.n_channels} channels",
                    clip=self.name,
                )
        self._check_roles()
        counts = {signal.n_frames for signal in self.signals}
        if len(counts) > 1:
            raise MotionError(
                f"the numbers of frames of its signals differ: {sorted(counts)}", clip=self.name
            )
        if self.frame_rate is not None:
            object.__setattr__(self, "frame_rate", frame_rate_of(self.frame_rate, self.name))
        if self.frame_numbers is not None and len(self.frame_numbers) != self.n_frames:
            raise MotionError(
                f"{len(self.frame_numbers)} frame numbers do not match the number of frames",
                clip=self.name,
            )
        if self.frame_numbers is not None:
            check_numbers(self.frame_numbers, self.name)
        if self.number_step < 1:
            raise MotionError(
                f"number_step is {self.number_step}; it must be at least 1", clip=self.name
            )

    def _check_roles(self) -> None:
        """Give signals without a role theirs, and check the rules of SPEC.md on roles."""
        if any(signal.role is None for signal in self.signals):
            signals = (
                replace(signal, role="" if index else MOTION_ROLE)
                if signal.role is None
                else signal
                for index, signal in enumerate(self.signals)
            )
            object.__setattr__(self, "signals", tuple(signals))
        roles = [signal.role for signal in self.signals]
        if MOTION_ROLE in roles[1:]:
            raise MotionError("only the first signal can be a motion", clip=self.name)
        if roles.count(TIMES) > 1:
            raise MotionError("more than one signal of times", clip=self.name)
        for index, signal in enumerate(self.signals):
            if (signal.role == RESIDUALS) != (signal.of is not None):
                raise MotionError(
                    f"signal {signal.name!r}: of is {signal.of}; only residuals refer to a signal",
                    clip=self.name,
                )
            if signal.of is not None and (signal.of == index or not 0 <= signal.of < len(roles)):
                raise MotionError(
                    f"residuals of signal {signal.of}, which does not exist", clip=self.name
                )
            if signal.role == TIMES:
                fault = times_signal_fault(signal) or times_fault(signal.masked()[:, 0])
                if fault:
                    raise MotionError(
                        f"signal {signal.name!r}: invalid times: {fault}", clip=self.name
                    )

    @property
    def motion_signal(self) -> Signal | None:
        """The signal with the role "motion", the first; None if there is none."""
        return self.signals[0] if self.signals[0].role == MOTION_ROLE else None

    def signals_of(self, role: str) -> tuple[Signal, ...]:
        """The signals of a role, one of ``mcz.model.signal.ROLES``."""
        return tuple(signal for signal in self.signals if signal.role == role)

    @property
    def values(self) -> Values:
        """The first signal, which is the motion, (n_frames, n_channels), NaN if invalid."""
        return self.signals[0].masked()

    @property
    def n_frames(self) -> int:
        return self.signals[0].n_frames

    @property
    def shape(self) -> tuple[int, int]:
        """(n_frames, n_channels) of the motion signal."""
        return self.n_frames, self.signals[0].n_channels

    def __len__(self) -> int:
        """The number of frames."""
        return self.n_frames

    def __bool__(self) -> bool:
        """True, also without frames."""
        return True

    __iter__ = None  # not a sequence: a part of it is a motion

    def __getitem__(self, frames: slice) -> Motion:
        """``motion[10:20]``: frames 10 to 19 of all signals, with their numbers, as a Motion.

        Its source, if any, then describes no file. Raises OutOfRangeError for anything but a slice
        of step 1.
        """
        if not isinstance(frames, slice):
            raise OutOfRangeError(f"cut a motion with a slice such as [10:20], not with {frames!r}")
        chosen = row_numbers(frames, self.n_frames, "frame")
        if not isinstance(chosen, range) or chosen.step != 1:
            raise OutOfRangeError(f"{frames} has a step; change the frame rate with mcz.resample")
        return self.cut(chosen.start, max(chosen.start, chosen.stop))

    def cut(self, start: int, stop: int) -> Motion:
        """Keep frames start <= f < stop, with their numbers and times."""
        if (start, stop) == (0, self.n_frames):
            return self
        numbers = self.frame_numbers
        if start:
            numbers = numbers_or_rows(numbers, self.n_frames)
        first_time = self.first_time
        if first_time is not None:
            first_time = part_first_time(first_time, self.timeline, start, stop)
        return replace(
            self,
            signals=tuple(signal.cut(start, stop) for signal in self.signals),
            frame_numbers=None if numbers is None else numbers[start:stop],
            first_time=first_time,
            source=self.source and self.source.cut(start, stop),
        )

    def with_values(self, values: Floats) -> Motion:
        """A copy with other values of the motion signal, of the same shape."""
        signal = replace(self.signals[0], values=np.asarray(values, dtype=np.float64))
        source = self.source and self.source.without_file()
        return replace(self, signals=(signal, *self.signals[1:]), source=source)

    @property
    def timeline(self) -> Timeline | None:
        """The times of all frames, None if neither times nor a rate are known."""
        column = None
        for signal in self.signals_of(TIMES):
            column = column_of(signal.masked()[:, 0], signal.grids[0], unit_of_times(signal))
        numbers = numbers_or_rows(self.frame_numbers, self.n_frames)
        counting = Counting(numbers, self.frame_rate, self.number_step)
        return timeline_of(counting, self.first_time, column)

    @property
    def times(self) -> Floats:
        """The time of every frame in seconds, (n_frames,): see ``mcz.times``; OptionError."""
        return known_timeline(self.name, self.timeline).times

    def at_rate(self, rate: Fraction) -> Motion:
        """A copy at another frame rate, which changes the times."""
        first_time = self.first_time
        if first_time is not None and self.frame_rate is not None:
            first_time *= float(self.frame_rate / rate)
        return replace(self, frame_rate=rate, frame_rate_exact=True, first_time=first_time)

    def without_source(self) -> Motion:
        """A copy without the source, at the same times."""
        return replace(self, source=None).at_times(self.timeline)

    def with_consecutive_numbers(self) -> Motion:
        """A copy at the same times with a ``number_step`` of 1, as files store it.

        Frame numbers are kept if there is a source, which may print them.
        """
        if self.number_step == 1:
            return self
        motion = replace(self, number_step=1)
        return motion if self.signals_of(TIMES) else motion.at_times(self.timeline)

    def at_times(self, timeline: Timeline | None) -> Motion:
        """This motion at these times; None: at unknown ones.

        Frame numbers are kept if they imply these times, and with a source, which may print
        them; else they are changed, or the motion gets a signal ``time``.
        """
        motion = replace(self, first_time=None)
        current = motion.timeline
        if timeline is None or not self.n_frames or (current and current.is_near(timeline)):
            return motion
        numbers = numbers_or_rows(self.frame_numbers, self.n_frames)
        numbered = numbering_of(timeline, numbers, strict=self.source is not None)
        if numbered is not None:
            first = numbered.first_time
            return replace(motion, frame_numbers=numbered.numbers, first_time=first, number_step=1)
        return motion._with_time_signal(timeline)

    def _with_time_signal(self, timeline: Timeline) -> Motion:
        channels = (Channel("", "time", "s"),)
        times = timeline.times[:, None].copy()
        signal = Signal(times, name="time", channels=channels, role=TIMES)
        others = (replace(s, role="") if s.role == TIMES else s for s in self.signals)
        return replace(self, signals=(*others, signal))

    def with_signals(self, indices: Sequence[int]) -> Motion:
        """A copy with only the signals ``indices``, in this order.

        Residuals of a signal that is left out lose their role.
        """
        place = {old: new for new, old in enumerate(indices)}
        signals = []
        for signal in (self.signals[index] for index in indices):
            if signal.of is not None:
                target = place.get(signal.of)
                signal = replace(signal, of=target, role="" if target is None else signal.role)
            signals.append(signal)
        return replace(self, signals=tuple(signals))


A_MOTION = ArgumentType(
    "a Motion, which clip.motion() makes of a Clip", lambda value: isinstance(value, Motion)
)
A_SKELETON = ArgumentType("a Skeleton", lambda value: isinstance(value, Skeleton))
MOTION_OR_SKELETON = ArgumentType(
    "a Motion or a Skeleton", lambda value: isinstance(value, (Motion, Skeleton))
)
