"""``subject_of``: the parts of a clip that the fields of a data set use."""

from __future__ import annotations

from dataclasses import replace

from mcz.errors import OptionError
from mcz.exchange.datasets.field_table import FIELDS
from mcz.exchange.datasets.fields import Field, SignalShape, Subject, Units
from mcz.files.reading.clip import Clip
from mcz.kinematics.frames import frame_poses_of
from mcz.kinematics.poses.motion_like import joint_numbers, scale_to
from mcz.kinematics.poses.trajectories import find_points
from mcz.model.skeleton import Joints
from mcz.model.text_format import among
from mcz.model.units import facing


def subject_of(
    clip: Clip, fields: tuple[Field, ...], joints: Joints, units: Units, is_timed: bool
) -> Subject:
    """The parts of ``clip`` that these fields use; raises MotionError and OptionError."""
    skeleton = clip.skeleton
    if units.up and not skeleton.up_axis:
        skeleton = facing(skeleton, units.up)
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


def signal_shape(clip: Clip, wanted: Field) -> SignalShape:
    """The channels of the signal that a field is; raises OptionError."""
    infos = {info.name: info for info in reversed(clip.signals)}
    if wanted.signal not in infos:
        known = [*FIELDS, *infos]
        raise OptionError(f"no field or signal {wanted.name!r} among {among(known, wanted.name)}")
    info = infos[wanted.signal]
    if info.channels is None:
        names = clip.skeleton.channel_addresses()
    else:
        names = [channel.label for channel in info.channels]
    return SignalShape(tuple(names), info.samples_per_frame)
