"""The time of every frame, in seconds. SPEC.md, "Time", is normative.

A ``Timeline`` is built from the facts of a motion or a clip: a signal of times, the time of its
first frame, frame numbers and a rate. ``Motion.times``, ``Clip.times`` and ``mcz.times`` return it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError, OptionError
from mcz.hints import Hint
from mcz.model.numbers import Grid, GridKind
from mcz.model.skeleton import Channel
from mcz.model.types import Floats, Ints, Values

TIMES = "times"  # the role of a signal of times
PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}  # units of a signal of times
JITTER = 1e-6  # steps: binary times that are off by less are uniform
TOLERANCE = 1e-10  # greatest difference of equal times, in s
SAME_RATE = 1e-5  # relative: frame rates that differ by less are equal
BREAK = 1.5  # steps: frames further apart are not neighbors
MAX_NUMBER = 2**52 - 1  # greatest frame number: the first one of any part can be stored


@dataclass(frozen=True, eq=False)
class Timeline:
    """The times of frames in seconds, as in their source.

    ``times`` float64 (n_frames,), never falling. ``rounding`` is the greatest rounding error of a
    time, such as half a printed decimal.
    """

    times: Floats
    rate: Fraction | None
    rounding: float = 0.0

    def __post_init__(self) -> None:
        self.times.setflags(write=False)

    @cached_property
    def ticks(self) -> Ints | None:
        """Periods 1 / rate from the first frame to each frame, (n_frames,).

        None if the rate is unknown or the times do not lie on such a grid.
        """
        if self.rate is None or not len(self.times):
            return None
        rate, since = float(self.rate), self.times - self.times[0]
        noise = 8 * float(np.spacing(np.abs(self.times).max())) + TOLERANCE
        near, rows = np.rint(since * rate), np.arange(len(since), dtype=np.float64)
        digit = 2 * self.rounding
        choices = [(near, min(digit, 1e-3 / rate)), (rows, digit)]
        if 2 * digit * rate <= 1:  # the rounding error is below half a period
            choices.insert(1, (near, digit))
        for ticks, allowed in choices:
            if ticks[-1] < 2**53 and np.ptp(since - ticks / rate) <= allowed + noise:
                return np.asarray(ticks, np.int64)
        return None

    @cached_property
    def regular_times(self) -> Floats:
        """``times`` moved to the multiples of 1 / rate if ``ticks`` exist."""
        if self.ticks is None or self.rate is None:
            return self.times
        return self.times[:1] + self.ticks / float(self.rate)

    @cached_property
    def _all_steps(self) -> Floats:
        if self.ticks is None or self.rate is None:
            return np.diff(self.times)
        return np.diff(self.ticks) / float(self.rate)

    @cached_property
    def period(self) -> float | None:
        """The usual seconds from a frame to the next, None if unknown."""
        steps = self._all_steps
        steps = steps[steps > 0]
        if self.rate is not None and len(steps) < 3:
            return 1.0 / float(self.rate)
        return float(np.median(steps)) if len(steps) else None

    @cached_property
    def steps(self) -> Floats:
        """Seconds from each frame to the next, (n_frames - 1,); NaN across a break in time."""
        steps = self._all_steps.copy()
        if self.period is not None:
            steps[(steps > BREAK * self.period) | (steps <= 0)] = np.nan
        return steps

    @property
    def runs(self) -> list[tuple[int, int]]:
        """The frames a <= f < b between breaks in time."""
        if not len(self.times):
            return []
        starts = [0, *(np.flatnonzero(np.isnan(self.steps)) + 1).tolist()]
        return list(zip(starts, [*starts[1:], len(self.times)], strict=True))

    def is_near(self, other: Timeline) -> bool:
        """Return whether the times equal those of ``other``, up to the rounding of ``other``."""
        if len(self.times) != len(other.times):
            return False
        error = np.abs(self.times - other.regular_times).max(initial=0.0)
        return bool(error <= other.rounding + TOLERANCE)

    def samples(self, per_frame: int) -> Floats:
        """The times of ``per_frame`` samples a frame, evenly from each frame on; NaN if unknown."""
        if per_frame == 1:
            return self.times
        if self.rate is not None:
            lengths = np.full(len(self.times), 1.0 / float(self.rate))
        else:
            steps = np.concatenate([self.steps, self.steps[-1:], [np.nan]])[: len(self.times)]
            lengths = np.where(np.isnan(steps), self.period or np.nan, steps)
        within = np.arange(per_frame) / per_frame
        return (self.times[:, None] + lengths[:, None] * within).ravel()

    def cut(self, frames: slice) -> Timeline:
        """The times of these frames, at the rate divided by the step of ``frames``."""
        rate = self.rate and self.rate / (frames.step or 1)
        return Timeline(self.times[frames], rate, self.rounding)


def time_facts(timeline: Timeline | None) -> dict[str, float | int] | None:
    """First and last time and the number of gaps, for documents; None: unknown."""
    if timeline is None or not len(timeline.times):
        return None
    first, last = float(timeline.times[0]), float(timeline.times[-1])
    gaps = len(timeline.runs) - 1
    return {"first": first, "last": last, "gaps": gaps}


class StoredTimes(NamedTuple):
    """Times as a file has them, in seconds, and the greatest rounding error of each."""

    times: Floats
    rounding: float


class Timed(Protocol):
    """A signal, of a Motion or a Clip, that may hold times."""

    @property
    def role(self) -> str | None: ...
    @property
    def channels(self) -> tuple[Channel, ...] | None: ...
    @property
    def samples_per_frame(self) -> int: ...


def times_index(signals: Sequence[Timed]) -> int | None:
    """The index of the signal of times, None if there is none."""
    return next((k for k, signal in enumerate(signals) if signal.role == TIMES), None)


def unit_of_times(signal: Timed) -> str:
    return (signal.channels or ())[0].unit


def times_signal_fault(signal: Timed) -> str:
    """The fault in the form of a signal of times, "" if there is none."""
    channels = signal.channels or ()
    if signal.samples_per_frame != 1 or len(channels) != 1:  # ROLE-03
        return f"{len(channels)} channels of its own, {signal.samples_per_frame} rows a frame"
    if channels[0].kind or channels[0].unit not in PER_SECOND:  # ROLE-03
        return f"kind {channels[0].kind!r}, unit {channels[0].unit!r}"
    return ""


def column_of(numbers: NDArray[np.generic], grid: Grid, unit: str) -> StoredTimes:
    """Convert ``numbers`` (n_frames,) in ``unit`` to seconds; ``grid`` gives their rounding."""
    per_second = PER_SECOND[unit]
    times = numbers.astype(np.float64) / per_second
    if grid.kind in (GridKind.FIXED, GridKind.TRIMMED):
        return StoredTimes(times, 0.5 * 10.0**-grid.digits / per_second)
    if not len(times) or not np.isfinite(times).all():
        return StoredTimes(times, 0.0)
    most = np.abs(times).max()
    half = float(np.spacing(np.float32(most) if grid.kind == GridKind.BINARY32 else most)) / 2
    if grid.kind == GridKind.GENERAL and most > 0:
        half = 0.5 * 10.0 ** (np.floor(np.log10(most)) + 1 - grid.digits)
    span = float(times[-1] - times[0])
    return StoredTimes(times, max(half, JITTER * abs(span) / max(1, len(times) - 1) / 2))


class Counting(NamedTuple):
    """Frame numbers, their usual ``step``, and the number of frame numbers a second."""

    numbers: Ints
    rate: Fraction | None
    step: int = 1


def timeline_of(
    counting: Counting, first_time: float | None = None, column: StoredTimes | None = None
) -> Timeline | None:
    """The times of frames; None if neither numbers nor a column imply them.

    ``first_time`` is the time of the first frame, ``column`` the times of a signal.
    """
    numbers, rate, step = counting
    if column is not None and not times_fault(column.times):  # a salvaged column may have a fault
        return Timeline(column.times, rate, column.rounding)
    if rate is None:
        return None
    if first_time is None:
        return Timeline((numbers.astype(np.float64) - 1) / float(rate * step), rate)
    since = (numbers - numbers[:1]).astype(np.float64)
    return Timeline(first_time + since / float(rate * step), rate)


def times_fault(times: Values) -> str:
    """The fault in numbers that should be times, "" if there is none."""
    if not np.isfinite(times).all():
        return f"the time of frame {int(np.flatnonzero(~np.isfinite(times))[0])} is unknown"
    falls = np.flatnonzero(np.diff(times) < 0)
    return f"the times decrease at frame {falls[0] + 1}" if len(falls) else ""


def known_timeline(name: str, timeline: Timeline | None) -> Timeline:
    """The timeline of ``name``, a motion or clip; raises OptionError if it is unknown."""
    if timeline is None:
        raise OptionError(
            "its frame rate is unknown, so its times are unknown too", clip=name, hint=Hint.RATE
        )
    return timeline


class FrameNumbering(NamedTuple):
    """Frame numbers, and the time of the first frame, None if the numbers imply it."""

    numbers: Ints
    first_time: float | None


def numbering_of(
    timeline: Timeline, numbers: Ints, *, strict: bool = False
) -> FrameNumbering | None:
    """Frame numbers for the times of ``timeline`` at its rate, without a column.

    ``numbers`` are kept if they can be, with ``strict`` always. None if frame numbers
    cannot give such times.
    """
    rate, times = timeline.rate, timeline.regular_times
    if rate is None or not len(times):
        return None
    tolerance = timeline.rounding + TOLERANCE
    first = float(times[0]) * float(rate) + 1
    candidates = [numbers]
    counts = timeline.ticks
    if (
        counts is not None
        and not strict
        and abs(first) + counts[-1] < MAX_NUMBER
        and _ascend(counts)
    ):
        candidates.append(round(first) + counts)
    for known in candidates:
        for start in (None, int(known[0]) / float(rate), float(times[0])):
            candidate = timeline_of(Counting(known, rate), start)
            if candidate is not None and np.abs(candidate.times - times).max() <= tolerance:
                return FrameNumbering(known, start)
    return None


def numbers_or_rows(numbers: Ints | None, n_frames: int) -> Ints:
    """Frame numbers: ``numbers``, else 1, 2, 3, ..."""
    return np.arange(1, n_frames + 1) if numbers is None else numbers


def part_first_time(
    first_time: float | None, timeline: Timeline | None, start: int, stop: int
) -> float | None:
    """The stated time of the first of the frames start <= f < stop; ``first_time``: of frame 0."""
    if first_time is None or not start:
        return first_time
    return float(timeline.times[start]) if timeline is not None and start < stop else None


def _ascend(numbers: Ints) -> bool:
    return bool((numbers[1:] > numbers[:-1]).all())


def check_numbers(numbers: Ints, name: str) -> None:
    """Raise MotionError for frame numbers of ``name`` that a clip cannot have."""
    if not _ascend(numbers):
        raise MotionError("frame numbers must ascend", clip=name)
    if len(numbers) and not (numbers[0] >= -MAX_NUMBER and numbers[-1] <= MAX_NUMBER):
        raise MotionError("a frame number exceeds 2^52 - 1", clip=name)


def usual_step(numbers: Ints | None) -> int:
    """The usual step from a frame number to the next."""
    return 1 if numbers is None or len(numbers) < 2 else int(np.median(np.diff(numbers)))
