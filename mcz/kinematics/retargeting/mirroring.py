"""A motion in the mirror: left and right change places.

With S the reflection, a joint with axes W becomes its counterpart with axes S W S. A reflected turn
about one of the mirror's own axes is a turn about the same axis, a turn about any other axis
changes its sign. So only places and signs of numbers change.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.kinematics.joint_names import counterparts
from mcz.kinematics.retargeting.joint_maps import check_channels, replace_motion
from mcz.model.checks import check_arguments
from mcz.model.motion import (
    A_MOTION,
    POSITION_KINDS,
    TURNING_KINDS,
    Exceptions,
    Joint,
    Motion,
    Signal,
    Skeleton,
    Vector,
    joint_columns,
)
from mcz.model.types import Bools

AXES = ("x", "y", "z")


@check_arguments(motion=A_MOTION)
def mirror(motion: Motion, axis: str = "x", pairs: Mapping[str, str] | None = None) -> Motion:
    """``motion`` reflected through the plane normal to ``axis`` of the world, at its origin.

    ``axis`` is "x", "y" or "z", from side to side. Left and right joints change places: the
    positions of each are exactly the mirrored ones of its counterpart, and so are the lengths of
    its bones and its channels. Names, order and parents are kept. Numbers stay on their grids.

    Counterparts are found by name, such as "LeftArm" and "RightArm", "lfemur" and "rfemur",
    "Hand_L" and "Hand_R"; a joint without a side is its own. ``pairs`` maps names to names if
    they do not show it. The result has no source.

    Raises OptionError for a side without counterpart, for a pair whose parents are not a pair, and
    for another axis. Raises MotionError for plain scalars and for signals other than the motion,
    whose mirror image is unknown.
    """
    if axis not in AXES:
        raise OptionError(f"mirror: axis is {axis!r}; it must be one of {', '.join(AXES)}")
    _check(motion)
    skeleton = motion.skeleton
    others = counterparts(skeleton.joint_names, pairs)
    _check_tree(skeleton, others)
    joints = tuple(
        replace(_reflect(skeleton.joints[other], axis), name=joint.name, parent=joint.parent)
        for joint, other in zip(skeleton.joints, others, strict=True)
    )
    mirrored = replace(skeleton, joints=joints, base=None, source=None)
    signal = motion.signals[0].of_columns(joint_columns(skeleton, others))
    return replace_motion(motion, mirrored, _turned_about(signal, mirrored, axis))


def _check(motion: Motion) -> None:
    check_channels(motion)
    if len(motion.signals) > 1:
        names = ", ".join(signal.name for signal in motion.signals[1:])
        raise MotionError(
            f"signals {names} cannot be mirrored; mirror the motion without them "
            "(dataclasses.replace, signals=motion.signals[:1])",
            clip=motion.name,
        )
    for name, joint in zip(motion.skeleton.joint_names, motion.skeleton.joints, strict=True):
        if any(not channel.kind for channel in joint.channels):
            raise MotionError(f"joint {name!r} has plain scalars, which cannot be mirrored")


def _check_tree(skeleton: Skeleton, others: list[int]) -> None:
    """Counterparts hang on counterparts."""
    names = skeleton.joint_names
    for index, other in enumerate(others):
        parent, other_parent = skeleton.joints[index].parent, skeleton.joints[other].parent
        if (others[parent] if parent >= 0 else -1) != other_parent:
            on = [names[k] if k >= 0 else "nothing" for k in (parent, other_parent)]
            raise OptionError(
                f"mirror: {names[index]!r} is a child of {on[0]!r} and its counterpart "
                f"{names[other]!r} of {on[1]!r}, but these two are not counterparts; pair "
                "them with pairs="
            )


def _reflect(joint: Joint, axis: str) -> Joint:
    x, y, z = (
        0.0 - angle if angle and letter != axis else angle
        for letter, angle in zip(AXES, joint.axis, strict=True)
    )
    return replace(
        joint,
        offset=_reflected_vector(joint.offset, axis),
        tails=tuple(_reflected_vector(tail, axis) for tail in joint.tails),
        axis=(x, y, z),
    )


def _reflected_vector(vector: Vector, axis: str) -> Vector:
    x, y, z = (
        0.0 - part if part and letter == axis else part
        for letter, part in zip(AXES, vector, strict=True)
    )
    return x, y, z


def _turned_about(signal: Signal, skeleton: Skeleton, axis: str) -> Signal:
    """The signal with changed signs where a mirror changes them."""
    flipped = np.array([_flips(c.kind, axis) for c in skeleton.channels], np.bool_)
    # 0 - v rather than -v: no zero becomes -0, which other grids lack.
    values = np.where(flipped, 0 - signal.values, signal.values)
    return replace(
        signal,
        values=values,
        stored=values if signal.scaling is None else signal.scaling.stored(values, signal.stored),
        exceptions=_unchanged_exceptions(signal.exceptions, flipped),
        ordinals=None,
    )


def _flips(kind: str, axis: str) -> bool:
    if kind in POSITION_KINDS:
        return kind[1] == axis
    return kind in TURNING_KINDS and kind != "qw" and kind[1] != axis


def _unchanged_exceptions(exceptions: Exceptions, flipped: Bools) -> Exceptions:
    """The texts of the numbers that did not change."""
    at = np.arange(len(flipped))
    at[flipped] = -1
    return exceptions.moved(at)
