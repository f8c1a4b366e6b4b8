"""Kind of plain arrays as named by the caller: positions or rotations."""

from __future__ import annotations

from dataclasses import replace

from mcz.errors import MotionError, OptionError
from mcz.model.motion import Channel, Joint, Motion, Skeleton

KINDS = {
    "positions": ("tx", "ty", "tz"),
    "rotation-vectors": ("vx", "vy", "vz"),
    "quaternions-wxyz": ("qw", "qx", "qy", "qz"),
    "quaternions-xyzw": ("qx", "qy", "qz", "qw"),
}


def kinds_of(name: str) -> tuple[str, ...]:
    """The channel kinds of a joint; raises OptionError for an unknown name."""
    if name not in KINDS:
        raise OptionError(f"arrays {name!r}: one of {', '.join(KINDS)}")
    return KINDS[name]


def with_kinds(motion: Motion, name: str) -> Motion:
    """``motion``, one of plain numbers, as joints of what ``name`` says, named by their number.

    A motion of anything else is returned as it is. Raises OptionError for an unknown name, and
    MotionError where the numbers of a frame are no such joints.
    """
    kinds = kinds_of(name)
    source, skeleton = motion.source, motion.skeleton
    if source is None or source.format not in ("npy", "npz"):
        return motion
    if any(channel.kind for channel in skeleton.channels):
        return motion
    n_joints, rest = divmod(skeleton.n_channels, len(kinds))
    odd = {len(joint.channels) for joint in skeleton.joints} - {1, len(kinds)}
    if rest or odd:
        each = odd.pop() if odd else skeleton.n_channels
        raise MotionError(f"{name} are {len(kinds)} numbers a joint, but there are {each}")
    channels = tuple(map(Channel, kinds))
    joints = tuple(Joint(str(number), channels=channels) for number in range(n_joints))
    angle_unit = "rad" if name == "rotation-vectors" else skeleton.angle_unit
    named = Skeleton(
        joints,
        skeleton.name,
        unit_cm=skeleton.unit_cm,
        angle_unit=angle_unit,
        up_axis=skeleton.up_axis,
        forward_axis=skeleton.forward_axis,
        handedness=skeleton.handedness,
    )
    return replace(motion, skeleton=named)
