"""Interpretation of the arrays of a file: the motion, further signals, the frame rate.

Nothing here is normative: a template says where each column went.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

import numpy as np

from mcz.errors import SourceError
from mcz.model.clock import times_fault
from mcz.model.motion import Channel, Joint, Skeleton
from mcz.model.types import Items
from mcz.sources.arrays.body import Body, body_of
from mcz.sources.arrays.facts import (
    BODY_NAMES,
    JOINT_NAMES,
    JOINTS,
    SHAPE,
    TIMES,
    facts_of,
    names_of,
    rate_of,
)
from mcz.sources.arrays.files import DEFLATED, STAYS, Array

MAX_PER_FRAME = 1000  # rows a frame of an array that is longer than the motion


@dataclass(frozen=True, slots=True)
class Part:
    """A signal to be: ``words`` are arrays (rows, columns), whose columns it has in order."""

    name: str
    words: list[Items]
    per_frame: int = 1
    channels: tuple[Channel, ...] | None = None
    role: str = ""


@dataclass
class Meaning:
    """The signals, and of each array in one of them its signal and the channels of its columns."""

    skeleton: Skeleton
    rate: Fraction | None
    rate_is_exact: bool
    metadata: dict[str, str]
    parts: list[Part] = field(default_factory=list)
    places: dict[int, tuple[int, Sequence[int]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def has_times(self) -> bool:
        return any(part.role == "times" for part in self.parts)


def meaning_of(arrays: Sequence[Array]) -> Meaning:
    """Interpret the arrays of a file; raises SourceError if none of them is a motion."""
    body = body_of(arrays)
    n_frames = body.n_frames if body is not None else _frames_of(arrays)
    rate, exact, odd = rate_of(arrays, n_frames)
    skeleton = body.skeleton if body is not None else Skeleton((), angle_unit="")
    meaning = Meaning(skeleton, rate, exact, facts_of(arrays), notes=odd)
    if body is not None:
        _add_body(meaning, body)
    else:
        _add_motion(meaning, arrays, n_frames)
    for index, array in enumerate(arrays):
        if index in meaning.places or array.kept or array.name == SHAPE:
            continue
        per_frame, rest = divmod(len(array.numbers), n_frames)
        if rest or per_frame > (1 if n_frames < 2 else MAX_PER_FRAME) or not per_frame:
            if array.is_large:
                shape = "x".join(map(str, array.head.shape))
                meaning.notes.append(f"{array.name} has {shape} numbers, and is kept as its bytes")
            continue
        place = len(meaning.parts), range(array.numbers.shape[1])
        meaning.places[index] = place
        channels, role = _channels(array, arrays), ""
        if per_frame == 1 and channels[0].unit == "s" and not meaning.has_times:
            fault = times_fault(array.numbers[:, 0].astype(np.float64))
            role = "" if fault else "times"
            meaning.notes += [f"the times do not count: {fault}"] if fault else []
        part = Part(array.name, [array.numbers], per_frame, channels, role)
        meaning.parts.append(part)
    return meaning


def _add_body(meaning: Meaning, body: Body) -> None:
    meaning.parts.append(Part("motion", body.words, role="motion"))
    meaning.places |= {index: (0, columns) for index, columns in body.places.items()}


def _frames_of(arrays: Sequence[Array]) -> int:
    """The number of frames: that of the times, else the longest first axis of joints."""
    numbers = [array for array in arrays if not array.kept]
    times = [array.n_rows for array in numbers if array.name in TIMES and len(array.head.shape) < 2]
    if times and any(array.n_rows == times[0] for array in numbers if array.name not in TIMES):
        return times[0]
    for n_axes in (3, 2):  # a mesh or a model has rows, too, but seldom three axes
        rows = [array.n_rows for array in numbers if len(array.head.shape) >= n_axes]
        if rows:
            return max(rows)
    raise SourceError("; ".join(("no array has a row for each frame", *_reasons(arrays))))


def _reasons(arrays: Sequence[Array]) -> list[str]:
    """Reasons why the first arrays are no motion."""
    if len(arrays) > 1 and all(STAYS in array.kept for array in arrays):
        again = "numpy.savez(path, **numpy.load(other)) stores it anew"
        return [f"all of its {len(arrays)} members are {DEFLATED}: {again}"]
    shown = arrays[:4]
    reasons = [f"{a.name!r} is {a.kept or f'of shape {a.head.shape}'}" for a in shown]
    return [*reasons, "..."] if len(arrays) > len(shown) else reasons


def _add_motion(meaning: Meaning, arrays: Sequence[Array], n_frames: int) -> None:
    """Add the array that is the motion: joint angles of a robot, else that of the most axes.

    It is the first of several.
    """
    fit = [
        (_is_robot(array), min(len(array.head.shape), 3), -index)
        for index, array in enumerate(arrays)
        if not array.kept and array.n_rows == n_frames and array.name not in TIMES
    ]
    if not fit:
        raise SourceError("; ".join((f"no array of {n_frames} frames", *_reasons(arrays))))
    index = -max(fit)[2]
    array = arrays[index]
    meaning.parts.append(Part("motion", [array.numbers], role="motion"))
    meaning.places[index] = 0, range(array.numbers.shape[1])
    joints = plain_joints(array.head.shape[1:], array.name)
    if _is_robot(array):
        channel = Channel("", "value", JOINTS[array.name])
        names = names_of(arrays, JOINT_NAMES)
        if len(names) != len(joints):
            names = tuple(joint.name for joint in joints)
        joints = tuple(Joint(name, channels=(channel,)) for name in names)
    meaning.skeleton = Skeleton(joints, angle_unit="")


def _is_robot(array: Array) -> bool:
    """Return True for the joint angles of a robot, a column for each joint."""
    return JOINTS.get(array.name) == "rad" and len(array.head.shape) == 2


def plain_joints(inner: Sequence[int], name: str) -> tuple[Joint, ...]:
    """Joints of plain scalars, named by number: one for each index of the second axis."""
    if not inner:
        return (Joint(name, channels=(Channel("", "value"),)),)
    if len(inner) == 1:
        channels: tuple[Channel, ...] = (Channel("", "value"),)
    else:
        channels = tuple(Channel("", label) for label in labels(inner[1:]))
    return tuple(Joint(str(number), channels=channels) for number in range(inner[0]))


def labels(inner: Sequence[int]) -> list[str]:
    """Names of the numbers of a row: their indices, with blanks between."""
    return [" ".join(map(str, indices)) for indices in product(*map(range, inner))]


def _channels(array: Array, arrays: Sequence[Array]) -> tuple[Channel, ...]:
    """The channels of a signal of its own, named by the joints or bodies that ``arrays`` list."""
    inner = array.head.shape[1:]
    joints, bodies = (names_of(arrays, keys) for keys in (JOINT_NAMES, BODY_NAMES))
    if array.name in JOINTS and inner == (len(joints),):
        return tuple(Channel("", name, JOINTS[array.name]) for name in joints)
    if array.name.startswith("body_") and inner[:1] == (len(bodies),):
        ends = [f" {label}".rstrip() for label in labels(inner[1:])]
        return tuple(Channel("", name + end) for name in bodies for end in ends)
    if not inner:
        is_time = array.name in TIMES and array.head.code.startswith("f")
        return (Channel("", array.name, "s" if is_time else ""),)
    return tuple(Channel("", label) for label in labels(inner))
