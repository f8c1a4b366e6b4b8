"""Version 1: rotation vectors and quaternions turn in the metric."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcz.motion import QUATERNION_KINDS, TURNING_KINDS, Joint, Skeleton
from tools.vectors.build.motions import channels
from tools.vectors.build.pose_clips import HEADING, Floats, Plan, Poses, acclaim, biovision, waves

METRIC = f"{HEADING}; Pose metric"
VECTOR, QUATERNION = "vx vy vz", "qw qx qy qz"
FIELDS = {"flags": 2, "rotation": 113}


def add(shelf: Poses) -> None:
    mixed = "vx rz qz vz sx qx vy qw rx vx qy"
    cases: dict[str, tuple[str, Skeleton]] = {
        "vectors": ("Rotation vectors in radians", turning(biovision("rad"), VECTOR)),
        "vectors-deg": ("Rotation vectors in degrees", turning(biovision(), VECTOR)),
        "vectors-oriented": ("Rotation vectors along turned axes", turning(acclaim(), VECTOR)),
        "quaternions": ("Quaternions", turning(biovision(), QUATERNION)),
        "quaternions-oriented": (
            "Quaternions along turned axes, of no angle unit but for these",
            turning(acclaim(), QUATERNION),
        ),
        "mixed": ("Turns of all kinds at a joint", turning(biovision("rad"), mixed)),
        "mixed-fixed": (
            "Turns of all kinds, about fixed axes",
            replace(turning(biovision("rad"), mixed), intrinsic=False),
        ),
        "parts": ("Parts of vectors and quaternions, which turn nothing", _parts()),
        "angle-unknown": (
            "Vectors of an unknown angle unit: all are plain",
            turning(biovision(""), VECTOR),
        ),
        "none": ("Angles about axes alone", biovision("rad")),
    }
    for name, (purpose, skeleton) in cases.items():
        degrees = skeleton.angle_unit == "deg"
        fields = FIELDS | ({"rotation": 136} if degrees else {})
        plan = Plan(skeleton, moving(33, skeleton, 0.5 if degrees else 0.03), fields)
        requests = [(0, (7, 12), (2,)), (2, (3, 20), (1, 0))]
        shelf.plan(f"whole-{name}", f"{purpose}.", plan, METRIC, requests)
    _far(shelf)
    _frames(shelf)


def turning(skeleton: Skeleton, kinds: str) -> Skeleton:
    """The skeleton, each joint that turns with channels of ``kinds`` instead."""
    joints = []
    for joint in skeleton.joints:
        others = tuple(c for c in joint.channels if c.kind not in TURNING_KINDS)
        joints.append(replace(joint, channels=(*others, *channels(kinds))))
    return replace(skeleton, joints=tuple(joints))


def moving(n_frames: int, skeleton: Skeleton, size: float) -> Floats:
    """Waves; quaternions are near one that is not of length 1."""
    rows = waves(n_frames, skeleton, size)
    for column, channel in enumerate(skeleton.channels):
        if channel.kind in QUATERNION_KINDS:
            own = 0.05 * rows[:, column] / size
            rows[:, column] = own + (1.5, -0.25, 0.5, 0.125)[QUATERNION_KINDS.index(channel.kind)]
    return rows


def _parts() -> Skeleton:
    return Skeleton(
        (
            Joint("root", channels=channels("tx ty tz vx vy vz")),
            Joint("some", 0, (0.0, 3.0, 1.0), channels=channels("vx vy qw qx qz")),
            Joint("more", 1, (0.0, 3.0, 1.0), channels=channels("vz vx qw qx qy qz")),
        ),
        angle_unit="rad",
    )


def _far(shelf: Poses) -> None:
    """Vectors of every size, quaternions of none."""
    skeleton = turning(biovision("rad"), VECTOR)
    rows = moving(33, skeleton, 0.03)
    sizes = np.array([0.0, 1e-9, 3.0, 6.25, 12.5, 15.99, 16.0, 40.0, 1e5])
    for column, channel in enumerate(skeleton.channels):
        if channel.kind == "vy":
            rows[:, column] += np.repeat(np.roll(sizes, column), 4)[:33]
    purpose = "Vectors of 0 to 100,000 radians: from 16 on they count as none."
    shelf.plan("whole-far", purpose, Plan(skeleton, rows, FIELDS), METRIC)
    quaternions = turning(biovision("rad"), QUATERNION)
    rows = moving(33, quaternions, 0.03)
    scales = np.array([1.0, 0.25, 0.0, -1.0, 16.0, 0.0])
    for column, channel in enumerate(quaternions.channels):
        if channel.kind in QUATERNION_KINDS:
            rows[:, column] *= np.repeat(scales, 6)[:33]
    purpose = "Quaternions of several lengths: those of none turn nothing."
    plan = Plan(quaternions, rows, FIELDS | {"levels": 0})
    shelf.plan("whole-lengths", purpose, plan, METRIC)
    some = [c.kind not in QUATERNION_KINDS[:3] for c in quaternions.channels]
    purpose = "Quaternions of 0, of which one part moves, below others."
    shelf.plan(
        "whole-zeros", purpose, Plan(quaternions, waves(9, quaternions, 0.1) * some, FIELDS), METRIC
    )


def _frames(shelf: Poses) -> None:
    """Segments that go on, and rows with finer steps."""
    skeleton = turning(biovision("rad"), VECTOR)
    plan = Plan(skeleton, moving(12, skeleton, 0.03), FIELDS | {"levels": 0, "flags": 3})
    on = replace(plan, ends=(3, 4, 9), on=(1, 3), refinement=[0, 2, 1, 0] * 3)
    shelf.plan("whole-on", "Segments that go on, of rows with finer steps.", on, METRIC)
