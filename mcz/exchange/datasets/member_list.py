"""``dataset``: which clips there are, and whether they go together."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import MczError, OptionError
from mcz.exchange.datasets.feature_blocks import DatasetSettings, to_size
from mcz.exchange.datasets.fields import SignalShape, Units, names_of
from mcz.exchange.datasets.open_files import MOST_OPEN, Member, Recipe, recipe_of
from mcz.exchange.datasets.windows import Dataset
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where, filter_clips
from mcz.files.reading.file import File, is_source, open
from mcz.kinematics.poses.resampling import (
    MOST_VALUES,
    count_resampled_frames,
    frames_within,
    too_many_frames_error,
)
from mcz.model.checks import check_arguments
from mcz.model.clock import Timeline
from mcz.model.motion import frame_rate_of
from mcz.model.skeleton import Joints
from mcz.model.types import JsonObject

Target = str | os.PathLike[str] | File


@check_arguments()
def dataset(
    target: Target | Iterable[Target],
    fields: str | Iterable[str] = "rot6d,positions,root",
    *,
    rate: Fraction | float | None = None,
    window: int | None = None,
    stride: int | None = None,
    where: Where | None = None,
    joints: Joints = None,
    unit: str | None = None,
    up: str | None = None,
    dtype: DTypeLike = "float32",
    source_rate: Fraction | float | None = None,
    cache: int | str = "256 MB",
    folder: str | os.PathLike[str] | None = None,
    across_gaps: bool = False,
    normalize: bool = False,
) -> Dataset:
    """Windows of the clips of MCZ files, as arrays: a ``Dataset``.

    ``target``: an archive, a folder (all ``.mcz`` below it, by name), an open File, or several.
    ``fields``: names, with commas or as a list: channels, positions, velocities, accelerations,
    root, rot6d, quat, rotvec, matrix, heading, foot_speed, contacts, humanml3d and more, or the
    name of any signal; docs/guides/datasets.md has their shapes. ``rate``: all are resampled to it,
    exactly if every n-th frame will do; ``source_rate`` is that of clips that do not say theirs.
    ``window`` frames each, every ``stride`` (as many, if None); None: whole clips. ``where``
    chooses clips: an expression as in ``File.find``, or a function of a Clip. ``joints`` and
    ``unit`` as in ``positions``; ``up`` is the up axis of skeletons that do not state it.
    ``normalize``: see ``Dataset.normalized``.
    ``cache``: bytes to keep in memory, or in ``folder``, across runs: "256 MB".

    If frames are missing, the parts between are clips of their own, so that no window spans a
    gap, unless ``across_gaps``. Clips too short for a window are listed in ``Dataset.skipped``.
    Raises OptionError if clips do not go together: other joints, rates or units; MotionError and
    FormatError if one cannot be used.
    """
    recipe = _recipe(fields, rate, joints, Units(unit, up), dtype)
    window, stride = _cut(window, stride)
    open_files: dict[str, File] = {}
    size = to_size(cache)
    settings = DatasetSettings(
        recipe, window, stride, size, None if folder is None else Path(folder)
    )
    assumed = None if source_rate is None else frame_rate_of(source_rate, "source_rate")
    agreement = _Agreement(recipe)
    members: list[Member] = []
    skipped: list[Member] = []
    with ExitStack() as stack:
        opened: dict[str, File] = {}
        for file, name in _files(target, open_files):
            if name not in open_files:
                stack.enter_context(file)
                opened[name] = file
            clips = file.clips.values()
            for clip in clips if where is None else filter_clips(clips, where, clips):
                for member in _members(clip, name, recipe, assumed, across_gaps):
                    if member.n_frames < (window or 1):
                        skipped.append(member)
                        continue
                    agreement.check(clip, member)
                    members.append(member)
            if len(opened) > MOST_OPEN:
                opened.pop(name).close()
        if not members:
            raise OptionError(_reason_of_none(skipped, window, where))
        stack.pop_all()
    result = Dataset(settings, members, open_files, skipped)
    result.adopt(opened)
    return result.normalized() if normalize else result


def _reason_of_none(skipped: Sequence[Member], window: int | None, where: object) -> str:
    if not skipped:
        return "no clip in the given files" + ("" if where is None else " matches where")
    longest = max(member.n_frames for member in skipped)
    length = "" if window is None else f" of at least {window} frames at this rate"
    return f"no clip{length} in the given files; the longest chosen has {longest}"


def _recipe(
    fields: str | Iterable[str],
    rate: Fraction | float | None,
    joints: Joints,
    units: Units,
    dtype: DTypeLike,
) -> Recipe:
    kind = np.dtype(dtype)
    if kind not in (np.float16, np.float32, np.float64):
        raise OptionError(f"dtype is {kind}; it must be float16, float32 or float64")
    exact = None if rate is None else frame_rate_of(rate, "rate")
    names = joints if joints is None or isinstance(joints, (str, int)) else tuple(joints)
    return recipe_of(fields, exact, names, units, kind)


def _cut(window: int | None, stride: int | None) -> tuple[int | None, int]:
    if window is not None and window < 1:
        raise OptionError(f"window is {window} frames; it must be at least 1")
    if stride is not None and (stride < 1 or window is None):
        raise OptionError(f"stride is {stride} frames, which does not fit windows of {window}")
    return window, stride or window or 1


def _files(
    target: Target | Iterable[Target], open_files: dict[str, File]
) -> Iterator[tuple[File, str]]:
    """The files, each with its argument for ``mcz.open``; adds open ones to ``open_files``."""
    several = isinstance(target, Iterable) and not isinstance(target, (str, os.PathLike, File))
    for one in target if several else [target]:  # type: ignore[union-attr]
        if isinstance(one, File):
            name = one.name if one.name not in open_files else f"{one.name} ({len(open_files) + 1})"
            open_files[name] = one
            yield one, name
            continue
        if not isinstance(one, (str, os.PathLike)):
            raise OptionError(
                f"target is {one!r}; it must be a path, an open File, or a list of them"
            )
        path = os.fspath(one)
        paths = [path]
        if Path(path).is_dir():
            paths = sorted(str(file) for file in Path(path).rglob("*.mcz"))
            if not paths:
                raise OptionError(
                    "the folder contains no .mcz file; make one with mcz pack", path=path
                )
        for name in paths:
            if is_source(name):
                raise OptionError(
                    f"{name}: a data set reads only .mcz files; make one with mcz pack"
                )
            yield open(name, threads=1), name


def _members(
    clip: Clip, target: str, recipe: Recipe, assumed: Fraction | None, across_gaps: bool
) -> Iterator[Member]:
    """The parts of a clip between gaps, at the rate of the data set."""
    own = clip.frame_rate or assumed
    if own and clip.n_frames and clip.counts_evenly:  # nearly always, and quick
        even = Member(target, clip.name, clip.n_frames, own, clip.n_frames, time=0.0)
        if recipe.rate is not None:
            even = replace(even, n_frames=_resampled_frames(even, None, recipe.rate))
        yield even
        return
    timeline = clip.timeline_at(assumed)
    runs = [(0, clip.n_frames)] if timeline is None or across_gaps else timeline.runs
    for start, stop in runs or [(0, 0)]:
        n_frames = stop - start
        member = Member(target, clip.name, n_frames, own, n_frames, start)
        part = timeline.cut(slice(start, stop)) if timeline is not None and n_frames else None
        if part is not None and timeline is not None:
            is_even = part.ticks is not None and bool((np.diff(part.ticks) == 1).all())
            time = float(timeline.regular_times[start])
            member = replace(member, time=time, is_even=is_even)
        if recipe.rate is not None:
            member = replace(member, n_frames=_resampled_frames(member, part, recipe.rate))
        yield member


def _resampled_frames(member: Member, part: Timeline | None, rate: Fraction) -> int:
    """The number of frames at ``rate`` of the clip whose times are ``part``."""
    if part is not None and not member.is_even:
        frames, _ = frames_within(part, rate, (0, member.n_source))
        if frames.stop > MOST_VALUES:
            raise too_many_frames_error(part, rate)
        return len(frames)
    if member.source_rate is None:
        raise OptionError(
            "its frame rate is unknown; set it with source_rate=",
            path=member.target,
            clip=member.clip,
        )
    return count_resampled_frames(member.n_source, member.source_rate, rate)


class _Agreement:
    """Facts of the first clip that all others must share."""

    def __init__(self, recipe: Recipe) -> None:
        self._recipe = recipe
        self._first: tuple[Member, JsonObject] | None = None
        self._known: set[tuple[object, ...]] = set()

    def check(self, clip: Clip, member: Member) -> None:
        """Raises OptionError if ``clip`` differs from the first."""
        key = member.target, *self._recipe.subject_key(clip, member)
        if key in self._known:
            return
        self._known.add(key)
        facts_of_member = self._facts(clip, member)
        if self._first is None:
            self._first = member, facts_of_member
            return
        first, facts = self._first
        for fact, advice in ADVICE.items():
            if facts[fact] != facts_of_member[fact]:
                values = facts_of_member[fact], facts[fact]
                raise OptionError(
                    f"{member.label} has {_fact_text(*values)}, {first.label} has "
                    f"{_fact_text(*values[::-1])}: {fact} differ; {advice}"
                )

    def _facts(self, clip: Clip, member: Member) -> JsonObject:
        recipe = self._recipe
        try:
            subject = recipe.subject(clip, member)
        except MczError as error:
            error.add(path=member.target, clip=member.clip)
            raise
        lengths = any(field.lengths for field in recipe.fields) and recipe.units.length is None
        return {
            "frame rates": None if recipe.rate else member.source_rate,
            "length units": clip.skeleton.unit_cm if lengths else None,
            "joints": [names_of(field, subject) for field in recipe.fields if not field.signal],
            "signals": [subject.signals[each.name] for each in recipe.fields if each.signal],
        }


ADVICE = {
    "frame rates": "give one to resample to with rate=",
    "length units": "give one with unit=",
    "joints": "choose those that all have with joints=, or clips with where=",
    "signals": "choose clips with where=",
}


def _fact_text(fact: object, other: object) -> str:
    """A fact in words; for names, the first three that differ from ``other``."""
    if isinstance(fact, list) and isinstance(other, list):
        names, others = _names(fact), _names(other)
        pairs = zip_longest(names, others)
        differing = [name for name, there in pairs if name not in (None, there)]
        return f"{len(names)} names ({', '.join((differing or names)[:3])} ...)"
    return "none" if fact is None else str(fact)


def _names(parts: list[Any]) -> list[str]:
    names = [part.channels if isinstance(part, SignalShape) else part for part in parts]
    return list(chain.from_iterable(names))
