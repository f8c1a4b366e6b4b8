"""The open files of a data set, a few at a time, and the features of parts of their clips."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from fractions import Fraction
from threading import Lock
from weakref import finalize

import numpy as np

from mcz.container.decoded_cache import DecodedCache, SharedCache
from mcz.exchange.datasets.caches import Arrays
from mcz.exchange.datasets.fields import Field, Rows, Subject, features_of, subject_of
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import File, open
from mcz.kinematics.chain import Floats
from mcz.kinematics.poses.conversions import scalar_quaternions
from mcz.kinematics.poses.motion_like import values_of
from mcz.kinematics.poses.resampling import frames_within, resample_rows, times_at, turn_scalars
from mcz.model.clock import Timeline, known_timeline
from mcz.model.skeleton import Joints

MOST_OPEN = 64  # files at once: systems allow 256 and more
MOST_SUBJECTS = 512
BLOCK = 128  # frames whose features are made and kept together


@dataclass(frozen=True, slots=True)
class Recipe:
    """Recipe of a frame's features: the arguments of ``mcz.dataset`` that matter for it."""

    fields: tuple[Field, ...]
    rate: Fraction | None
    joints: Joints
    unit: str | None
    dtype: np.dtype[np.generic]

    @property
    def reach(self) -> int:
        return max(field.reach for field in self.fields)

    def subject(self, clip: Clip, member: Member) -> Subject:
        is_timed = self.rate is not None or member.source_rate is not None
        is_timed = is_timed or member.time is not None
        return subject_of(clip.skeleton, self.fields, self.joints, self.unit, is_timed)

    def copies(self, member: Member) -> bool:
        """Return True if frames of the data set are consecutive frames of the clip."""
        return self.rate is None or (member.is_even and self.rate == member.source_rate)

    def step(self, member: Member) -> Fraction:
        """Frames of the clip in one frame of the data set."""
        if self.rate is None or member.source_rate is None:
            return Fraction(1)
        return member.source_rate / self.rate


class Sources:
    """Files by target, opened when they are needed; ``given`` are open already and stay so.

    ``runs_bytes`` bounds what all of them keep of decoded frames. Threads may share it.
    """

    def __init__(self, given: Mapping[str, File], runs_bytes: int, n_targets: int) -> None:
        self._given = dict(given)
        self._runs = DecodedCache(runs_bytes)
        self._open: OrderedDict[str, File] = OrderedDict()
        self._subjects: OrderedDict[tuple[object, ...], Subject] = OrderedDict()
        self._lock = Lock()
        # Where files take turns in being open, none is closed while another thread reads it.
        self._turns: AbstractContextManager[object] = (
            Lock() if n_targets > MOST_OPEN else nullcontext()
        )
        finalize(self, _close, self._open)
        for target, file in self._given.items():
            file.container.runs = SharedCache(self._runs, target)

    def clip(self, member: Member) -> Clip:
        """Raises as ``mcz.open`` does, and OptionError where the clip is gone."""
        with self._lock:
            file = self._given.get(member.target) or self._open.get(member.target)
            if file is None:
                file = open(member.target, threads=1)
                self._keep(member.target, file)
            elif member.target in self._open:
                self._open.move_to_end(member.target)
        return file.clips[member.clip]

    def close(self) -> None:
        """Close what was opened here; it is opened anew when it is needed."""
        with self._lock:
            _close(self._open)

    def adopt(self, files: Mapping[str, File]) -> None:
        """Take files that are open, as if they had been opened here."""
        with self._lock:
            for target, file in files.items():
                self._keep(target, file)

    def _keep(self, target: str, file: File) -> None:
        file.container.runs = SharedCache(self._runs, target)
        self._open[target] = file
        while len(self._open) > MOST_OPEN:
            self._open.popitem(last=False)[1].close()

    def time(self, recipe: Recipe, member: Member, frame: int) -> float | None:
        """The time of a frame, as the data set counts them; None: unknown."""
        if member.time is None:
            return None
        rate = recipe.rate or (member.source_rate if member.is_even else None)
        if rate is not None:
            return member.time + frame / float(rate)
        with self._turns:
            return float(timeline_of_member(self.clip(member), member).even[frame])

    def features(self, recipe: Recipe, member: Member, start: int, stop: int) -> Arrays:
        """The arrays of frames start <= f < stop, as the data set counts them."""
        with self._turns:
            return self._features(recipe, member, start, stop)

    def _features(self, recipe: Recipe, member: Member, start: int, stop: int) -> Arrays:
        clip = self.clip(member)
        subject = self._subject(recipe, clip, member)
        low, high = max(0, start - recipe.reach), min(member.n_frames, stop + recipe.reach)
        values = _values(recipe, subject, clip, member, low, high)
        margins = start - low, high - stop
        steps = _steps(recipe, clip, member, low, high)
        return features_of(recipe.fields, subject, Rows(values, steps), margins, recipe.dtype)

    def _subject(self, recipe: Recipe, clip: Clip, member: Member) -> Subject:
        """Prepared once for each skeleton."""
        # the id is the hash of the skeleton
        key = clip.skeleton_id, member.source_rate, member.time is None
        with self._lock:
            found = self._subjects.get(key)
            if found is None:
                found = self._subjects[key] = recipe.subject(clip, member)
                if len(self._subjects) > MOST_SUBJECTS:
                    self._subjects.popitem(last=False)
            return found


def timeline_of_member(clip: Clip, member: Member) -> Timeline:
    """The times of the frames of a member, where they are known."""
    timeline = known_timeline(clip.name, clip.timeline_at(member.source_rate))
    return timeline.cut(slice(member.first, member.first + member.n_source))


def _close(files: OrderedDict[str, File]) -> None:
    while files:
        files.popitem()[1].close()


def _values(
    recipe: Recipe, subject: Subject, clip: Clip, member: Member, low: int, high: int
) -> Floats:
    """All channels of frames low <= f < high at the rate of the data set."""
    needed = sorted({joint for field in recipe.fields for joint in field.needs(subject)})
    if recipe.copies(member):
        return values_of(clip, (member.first + low, member.first + high), needed)
    if member.is_even:
        times = times_at(range(low, high), recipe.step(member))
    else:
        assert recipe.rate is not None
        part = timeline_of_member(clip, member)
        _, lie = frames_within(part, recipe.rate, (0, member.n_source))
        times = lie(range(low, high))
    first, last = int(times.before[0]), int(times.after[-1]) + 1
    if times.share.any():  # splines look at one more on either side
        first, last = max(0, first - 1), min(member.n_source, last + 1)
    old = values_of(clip, (member.first + first, member.first + last), needed)
    times = replace(times, before=times.before - first)
    new = resample_rows(clip.skeleton, old, times)
    if times.share.any():
        turn_scalars(scalar_quaternions(clip.skeleton, None, old), old, new, times)
    return new


def _steps(recipe: Recipe, clip: Clip, member: Member, low: int, high: int) -> Floats:
    """The seconds from each of these frames to the next; NaN across a gap."""
    timeline = clip.timeline_at(member.source_rate) if recipe.reach else None
    if recipe.copies(member) and timeline is not None:
        return timeline.steps[member.first + low : member.first + max(low, high - 1)]
    rate = recipe.rate or member.source_rate
    return np.full(max(0, high - low - 1), 1.0 / float(rate) if rate else np.nan)


@dataclass(frozen=True, slots=True)
class Member:
    """One clip of a data set, or the part of one between two gaps.

    ``target`` is what ``mcz.open`` takes, ``n_source`` its frames at ``source_rate`` frames a
    second (None: unknown) from frame ``first`` on, at ``time`` in seconds (None: unknown);
    ``n_frames`` are those of the data set, at the rate of the data set. ``is_even``: each frame
    follows the one before by 1 / ``source_rate``; else the times of the clip say when it was.
    """

    target: str
    clip: str
    n_source: int
    source_rate: Fraction | None
    n_frames: int
    first: int = 0
    time: float | None = None
    is_even: bool = True

    @property
    def label(self) -> str:
        return f"{self.target}: {self.clip}"
