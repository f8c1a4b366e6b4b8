"""A skeleton with other rest offsets."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mcz.errors import OptionError
from mcz.kinematics.retargeting.channels import edited
from mcz.model.motion import Motion, Skeleton

Given = TypeVar("Given", Motion, Skeleton)


def with_offsets(given: Given, offsets: ArrayLike, unit_cm: float | None = None) -> Given:
    """A motion or skeleton with these rest offsets, (n_joints, 3), and ``unit_cm`` where given.

    They lead from each parent's origin to the joint's own, along axes that are those of the world
    at rest. Numbers stay as they are, bones get other lengths, and so all joints other places.
    What is returned has no source. Raises OptionError where the shape is another, or a number is
    not finite.
    """
    skeleton = given if isinstance(given, Skeleton) else given.skeleton
    found = np.asarray(offsets, np.float64)
    if found.shape != (skeleton.n_joints, 3) or not np.isfinite(found).all():
        raise OptionError(
            f"offsets of shape {found.shape} for {skeleton.n_joints} joints: "
            f"({skeleton.n_joints}, 3) finite numbers are wanted"
        )
    joints = tuple(
        replace(joint, offset=(x, y, z))
        for joint, (x, y, z) in zip(skeleton.joints, found.tolist(), strict=True)
    )
    unit = skeleton.unit_cm if unit_cm is None else unit_cm
    made = replace(skeleton, joints=joints, unit_cm=unit, base=None, source=None)
    return made if isinstance(given, Skeleton) else edited(given, made, given.signals[0])
