"""Matching of joints between skeletons, and the channels of joints that change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.model.motion import POSITION_KINDS, TURNING_KINDS, Channel, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from mcz.model.text_format import among
from mcz.model.types import Floats


def match_joints(
    source: Skeleton, target: Skeleton, joint_map: Mapping[str, str] | None
) -> dict[int, int]:
    """The joints of ``source``, by the joint of ``target`` that each turns, in joint order.

    ``joint_map`` maps names of the source to names of the target; None: equal names, and both must
    have all turning joints. Raises OptionError, which names the joint.
    """
    ours, theirs = target.joint_names, source.joint_names
    if joint_map is None:
        _check_names(source, target)
        joint_map = {name: name for name in theirs if name in ours}
    pairs: dict[int, int] = {}
    for name, other in joint_map.items():
        if name not in theirs:
            raise OptionError(
                f"retarget: joint_map: the motion has no joint {name!r}; its joints are "
                f"{among(theirs, name)}"
            )
        if other not in ours:
            raise OptionError(
                f"retarget: joint_map: the skeleton has no joint {other!r}; its joints are "
                f"{among(ours, other)}"
            )
        number = ours.index(other)
        if number in pairs:
            raise OptionError(
                f"retarget: joint_map: {theirs[pairs[number]]!r} and {name!r} are both mapped "
                f"to {other!r}"
            )
        pairs[number] = theirs.index(name)
    if not pairs:
        raise OptionError("retarget: joint_map is empty")
    return dict(sorted(pairs.items()))


def _check_names(source: Skeleton, target: Skeleton) -> None:
    for one, other, where in ((source, target, "skeleton"), (target, source, "motion")):
        known = set(other.joint_names)
        for name, joint in zip(one.joint_names, one.joints, strict=True):
            if is_turning(joint.channels) and name not in known:
                raise OptionError(
                    f"retarget: the {where} has no joint {name!r}, which rotates; map it with "
                    "joint_map=, which leaves out unmapped joints"
                )


def nearest_above(skeleton: Skeleton, joint: int, chosen: Mapping[int, int]) -> int:
    """The nearest ancestor of ``joint`` in ``chosen``, -1 if there is none."""
    parent = skeleton.joints[joint].parent
    while parent >= 0 and parent not in chosen:
        parent = skeleton.joints[parent].parent
    return parent


COMPUTED = Grid(GridKind.FIXED, 6)  # as of conversions: a millionth is far below noise


def is_turning(channels: tuple[Channel, ...]) -> bool:
    """Return True if one of the channels turns its joint."""
    return any(channel.kind in TURNING_KINDS for channel in channels)


def is_moving(channels: tuple[Channel, ...]) -> bool:
    """Return True if one of the channels moves its joint."""
    return any(channel.kind in POSITION_KINDS for channel in channels)


def check_channels(motion: Motion) -> None:
    """Raise MotionError where the motion's channels differ from those of its joints."""
    if not motion.signals[0].has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )


def replace_motion(motion: Motion, skeleton: Skeleton, signal: Signal) -> Motion:
    """``motion`` with another skeleton and signal, without its source file."""
    made = replace(motion, skeleton=skeleton, signals=(signal, *motion.signals[1:]), source=None)
    return made.at_times(motion.timeline)


def computed_signal(motion: Motion, values: Floats) -> Signal:
    """The motion signal of ``values`` (n_rows, n_channels) that were computed; NaN is invalid."""
    valid = np.isfinite(values)
    first = motion.signals[0]
    return Signal(
        np.where(valid, values, 0.0),
        (COMPUTED,) * values.shape[1],
        first.name,
        first.samples_per_frame,
        None if valid.all() else valid,
    )
