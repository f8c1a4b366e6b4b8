"""Contacts: in which frames a foot stands. docs/guides/contacts.md is normative.

A foot stands where its point is slow and near its lowest height. Each limit has two thresholds,
against flicker: a run below the wider ones is a contact if it is below both narrower ones in some
frame.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.hints import Hint
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.points import first_points, positions_of
from mcz.model.checks import ArgumentType, check_arguments
from mcz.model.motion import A_MOTION, Motion, Skeleton
from mcz.model.skeleton import column_of, joint_list, signs_of
from mcz.model.text_format import count_text, fields_text, named
from mcz.model.types import Bools, Floats

USUAL_RATE = 120.0  # assumed frames a second: the rate of CMU's AMC files
AXES = "xyz"
BLOCK = 2**19  # numbers that are worked on at a time


@dataclass(frozen=True, slots=True)
class ContactRule:
    """Thresholds of a contact: speeds in cm/s, heights in cm, times in seconds.

    ``speed`` is averaged over ``window``; ``height`` is above the percentile ``floor`` of all
    heights of that point. A contact lasts while below ``wide_speed`` and ``wide_height``. Pauses of
    up to ``pause`` are closed; then contacts shorter than ``least`` are dropped.
    """

    speed: float = 15.0
    wide_speed: float = 30.0
    height: float = 6.0
    wide_height: float = 8.0
    floor: float = 5.0
    window: float = 1 / 30
    gap: float = 0.025
    least: float = 0.1


RULE = ContactRule()
A_RULE = ArgumentType("a ContactRule", lambda value: isinstance(value, ContactRule))


@dataclass(frozen=True, slots=True)
class Contact:
    """Frames ``first`` <= f < ``first + n_frames`` in which the point of ``joint`` stands."""

    joint: str
    first: int
    n_frames: int


@dataclass(frozen=True, slots=True)
class Contacts:
    """All contacts of a motion, joint by joint in the order of the skeleton, each in time order.

    ``joints`` are the examined joints, as ``Skeleton.addresses`` names them. ``up_axis`` is "x" to
    "-z", and ``up_guessed`` if the skeleton does not state it; ``rate_assumed`` if
    ``frame_rate`` is 120 because no rate is known. Raises MotionError if a run is of another
    joint or beyond the frames.
    """

    runs: tuple[Contact, ...]
    joints: tuple[str, ...]
    n_frames: int
    up_axis: str = ""
    up_guessed: bool = False
    frame_rate: float = USUAL_RATE
    rate_assumed: bool = False

    __repr__ = fields_text

    def __post_init__(self) -> None:
        for run in self.runs:
            last = run.first + run.n_frames
            if run.joint not in self.joints or not 0 <= run.first < last <= self.n_frames:
                raise MotionError(f"{run} does not fit {self.n_frames} frames of {self.joints}")

    def frames(self, joint: str) -> Bools:
        """Contact state of ``joint`` in every frame, bool (n_frames,).

        Raises MotionError if that joint was not examined.
        """
        if joint not in self.joints:
            known = ", ".join(self.joints)
            raise MotionError(f"joint {joint!r} is not among the examined feet: {known}")
        standing = np.zeros(self.n_frames, np.bool_)
        for run in self.runs:
            if run.joint == joint:
                standing[run.first : run.first + run.n_frames] = True
        return standing


@check_arguments(motion=A_MOTION, rule=A_RULE)
def contacts(
    motion: Motion, joints: Sequence[int | str] | None = None, rule: ContactRule = RULE
) -> Contacts:
    """The frames of ``motion`` in which feet stand, by the rule of docs/guides/contacts.md.

    ``joints`` are the feet, by index or name; None takes feet by their names, ``LeftFoot``,
    ``ltoes`` and the like. The first point of a joint decides. An up axis or a frame rate that is
    unknown is guessed, and marked in the result. If a position is unknown, there is no contact.
    Each part between two breaks in time is examined separately.

    Raises MotionError if there is no such joint, no foot by name or no kinematics, and
    OptionError if the length unit is unknown.
    """
    skeleton, signal = motion.skeleton, motion.signals[0]
    if not signal.has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )
    tracks = FootTracks(skeleton, joints, motion.n_frames)
    step = max(1, BLOCK // max(1, skeleton.n_channels + 12 * skeleton.n_joints))
    for start in range(0, motion.n_frames, step):
        block = signal.cut(start, min(start + step, motion.n_frames))
        rows = block.masked()[:: signal.samples_per_frame].astype(np.float64, copy=False)
        tracks.add(start, positions_of(skeleton, rows))
    rate = None if motion.frame_rate is None else float(motion.frame_rate)
    runs = None if motion.timeline is None else motion.timeline.runs
    return tracks.contacts(rate, skeleton.up_axis, rule, runs)


class FootTracks:
    """Foot positions in every frame, collected from blocks of point positions.

    ``joints`` and errors as in ``contacts``. ``feet`` is float64 (n_feet, n_frames, 3), ``body``
    the mean of all known points, float64 (n_frames, 3), both in length units.
    """

    def __init__(
        self, skeleton: Skeleton, joints: Sequence[int | str] | None, n_frames: int
    ) -> None:
        indices = (
            find_feet(skeleton)
            if joints is None
            else [skeleton.find(j) for j in joint_list(joints)]
        )
        if not indices:
            raise MotionError(
                f"{named('skeleton', skeleton.name)}: none of its "
                f"{count_text(skeleton.n_joints, 'joint')} is named like a foot",
                hint=Hint.FEET,
            )
        if skeleton.unit_cm is None:
            raise OptionError(
                f"the length unit of {named('skeleton', skeleton.name)} is unknown, but contacts "
                "are detected by speed in cm/s",
                hint=Hint.UNIT,
            )
        addresses, firsts = skeleton.addresses(), first_points(skeleton)
        self.joints = tuple(addresses[joint] for joint in dict.fromkeys(indices))
        self.unit_cm = skeleton.unit_cm
        self._points = [firsts[joint] for joint in dict.fromkeys(indices)]
        self.feet = np.full((len(self._points), n_frames, 3), np.nan)
        self.body = np.full((n_frames, 3), np.nan)

    def add(self, start: int, points: Floats) -> None:
        """Add positions of all points, (frames, n_points, 3), from frame ``start`` on."""
        frames = slice(start, start + len(points))
        self.body[frames] = _means(points)
        for foot, point in enumerate(self._points):
            self.feet[foot, frames] = points[:, point]

    def contacts(
        self,
        rate: float | None,
        up_axis: str,
        rule: ContactRule = RULE,
        runs: Sequence[tuple[int, int]] | None = None,
    ) -> Contacts:
        """The contacts; ``rate`` in frames a second, None and "" are unknown.

        ``runs`` are the frames a <= f < b between breaks in time, None: all.
        """
        up = up_axis or self.guess_up_axis()
        frame_rate = rate or USUAL_RATE
        parts = runs or [(0, self.feet.shape[1])]
        with np.errstate(over="ignore"):  # overflow is unknown
            places = self.feet * (self.unit_cm * signs_of(up))
        return Contacts(
            runs=tuple(
                Contact(joint, start + first, n_frames)
                for joint, track in zip(self.joints, places, strict=True)
                for floor in [lowest_height(track, column_of(up), rule)]
                for start, stop in parts
                for first, n_frames in find_runs(
                    track[start:stop], frame_rate, column_of(up), rule, floor
                )
            ),
            joints=self.joints,
            n_frames=self.feet.shape[1],
            up_axis=up,
            up_guessed=not up_axis,
            frame_rate=frame_rate,
            rate_assumed=rate is None,
        )

    def guess_up_axis(self) -> str:
        """The axis along which the body is farthest from its feet, on average; "y" if none is."""
        with np.errstate(all="ignore"):
            differences = self.body - self.feet
            known = np.isfinite(differences).all(axis=2)
            means = np.abs(differences[known].sum(axis=0))
        return AXES[int(means.argmax())] if np.nanmax(means) > 0 else "y"


def _means(points: Floats) -> Floats:
    """The mean over the known points of a frame, NaN without any, (frames, 3)."""
    with np.errstate(all="ignore"):
        means: Floats = points.sum(axis=1) / points.shape[1]
        if not np.isfinite(means).all():  # the search for unknown points is slower
            known: Bools = np.asarray(np.isfinite(points).all(axis=2))
            sums = np.where(known[..., None], points, 0.0).sum(axis=1)
            means = sums / known.sum(axis=1)[:, None]
    return means


def lowest_height(track: Floats, up: int, rule: ContactRule = RULE) -> float | None:
    """The height of a point at its lowest, None if it is never known."""
    known: Bools = np.asarray(np.isfinite(track).all(axis=1))
    return float(np.percentile(track[known, up], rule.floor)) if known.any() else None


def find_runs(
    track: Floats, rate: float, up: int, rule: ContactRule = RULE, floor: float | None = None
) -> Iterator[tuple[int, int]]:
    """First frame and number of frames of every contact of one point.

    ``track`` has its positions in cm, float64 (n_frames, 3), NaN if unknown; ``up`` is the
    column of the up axis, ``rate`` in frames a second, ``floor`` a ``lowest_height``; None: the one
    of this track.
    """
    known: Bools = np.asarray(np.isfinite(track).all(axis=1))
    if not known.any():
        return
    with np.errstate(all="ignore"):  # overflow is no contact
        speed = speeds(track, rate, rule.window)
        lowest = np.percentile(track[known, up], rule.floor) if floor is None else floor
        height = track[:, up] - lowest
        surely = (speed < rule.speed) & (height < rule.height)
        perhaps = (speed < rule.wide_speed) & (height < rule.wide_height)
    for first, stop in _join_runs(perhaps, known, frames_in(rule.gap, rate)):
        if stop - first >= max(2, frames_in(rule.least, rate)) and surely[first:stop].any():
            yield first, stop - first


def speeds(track: Floats, rate: float, window: float) -> Floats:
    """The speed of a point, from its positions half a ``window`` before and after, in units/s.

    ``track`` is (n_frames, 3); the result (n_frames,), NaN if one of the positions is unknown.
    """
    half = min(max(1, frames_in(window / 2, rate)), len(track))
    frames = np.arange(len(track))
    before, after = np.maximum(frames - half, 0), np.minimum(frames + half, len(track) - 1)
    x, y, z = (track[after] - track[before]).T
    result: Floats = np.sqrt(x * x + y * y + z * z) * rate / (after - before)
    return result


def frames_in(seconds: float, rate: float) -> int:
    """The nearest whole number of frames; ties: the greater."""
    return int(np.floor(seconds * rate + 0.5))


def _join_runs(flags: Bools, known: Bools, pause: int) -> Iterator[tuple[int, int]]:
    """First frame and end of every run of ``flags``, joined over pauses of up to ``pause`` frames.

    All frames of a pause must be ``known``.
    """
    edges = np.flatnonzero(np.diff(flags, prepend=False, append=False)).tolist()
    runs: list[tuple[int, int]] = []
    for first, stop in zip(edges[::2], edges[1::2], strict=True):
        if runs and first - runs[-1][1] <= pause and known[runs[-1][1] : first].all():
            runs[-1] = runs[-1][0], stop
        else:
            runs.append((first, stop))
    yield from runs
