"""Kind of plain arrays as named by the caller: positions, rotations or a robot."""

from __future__ import annotations

from dataclasses import replace

from mcz.errors import MotionError, OptionError
from mcz.model.motion import Channel, Joint, Motion, Skeleton
from mcz.sources.robots import N_ROOT, robot_layouts, with_robot_layout

KINDS = {
    "positions": ("tx", "ty", "tz"),
    "rotation-vectors": ("vx", "vy", "vz"),
    "quaternions-wxyz": ("qw", "qx", "qy", "qz"),
    "quaternions-xyzw": ("qx", "qy", "qz", "qw"),
}


def kinds_of(name: str) -> tuple[str, ...]:
    """The channel kinds of a joint, () of a robot; raises OptionError for an unknown name."""
    if name not in KINDS and name not in robot_layouts():
        raise OptionError(f"arrays {name!r}: one of {', '.join((*KINDS, *robot_layouts()))}")
    return KINDS.get(name, ())


def with_kinds(motion: Motion, name: str) -> Motion:
    """``motion``, one of plain numbers, as joints of what ``name`` says, named by their number.

    A robot layout names the columns of tables, too.

    A motion of anything else is returned as it is. Raises OptionError for an unknown name, and
    MotionError where the numbers of a frame are no such joints.
    """
    kinds = kinds_of(name)
    source, skeleton = motion.source, motion.skeleton
    if source is None or source.format not in ("npy", "npz", "csv"):
        return motion
    if any(channel.kind for channel in skeleton.channels):
        return motion
    if not kinds:
        return _as_robot(motion, name)
    if source.format == "csv":
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


def _as_robot(motion: Motion, name: str) -> Motion:
    robot = with_robot_layout(motion, name)
    if robot is None:
        n = len(robot_layouts()[name].joints)
        raise MotionError(
            f"{name} are {n} columns, or {n + N_ROOT} with the root, "
            f"but there are {motion.skeleton.n_channels}"
        )
    return robot
