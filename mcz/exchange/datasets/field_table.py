"""Fields of data sets: ``FIELDS``, every signal by its name, and what they use of a clip."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from mcz.errors import OptionError
from mcz.exchange.datasets.fields import WHOLE, Field, SignalShape, Subject, SubjectRows, Units
from mcz.exchange.datasets.humanml import JOINTS, N_FEATURES, humanml3d
from mcz.files.reading.clip import Clip
from mcz.hints import Hint
from mcz.kinematics.contacts import FootTracks
from mcz.kinematics.frames import frame_poses_of, joint_numbers, scale_to
from mcz.kinematics.points import point_names
from mcz.kinematics.poses.conversions import from_matrices
from mcz.kinematics.poses.trajectories import accelerations_of, find_points, velocities_of
from mcz.kinematics.rotations import matrices_of_vectors
from mcz.model.motion import Skeleton
from mcz.model.skeleton import Joints, column_of, signs_of
from mcz.model.text_format import named, suggest_names
from mcz.model.types import Floats
from mcz.model.units import with_axes

Make = Callable[[Subject, SubjectRows], Floats]
FORMS = {
    "rot6d": ("6d", (6,)),
    "quat": ("quat", (4,)),
    "rotvec": ("rotvec", (3,)),
    "matrix": ("matrix", (3, 3)),
}
SIGNAL = "signal:"  # before the name of a signal that is also the name of a field


def find_field(name: str) -> Field:
    """The field of that name: one of ``FIELDS``, else a signal."""
    return FIELDS.get(name) or _signal(name)


def parse_fields(names: str | Iterable[str]) -> tuple[Field, ...]:
    """The fields of these names, a list or a text with commas; raises OptionError."""
    entries = [n.strip() for n in names.split(",")] if isinstance(names, str) else list(names)
    if not entries or len(set(entries)) != len(entries) or not all(entries):
        raise OptionError(f"fields is {names!r}; name at least one field, and none twice")
    return tuple(find_field(str(name)) for name in entries)


def _signal(name: str) -> Field:
    def shape(subject: Subject) -> tuple[int, ...]:
        signal = subject.signals[name]
        several = signal.samples_per_frame > 1
        return (signal.samples_per_frame,) * several + (len(signal.channels),)

    return Field(
        name,
        "signal",
        shape,
        lambda subject, rows: rows.signals[name],
        lambda subject: (),
        posed=False,
        signal=name.removeprefix(SIGNAL),
    )


def _above_points(subject: Subject) -> list[int]:
    poses = subject.kinematics
    return poses.above(poses.joints_of(subject.points))


def _above_root_and_points(subject: Subject) -> list[int]:
    return [0, *_above_points(subject)]


def _positions(subject: Subject, rows: SubjectRows) -> Floats:
    return subject.kinematics.positions(rows.values, subject.points) * subject.scale


def _root(subject: Subject, rows: SubjectRows) -> Floats:
    return subject.kinematics.origins(rows.values, [0])[:, 0] * subject.scale


def _velocities(subject: Subject, rows: SubjectRows) -> Floats:
    return velocities_of(_positions(subject, rows), rows.steps)


def _accelerations(subject: Subject, rows: SubjectRows) -> Floats:
    return accelerations_of(_positions(subject, rows), rows.steps)


def _n_points(subject: Subject) -> tuple[int, ...]:
    return len(subject.points), 3


def _foot_speed(subject: Subject, rows: SubjectRows) -> Floats:
    places = subject.kinematics.positions(rows.values, subject.foot_points) * subject.scale
    speeds: Floats = np.linalg.norm(velocities_of(places, rows.steps), axis=-1)
    return speeds


def _contacts(subject: Subject, rows: SubjectRows) -> Floats:
    """1 in frames in which a foot stands, 0 in all others, as ``mcz.contacts`` finds them."""
    skeleton, poses = subject.skeleton, subject.kinematics
    n_frames = len(rows.values)
    tracks = FootTracks(skeleton, subject.feet, n_frames)
    tracks.add(0, poses.positions(rows.values, range(len(point_names(skeleton)))))
    known = np.isfinite(rows.steps)
    rate = float(1 / np.median(rows.steps[known])) if known.any() else None
    ends = [0, *(np.flatnonzero(~known) + 1).tolist(), n_frames]
    runs = list(zip(ends[:-1], ends[1:], strict=True))
    contacts = tracks.contacts(rate, skeleton.up_axis, runs=runs)
    return np.stack([contacts.frames(joint) for joint in tracks.joints], axis=1).astype(np.float64)


def _up_column(skeleton: Skeleton) -> int:
    if not skeleton.up_axis:
        raise OptionError(
            f"the up axis of {named('skeleton', skeleton.name)} is unknown", hint=Hint.UP
        )
    return column_of(skeleton.up_axis)


class _Heading:
    """The frame that turns with the root about the up axis, its origin on the ground below it.

    ``angles`` (n_frames,) in radians, 0 in the rest pose, as in ``Root.headings``; ``axes``
    (n_frames, 3, 3) has the axes of the frame as columns.
    """

    def __init__(self, subject: Subject, rows: SubjectRows) -> None:
        skeleton, poses = subject.skeleton, subject.kinematics
        column = _up_column(skeleton)
        sign = signs_of(skeleton.up_axis)[column]
        turns = from_matrices(poses.world(rows.values, [0]), "quat")[:, 0]
        self.angles: Floats = 2.0 * np.arctan2(sign * turns[:, 1 + column], turns[:, 0])
        vectors = np.zeros((3, len(turns)))
        vectors[column] = sign * self.angles
        self.axes: Floats = np.moveaxis(matrices_of_vectors(vectors), 2, 0)
        origins = poses.origins(rows.values, [0])
        origins[..., column] = 0.0
        self.origins = origins * subject.scale


def _heading(subject: Subject, rows: SubjectRows) -> Floats:
    angles = _Heading(subject, rows).angles
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _heading_rate(subject: Subject, rows: SubjectRows) -> Floats:
    angles = _Heading(subject, rows).angles
    steps = np.diff(angles)
    whole_turns = np.zeros(len(angles))
    whole_turns[1:] = np.cumsum(np.nan_to_num(np.rint(steps / (2 * np.pi))))
    smooth = angles - 2 * np.pi * whole_turns
    return velocities_of(smooth[:, None, None], rows.steps)[:, 0]


def _heading_positions(subject: Subject, rows: SubjectRows) -> Floats:
    heading = _Heading(subject, rows)
    return (_positions(subject, rows) - heading.origins) @ heading.axes


def _heading_velocities(subject: Subject, rows: SubjectRows) -> Floats:
    return _velocities(subject, rows) @ _Heading(subject, rows).axes


def _local_turns(subject: Subject, rows: SubjectRows) -> Floats:
    return subject.kinematics.local(rows.values, subject.joints)


def _world_turns(subject: Subject, rows: SubjectRows) -> Floats:
    return subject.kinematics.world(rows.values, subject.joints)


def _heading_turns(subject: Subject, rows: SubjectRows) -> Floats:
    back = np.swapaxes(_Heading(subject, rows).axes, 1, 2)
    return back[:, None] @ _world_turns(subject, rows)


def _above_root_and_joints(subject: Subject) -> list[int]:
    return [0, *subject.kinematics.above(subject.joints)]


def _all_joints(subject: Subject) -> range:
    return range(subject.skeleton.n_joints)


def _humanml3d_joints(subject: Subject) -> tuple[int, ...]:
    """The 22 joints: the chosen ones, or the first ones of a body of SMPL; raises OptionError."""
    names = tuple(subject.skeleton.joints[joint].name for joint in subject.joints)
    if len(names) != len(JOINTS) and names[: len(JOINTS)] != JOINTS:
        raise OptionError(
            f"humanml3d: {len(names)} joints are given; choose {len(JOINTS)} with joints=, in "
            f"the order {', '.join(JOINTS)}"
        )
    return subject.joints[: len(JOINTS)]


def _humanml3d(subject: Subject, rows: SubjectRows) -> Floats:
    """``mcz.humanml3d``; the last frame repeats the features of the previous one."""
    skeleton = subject.skeleton
    column = _up_column(skeleton)
    joints = _humanml3d_joints(subject)
    places = subject.kinematics.origins(rows.values, joints) * scale_to(skeleton, "m")
    places *= signs_of(skeleton.up_axis)
    if len(places) < 2:
        return np.full((len(places), N_FEATURES), np.nan)
    # A cyclic order of the axes is a rotation, and the features do not depend on the heading.
    features = humanml3d(np.roll(places, 1 - column, axis=-1))
    return np.concatenate([features, features[-1:]])


SPACES = {"": _local_turns, "world_": _world_turns, "heading_": _heading_turns}


def _rotations(space: str, name: str) -> Field:
    """A field of rotations of the chosen joints."""
    form, tail = FORMS[name]
    turns = SPACES[space]
    return Field(
        space + name,
        "joints",
        lambda subject: (len(subject.joints), *tail),
        lambda subject, rows: from_matrices(turns(subject, rows), form),
        _above_root_and_joints if space else (lambda subject: subject.joints),
        signed=form == "quat",
    )


def _points(name: str, make: Make, reach: int = 0) -> Field:
    """A field of three numbers a point."""
    return Field(name, "points", _n_points, make, _above_root_and_points, reach, lengths=True)


def _feet(name: str, make: Make, reach: int) -> Field:
    """A field of one number a foot."""
    return Field(
        name, "feet", lambda subject: (len(subject.feet),), make, _all_joints, reach, lengths=True
    )


def _of_root(name: str, size: int, make: Make, reach: int = 0, lengths: bool = False) -> Field:
    """A field of a few numbers of the root."""
    return Field(name, "", lambda _: (size,), make, lambda _: (0,), reach, lengths=lengths)


FIELDS = {
    each.name: each
    for each in [
        Field(
            "channels",
            "channels",
            lambda subject: (len(subject.columns),),
            lambda subject, rows: rows.values[:, subject.columns],
            lambda subject: subject.joints,
            posed=False,
        ),
        _points("positions", _positions),
        _points("velocities", _velocities, 1),
        _points("accelerations", _accelerations, 2),
        _of_root("root", 3, _root, lengths=True),
        *(_rotations(space, name) for space in SPACES for name in FORMS),
        _of_root("heading", 2, _heading),
        _of_root("heading_rate", 1, _heading_rate, 1),
        _points("heading_positions", _heading_positions),
        _points("heading_velocities", _heading_velocities, 1),
        _feet("foot_speed", _foot_speed, 1),
        _feet("contacts", _contacts, WHOLE),
        Field(
            "humanml3d",
            "",
            lambda subject: (N_FEATURES,),
            _humanml3d,
            _all_joints,
            WHOLE,
        ),
    ]
}


def subject_of(
    clip: Clip, fields: tuple[Field, ...], joints: Joints, units: Units, is_timed: bool
) -> Subject:
    """The parts of ``clip`` that these fields use; raises MotionError and OptionError."""
    skeleton = clip.skeleton
    if units.up and not skeleton.up_axis:
        skeleton = with_axes(skeleton, units.up)
    timed = [each.name for each in fields if each.reach]
    if timed and not is_timed:
        raise OptionError(f"{', '.join(timed)}: a frame rate is needed; set it with source_rate=")
    lengths = any(each.lengths for each in fields)
    subject = Subject(
        skeleton,
        frame_poses_of(skeleton) if any(each.posed for each in fields) else None,
        tuple(joint_numbers(skeleton, joints)),
        tuple(find_points(skeleton, joints)) if lengths else (),
        scale_to(skeleton, units.length) if lengths else 1.0,
        {each.name: signal_shape(clip, each) for each in fields if each.signal},
    )
    needed = {joint for each in fields for joint in each.needs(subject)}
    return replace(subject, read_joints=tuple(sorted(needed)))


def signal_shape(clip: Clip, field: Field) -> SignalShape:
    """The channels of the signal that a field is; raises OptionError."""
    infos = {info.name: info for info in reversed(clip.signals)}
    if field.signal not in infos:
        known = [*FIELDS, *infos]
        raise OptionError(
            f"no field or signal {field.name!r} among {suggest_names(known, field.name)}"
        )
    info = infos[field.signal]
    if info.channels is None:
        names = clip.skeleton.channel_addresses()
    else:
        names = [channel.label for channel in info.channels]
    return SignalShape(tuple(names), info.samples_per_frame)
