"""The open files of a data set, a few at a time, and the features of parts of their clips."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from fractions import Fraction
from threading import Lock
from typing import Any
from weakref import finalize

import numpy as np

from mcz.container.caches import DecodedCache, SharedCache
from mcz.errors import OptionError
from mcz.exchange.datasets.field_table import SIGNAL, parse_fields, subject_of
from mcz.exchange.datasets.fields import (
    WHOLE,
    Arrays,
    Field,
    Subject,
    SubjectRows,
    Units,
    features_of,
)
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import File, open
from mcz.kinematics.chain import Floats
from mcz.kinematics.poses.conversions import scalar_quaternions
from mcz.kinematics.poses.resampling import (
    FrameTimes,
    frames_within,
    resample_rows,
    times_at,
    turn_scalars,
)
from mcz.model.clock import Timeline, known_timeline
from mcz.model.motion import check_poses
from mcz.model.skeleton import Joints

MOST_OPEN = 64  # files at once: systems allow 256 and more
MOST_SUBJECTS = 512


@dataclass(frozen=True, slots=True)
class Recipe:
    """Recipe of a frame's features: the arguments of ``mcz.dataset`` that matter for it."""

    fields: tuple[Field, ...]
    rate: Fraction | None
    joints: Joints
    units: Units
    dtype: np.dtype[np.generic]

    def __reduce__(self) -> tuple[object, ...]:
        names = tuple(field.name for field in self.fields)
        return recipe_of, (names, self.rate, self.joints, self.units, self.dtype)

    @property
    def reach(self) -> int:
        return max(field.reach for field in self.fields)

    @property
    def is_whole(self) -> bool:
        """True if a field can only be computed for a whole clip."""
        return self.reach == WHOLE

    @property
    def is_of_joints(self) -> bool:
        """True if a field needs the values of the motion."""
        return not all(field.signal for field in self.fields)

    def subject(self, clip: Clip, member: Member) -> Subject:
        is_timed = self.rate is not None or member.source_rate is not None
        is_timed = is_timed or member.time is not None
        return subject_of(clip, self.fields, self.joints, self.units, is_timed)

    def subject_key(self, clip: Clip, member: Member) -> tuple[object, ...]:
        """Equal for clips with equal subjects; the id of a skeleton is its hash."""
        names = {field.signal for field in self.fields} - {""}
        infos = clip.signals if names else ()
        signals = [(i.name, i.channels, i.samples_per_frame) for i in infos if i.name in names]
        return clip.skeleton_id, member.source_rate, member.time is None, tuple(signals)

    def copies(self, member: Member) -> bool:
        """Return True if frames of the data set are consecutive frames of the clip."""
        return self.rate is None or (member.is_even and self.rate == member.source_rate)

    def step(self, member: Member) -> Fraction:
        """Frames of the clip in one frame of the data set."""
        if self.rate is None or member.source_rate is None:
            return Fraction(1)
        return member.source_rate / self.rate


def recipe_of(names: str | Iterable[str], *facts: Any) -> Recipe:
    """The recipe of fields by name; raises OptionError."""
    return Recipe(parse_fields(names), *facts)


class OpenFiles:
    """Files by target, opened on demand; ``files`` are open already and stay so.

    ``runs_bytes`` limits their decoded frames in memory. Threads may share it.
    """

    def __init__(self, files: Mapping[str, File], runs_bytes: int, n_targets: int) -> None:
        self._given = dict(files)
        self._runs = DecodedCache(runs_bytes)
        self._open: OrderedDict[str, File] = OrderedDict()
        self._subjects: OrderedDict[tuple[object, ...], Subject] = OrderedDict()
        self._lock = Lock()
        # If files take turns in being open, none is closed while another thread reads it.
        self._turns: AbstractContextManager[object] = (
            Lock() if n_targets > MOST_OPEN else nullcontext()
        )
        finalize(self, _close, self._open)
        for target, file in self._given.items():
            file.container.runs = SharedCache(self._runs, target)

    def clip(self, member: Member) -> Clip:
        """Raises as ``mcz.open`` does, and OptionError if the clip is gone."""
        with self._lock:
            file = self._given.get(member.target) or self._open.get(member.target)
            if file is None:
                file = open(member.target, threads=1)
                self._keep(member.target, file)
            elif member.target in self._open:
                self._open.move_to_end(member.target)
        return file.clips[member.clip]

    def close(self) -> None:
        """Close what was opened here; it is reopened when needed."""
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
            return float(timeline_of_member(self.clip(member), member).regular_times[frame])

    def features(self, recipe: Recipe, member: Member, start: int, stop: int) -> Arrays:
        """The arrays of frames start <= f < stop, as the data set counts them."""
        with self._turns:
            return self._features(recipe, member, start, stop)

    def _features(self, recipe: Recipe, member: Member, start: int, stop: int) -> Arrays:
        clip = self.clip(member)
        subject = self._subject(recipe, clip, member)
        low, high = max(0, start - recipe.reach), min(member.n_frames, stop + recipe.reach)
        rows = _rows(recipe, subject, clip, member, (low, high))
        return features_of(recipe.fields, subject, rows, (start - low, high - stop), recipe.dtype)

    def _subject(self, recipe: Recipe, clip: Clip, member: Member) -> Subject:
        """Prepared once for each skeleton."""
        key = recipe.subject_key(clip, member)
        with self._lock:
            subject = self._subjects.get(key)
            if subject is None:
                subject = self._subjects[key] = recipe.subject(clip, member)
                if len(self._subjects) > MOST_SUBJECTS:
                    self._subjects.popitem(last=False)
            return subject


def timeline_of_member(clip: Clip, member: Member) -> Timeline:
    """The times of the frames of a member, if they are known."""
    timeline = known_timeline(clip.name, clip.timeline_at(member.source_rate))
    return timeline.cut(slice(member.first, member.first + member.n_source))


def _close(files: OrderedDict[str, File]) -> None:
    while files:
        files.popitem()[1].close()


def _rows(
    recipe: Recipe, subject: Subject, clip: Clip, member: Member, span: tuple[int, int]
) -> SubjectRows:
    """The frames low <= f < high at the rate of the data set."""
    low, high = span
    steps = _steps(recipe, clip, member, low, high)
    if recipe.copies(member):
        frames = member.first + low, member.first + high
        signals = {n: _signal_values(clip, subject, n, frames) for n in subject.signals}
        values = _joint_values(clip, subject, frames) if recipe.is_of_joints else None
        return SubjectRows(_or_none(values, high - low), steps, signals)

    times = _times(recipe, clip, member, range(low, high))
    first, last = int(times.before[0]), int(times.after[-1]) + 1
    if times.share.any():  # splines need one more on either side
        first, last = max(0, first - 1), min(member.n_source, last + 1)
    frames = member.first + first, member.first + last
    times = replace(times, before=times.before - first)
    signals = {}
    for name, shape in subject.signals.items():
        if shape.samples_per_frame > 1:
            raise OptionError(f"signal {name!r} has several samples a frame; leave rate= out")
        signals[name] = resample_rows(None, _signal_values(clip, subject, name, frames), times)
    if not recipe.is_of_joints:
        return SubjectRows(_or_none(None, high - low), steps, signals)
    old = _joint_values(clip, subject, frames)
    new = resample_rows(clip.skeleton, old, times)
    if times.share.any():
        turn_scalars(scalar_quaternions(clip.skeleton, None, old), old, new, times)
    return SubjectRows(new, steps, signals)


def _or_none(values: Floats | None, n_frames: int) -> Floats:
    return np.empty((n_frames, 0)) if values is None else values


def _joint_values(clip: Clip, subject: Subject, frames: tuple[int, int]) -> Floats:
    """All channels; those that no field needs are undefined."""
    check_poses(clip.name, clip.signals[0])
    skeleton, columns = subject.skeleton, subject.read_columns
    if len(columns) == skeleton.n_channels:
        return np.asarray(clip.read(frames), np.float64)
    values = np.zeros((frames[1] - frames[0], skeleton.n_channels))
    if columns:
        values[:, columns] = clip.read(frames, joints=subject.read_joints)
    return values


def _signal_values(clip: Clip, subject: Subject, name: str, frames: tuple[int, int]) -> Floats:
    values = clip.read(frames, signal=name.removeprefix(SIGNAL)).astype(np.float64, copy=False)
    per_frame = subject.signals[name].samples_per_frame
    if per_frame > 1:
        values = values.reshape(frames[1] - frames[0], per_frame, values.shape[1])
    return values


def _times(recipe: Recipe, clip: Clip, member: Member, frames: range) -> FrameTimes:
    """The places of frames of the data set among the frames of the clip."""
    if member.is_even:
        return times_at(frames, recipe.step(member))
    assert recipe.rate is not None
    part = timeline_of_member(clip, member)
    _, locate = frames_within(part, recipe.rate, (0, member.n_source))
    return locate(frames)


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
    follows the previous one by 1 / ``source_rate``; else the clip has its time.
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
