"""Frame numbers <-> the time base of CLIP and the runs of CEND. SPEC.md, "Time", is normative."""

from __future__ import annotations

import numpy as np

from mcz.container import payloads
from mcz.errors import FormatError, OptionError
from mcz.model.clock import MAX_NUMBER
from mcz.model.types import Ints


def time_base_of(numbers: Ints | None, first_time: float | None) -> payloads.TimeBase | None:
    """The time base of frames with these ascending ``numbers``, None if CLIP needs none."""
    if numbers is None or not len(numbers):
        numbers = np.ones(1, np.int64)
    missing = missing_runs(numbers)
    if numbers[0] == 1 and first_time is None and not missing:
        return None
    return payloads.TimeBase(number=int(numbers[0]), first_time=first_time, missing=missing)


def missing_runs(numbers: Ints) -> list[payloads.MissingRun]:
    """The runs of missing numbers between ascending ones."""
    steps = np.diff(numbers)
    after = np.flatnonzero(steps != 1)
    runs = zip(np.diff(after, prepend=-1).tolist(), steps[after].tolist(), strict=True)
    return [payloads.MissingRun(frames=frames, length=step - 1) for frames, step in runs]


def put_time_base(fields: payloads.Clip, base: payloads.TimeBase | None) -> None:
    """Set or remove the time base of a CLIP."""
    fields.time_base = base
    fields.flags &= ~payloads.HAS_TIME_BASE
    fields.flags |= 0 if base is None else payloads.HAS_TIME_BASE


def whole_time_base(fields: payloads.Clip, cend: payloads.Cend | None) -> payloads.TimeBase | None:
    """The time base of a clip, with the runs that CEND has in the place of CLIP; FormatError."""
    base = fields.time_base
    is_open = bool(fields.flags & payloads.OPEN_CLIP)
    late = cend.missing if cend is not None else []
    if is_open and base is not None and base.missing:  # TIME-04
        raise FormatError("it is open, but states missing frames", clip=fields.name)
    timed = any(signal.role == payloads.TIMES for signal in fields.signals)
    if timed and base is not None and base.first_time is not None:  # TIME-07
        raise FormatError(
            "the time of its first frame, and a signal of times too", clip=fields.name
        )
    if late and not is_open:  # TIME-05
        raise FormatError("its CEND states missing frames, but it is not open", clip=fields.name)
    if not late:
        return base
    first_time = None if base is None else base.first_time
    number = 1 if base is None else base.number
    return payloads.TimeBase(number=number, first_time=first_time, missing=late)


def numbers_of(base: payloads.TimeBase | None, n_frames: int, name: str, *, whole: bool) -> Ints:
    """The number of every frame; raises FormatError.

    ``whole``: ``n_frames`` is the original number of frames; else missing runs may follow the last
    frame.
    """
    base = base or payloads.TimeBase(number=1)
    steps = np.ones(n_frames, np.int64)
    steps[:1] = base.number
    frame, last = 0, base.number + n_frames - 1
    for run in base.missing:
        frame, last = frame + run.frames, last + run.length
        if frame < n_frames:
            steps[frame] += min(run.length, MAX_NUMBER)
        elif whole:  # TIME-02
            raise FormatError(f"frames are missing after frame {n_frames - 1}", clip=name)
    if whole and last > MAX_NUMBER:  # TIME-03
        raise FormatError(f"its last frame has the number {last}", clip=name)
    return np.cumsum(steps)


class MissingRunCounter:
    """The missing runs of a clip whose frames come one by one, from ``number`` on."""

    def __init__(self, number: int) -> None:
        self.runs: list[payloads.MissingRun] = []
        self._last, self._frames, self._gap = number - 1, 0, 0  # since the run before

    def miss(self, count: int) -> None:
        """Skip so many frames after the last one; raises OptionError before the first."""
        if count < 1 or not (self._frames or self.runs):
            raise OptionError(f"{count} frames cannot be missing here")
        if self._last + self._gap + count >= MAX_NUMBER:
            raise OptionError("a frame number is beyond 2^52 - 1")
        self._gap += count

    def frame(self) -> None:
        """Count the next frame."""
        if self._gap:
            self.runs.append(payloads.MissingRun(frames=self._frames, length=self._gap))
        self._frames = 1 if self._gap else self._frames + 1
        self._last += 1 + self._gap
        self._gap = 0
