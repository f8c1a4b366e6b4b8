"""Joints under other names, and skeletons with other rest offsets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mcz.errors import OptionError
from mcz.kinematics.retargeting.matching import replace_motion
from mcz.model.motion import Motion, Skeleton
from mcz.model.text_format import among

Named = TypeVar("Named", Motion, Skeleton)


def rename(named: Named, mapping: Mapping[str, str]) -> Named:
    """Rename the joints of a motion or skeleton by ``mapping``, from old name to new.

    Other joints keep their names; where a name repeats, ``name#1`` is the second joint of that
    name, as in ``Skeleton.joint_names``. Numbers stay unchanged. The result has no source: a file's
    text has the old names. Other signals keep the names of their channels.

    Raises OptionError for an unknown joint, and for a name that two joints would have.
    """
    skeleton = named if isinstance(named, Skeleton) else named.skeleton
    names = _names(skeleton, mapping)
    joints = tuple(
        replace(joint, name=name) for joint, name in zip(skeleton.joints, names, strict=True)
    )
    renamed = replace(skeleton, joints=joints, base=None, source=None)
    if isinstance(named, Skeleton):
        return renamed
    return replace_motion(named, renamed, named.signals[0])


def _names(skeleton: Skeleton, mapping: Mapping[str, str]) -> list[str]:
    addresses = skeleton.joint_names
    names = [joint.name for joint in skeleton.joints]
    given: set[int] = set()
    for old, new in mapping.items():
        if old not in addresses:
            raise OptionError(f"rename: no joint {old!r}; the joints are {among(addresses, old)}")
        if not isinstance(new, str) or not new:
            raise OptionError(f"rename: {new!r} is not a valid name for joint {old!r}")
        index = addresses.index(old)
        names[index] = new
        given.add(index)
    for index in sorted(given):
        if names.count(names[index]) > 1:
            addresses_of_name = [
                addresses[k] for k, name in enumerate(names) if name == names[index]
            ]
            raise OptionError(
                f"rename: {len(addresses_of_name)} joints would have the name "
                f"{names[index]!r}: {', '.join(addresses_of_name)}"
            )
    return names


Given = TypeVar("Given", Motion, Skeleton)


def with_offsets(given: Given, offsets: ArrayLike, unit_cm: float | None = None) -> Given:
    """A motion or skeleton with these rest offsets, (n_joints, 3), and ``unit_cm`` if given.

    They lead from each parent's origin to the joint's own, along the world's axes at rest. Numbers
    stay unchanged; lengths of bones and so positions of joints change. The result has no source.
    Raises OptionError for another shape, or a number that is not finite.
    """
    skeleton = given if isinstance(given, Skeleton) else given.skeleton
    new_offsets = np.asarray(offsets, np.float64)
    if new_offsets.shape != (skeleton.n_joints, 3) or not np.isfinite(new_offsets).all():
        raise OptionError(
            f"offsets have shape {new_offsets.shape}; {skeleton.n_joints} joints need "
            f"({skeleton.n_joints}, 3) finite numbers"
        )
    joints = tuple(
        replace(joint, offset=(x, y, z))
        for joint, (x, y, z) in zip(skeleton.joints, new_offsets.tolist(), strict=True)
    )
    unit = skeleton.unit_cm if unit_cm is None else unit_cm
    made = replace(skeleton, joints=joints, unit_cm=unit, base=None, source=None)
    return made if isinstance(given, Skeleton) else replace_motion(given, made, given.signals[0])
