"""``rotations``: how joints are turned, in any of the usual representations."""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import OptionError
from mcz.kinematics.poses.conversions import check_form, check_order, from_matrices
from mcz.kinematics.poses.motion_like import (
    Frames,
    MotionLike,
    as_type,
    frame_range,
    joint_numbers,
    poses_of,
    values_of,
)
from mcz.model.skeleton import Joints
from mcz.model.types import Reals

SPACES = ("local", "world")


def rotations(
    moving: MotionLike,
    form: str = "quat",
    *,
    space: str = "local",
    joints: Joints = None,
    frames: Frames = None,
    order: str = "XYZ",
    degrees: bool = False,
    dtype: DTypeLike = np.float64,
) -> Reals:
    """Rotations of the joints of a Motion or Clip, (n_frames, n_joints, ...).

    ``form``: "quat" (..., 4), w first, unit length, signs continuous; "matrix" (..., 3, 3);
    "rotvec" (..., 3), axis times angle; "6d" (..., 6), the first column of the matrix, then the
    second; "euler" (..., 3), about the axes of ``order``: "ZXY" about axes that turn along, in this
    order, "zxy" about fixed ones. Angles in radians, or ``degrees``.
    ``space``: "local", from the parent (of a root: from the world), or "world". In the rest pose
    both are the identity, whatever the skeleton's own axes are: what bones do, not how a file
    writes it. ``joints`` by index or name, None: all; ``frames`` (a, b) or a slice.

    Rotations are active, for column vectors: a bone that points along d in the rest pose points
    along W d. NaN where a channel that matters is invalid. Raises OptionError, and MotionError
    where the skeleton has no kinematics.
    """
    check_form(form)
    check_order(order)
    if space not in SPACES:
        raise OptionError(f"space {space!r}: one of {', '.join(SPACES)}")
    skeleton, span = moving.skeleton, frame_range(moving, frames)
    chosen = joint_numbers(skeleton, joints)
    poses = poses_of(skeleton)
    needed = chosen if space == "local" else poses.above(chosen)
    values = values_of(moving, span, needed)
    turns = poses.local(values, chosen) if space == "local" else poses.world(values, chosen)
    converted = from_matrices(turns, form, order)
    if degrees:
        if form not in ("euler", "rotvec"):
            raise OptionError(f"degrees: rotations as {form!r} have no angles")
        converted = np.degrees(converted)
    return as_type(converted, dtype)
