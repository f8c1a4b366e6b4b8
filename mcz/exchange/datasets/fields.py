"""Fields of data sets: a name, a shape, and the computation from poses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import MotionError, OptionError
from mcz.kinematics.chain import Floats
from mcz.kinematics.frames import FramePoses
from mcz.kinematics.poses.conversions import from_matrices
from mcz.kinematics.poses.motion_like import joint_numbers, scale_to
from mcz.kinematics.poses.trajectories import (
    accelerations_of,
    chosen_points,
    point_names,
    velocities_of,
)
from mcz.model.motion import Skeleton
from mcz.model.skeleton import Joints, joint_columns
from mcz.model.text_format import nearest
from mcz.model.types import Reals


@dataclass(frozen=True, slots=True)
class Subject:
    """A skeleton as the fields of a data set look at it.

    ``joints`` and ``points`` are those that were chosen, by index; ``scale`` times a length unit is
    the unit that is wanted.
    """

    skeleton: Skeleton
    poses: FramePoses | None  # None: no field needs them
    joints: tuple[int, ...]
    points: tuple[int, ...]
    scale: float

    @property
    def columns(self) -> list[int]:
        return joint_columns(self.skeleton, self.joints)

    @property
    def kinematics(self) -> FramePoses:
        assert self.poses is not None
        return self.poses


class Rows(NamedTuple):
    """Channels of frames, (n_frames, n_channels), and the seconds from each frame to the next."""

    values: Floats
    steps: Floats


@dataclass(frozen=True, slots=True)
class Field:
    """One array of a window.

    ``shape`` is what follows (n_frames, ...); ``names`` what its first such axis is of: "joints",
    "points", "channels" or "". ``make`` takes the values of all channels.
    ``reach``: how many neighbours on either side it looks at; ``needs``: the joints whose channels
    matter. ``lengths``: it is in length units, to be scaled. ``signed``:
    quaternions, whose signs follow from a whole window.
    """

    name: str
    names: str
    shape: Callable[[Subject], tuple[int, ...]]
    make: Callable[[Subject, Rows], Floats]
    needs: Callable[[Subject], Iterable[int]]
    reach: int = 0
    posed: bool = True
    lengths: bool = False
    signed: bool = False

    def __reduce__(self) -> tuple[object, ...]:
        return field_called, (self.name,)


def field_called(name: str) -> Field:
    """The field of that name; raises KeyError."""
    return FIELDS[name]


def _above_points(subject: Subject) -> list[int]:
    poses = subject.kinematics
    return poses.above(poses.joints_of(subject.points))


def _positions(subject: Subject, rows: Rows) -> Floats:
    return subject.kinematics.positions(rows.values, subject.points) * subject.scale


def _root(subject: Subject, rows: Rows) -> Floats:
    return subject.kinematics.origins(rows.values, [0])[:, 0] * subject.scale


def _velocities(subject: Subject, rows: Rows) -> Floats:
    return velocities_of(_positions(subject, rows), rows.steps)


def _accelerations(subject: Subject, rows: Rows) -> Floats:
    return accelerations_of(_positions(subject, rows), rows.steps)


def _n_points(subject: Subject) -> tuple[int, ...]:
    return len(subject.points), 3


def _turned(name: str, form: str, tail: tuple[int, ...], world: bool) -> Field:
    """A field of rotations of the chosen joints."""

    def make(subject: Subject, rows: Rows) -> Floats:
        poses = subject.kinematics
        turns = (poses.world if world else poses.local)(rows.values, subject.joints)
        return from_matrices(turns, form)

    return Field(
        name,
        "joints",
        lambda subject: (len(subject.joints), *tail),
        make,
        (lambda subject: subject.kinematics.above(subject.joints))
        if world
        else (lambda subject: subject.joints),
        signed=form == "quat",
    )


_FORMS = {
    "rot6d": ("6d", (6,)),
    "quat": ("quat", (4,)),
    "rotvec": ("rotvec", (3,)),
    "matrix": ("matrix", (3, 3)),
}
_FIELDS = [
    Field(
        "channels",
        "channels",
        lambda subject: (len(subject.columns),),
        lambda subject, rows: rows.values[:, subject.columns],
        lambda subject: subject.joints,
        posed=False,
    ),
    Field("positions", "points", _n_points, _positions, _above_points, lengths=True),
    Field("velocities", "points", _n_points, _velocities, _above_points, 1, lengths=True),
    Field("accelerations", "points", _n_points, _accelerations, _above_points, 2, lengths=True),
    Field("root", "", lambda _: (3,), _root, lambda _: (0,), lengths=True),
    *(_turned(name, *form, world=False) for name, form in _FORMS.items()),
    *(_turned(f"world_{name}", *form, world=True) for name, form in _FORMS.items()),
]
FIELDS = {field.name: field for field in _FIELDS}


def chosen_fields(names: str | Iterable[str]) -> tuple[Field, ...]:
    """The fields of these names, a list or a text with commas; raises OptionError."""
    listed = [n.strip() for n in names.split(",")] if isinstance(names, str) else list(names)
    if not listed or len(set(listed)) != len(listed):
        raise OptionError(f"fields {names!r}: each once, and at least one")
    for name in listed:
        if name not in FIELDS:
            near = nearest(str(name), FIELDS)
            hint = f"; did you mean {near}?" if near else ""
            raise OptionError(f"field {name!r} is not one of {', '.join(FIELDS)}{hint}")
    return tuple(FIELDS[name] for name in listed)


def subject_of(
    skeleton: Skeleton, fields: Iterable[Field], joints: Joints, unit: str | None, is_timed: bool
) -> Subject:
    """``skeleton`` as these fields look at it; raises MotionError and OptionError."""
    from mcz.kinematics.frames import frame_poses_of

    posed = any(field.posed for field in fields)
    lengths = any(field.lengths for field in fields)
    if not is_timed and any(field.reach for field in fields):
        raise OptionError("velocities and accelerations need a frame rate (source_rate=)")
    return Subject(
        skeleton,
        frame_poses_of(skeleton) if posed else None,
        tuple(joint_numbers(skeleton, joints)),
        tuple(chosen_points(skeleton, joints)) if lengths else (),
        scale_to(skeleton, unit) if lengths else 1.0,
    )


def names_of(field: Field, subject: Subject) -> tuple[str, ...]:
    """Names along the first axis after the frames, () for none."""
    skeleton = subject.skeleton
    if field.names == "points":
        names = point_names(skeleton)
        return tuple(names[point] for point in subject.points)
    addresses = skeleton.addresses()
    if field.names == "joints":
        return tuple(addresses[joint] for joint in subject.joints)
    if field.names == "channels":
        return tuple(
            f"{addresses[joint]}.{channel.label}"
            for joint in subject.joints
            for channel in skeleton.joints[joint].channels
        )
    return ()


def features_of(
    fields: Iterable[Field],
    subject: Subject,
    rows: Rows,
    margins: tuple[int, int],
    dtype: DTypeLike,
) -> dict[str, Reals]:
    """The arrays of frames, of whose ``rows`` there are ``margins`` more before and after."""
    values, steps = rows
    first, last = margins
    found = {}
    for field in fields:
        low, high = max(0, first - field.reach), max(0, last - field.reach)
        stop = len(values) - high
        made = field.make(subject, Rows(values[low:stop], steps[low : max(low, stop - 1)]))
        stop = len(made) - (last - high)
        part = made[first - low : stop]
        with np.errstate(over="ignore"):
            found[field.name] = np.ascontiguousarray(part, dtype)
        if np.isinf(found[field.name]).any() and not np.isinf(part).any():
            raise MotionError(
                f"{field.name}: a value is beyond {np.dtype(dtype)}; give another dtype"
            )
    return found
