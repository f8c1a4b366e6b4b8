"""Distances of joints of equal names in different skeletons.

SPEC.md's metrics compare points in order, which is useless for an AMC and a BVH: an AMC has points
at the ends of bones, a BVH at the joints. Here the origins of joints count.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics import origins_of
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.motion import Motion, Skeleton
from mcz.model.text_format import brief
from mcz.model.types import JsonObject

BLOCK = 2**20  # coordinates a block


@dataclass(frozen=True, slots=True)
class JointErrors:
    """Distances of joints of the same names, in length units of the original.

    ``joints`` are those compared, ``only_in_a`` and ``only_in_b`` the others; ``where`` is the
    frame, from 0, and the joint of the greatest distance. None where no position is known.
    """

    joints: tuple[str, ...]
    only_in_a: tuple[str, ...]
    only_in_b: tuple[str, ...]
    unit_cm: float | None
    mean: float | None = None
    greatest: float | None = None
    frame: int | None = None
    joint: str | None = None

    __repr__ = brief

    def document(self) -> JsonObject:
        """All figures by name, distances in centimeters too."""
        entries = asdict(self)
        for key in ("mean", "greatest"):
            value = entries[key]
            known = value is not None and self.unit_cm is not None
            entries[f"{key}_cm"] = value * self.unit_cm if known else None
        return {k: list(v) if isinstance(v, tuple) else v for k, v in entries.items()}


def joint_errors(original: Motion, other: Motion) -> JointErrors:
    """Compare the joints that both have, frame by frame; case does not matter in names.

    Raises MotionError where the two differ in frames, or one has no kinematics or no lengths.
    """
    a, b = original.skeleton, other.skeleton
    for motion in (original, other):
        if not motion.signals[0].has_poses:
            raise MotionError(
                "the channels of its motion signal differ from those of its skeleton",
                clip=motion.name,
            )
    if original.signals[0].n_rows != other.signals[0].n_rows:
        raise MotionError(f"the numbers of frames differ: {original.n_frames} and {other.n_frames}")
    if has_no_lengths(a) != has_no_lengths(b):
        name = (original if has_no_lengths(a) else other).name
        raise MotionError(f"{NO_LENGTHS} in one skeleton, but not in the other", clip=name)
    names_a, names_b = a.addresses(), b.addresses()
    pairs = pairs_of(a, b)
    both = {names_a[i].lower() for i, _ in pairs}
    unit = a.unit_cm if b.unit_cm is not None else None
    scale = b.unit_cm / a.unit_cm if a.unit_cm is not None and b.unit_cm is not None else 1.0
    result = JointErrors(
        joints=tuple(names_a[i] for i, _ in pairs),
        only_in_a=tuple(name for name in names_a if name.lower() not in both),
        only_in_b=tuple(name for name in names_b if name.lower() not in both),
        unit_cm=unit,
    )
    return _measure_joints(result, original, other, pairs, scale) if pairs else result


def pairs_of(a: Skeleton, b: Skeleton) -> list[tuple[int, int]]:
    """The joints that both have, by index; names are equal in any case of letters."""
    there = {name.lower(): index for index, name in reversed(list(enumerate(b.addresses())))}
    names = enumerate(a.addresses())
    return [(index, there[name.lower()]) for index, name in names if name.lower() in there]


def _measure_joints(
    result: JointErrors, original: Motion, other: Motion, pairs: list[tuple[int, int]], scale: float
) -> JointErrors:
    left, right = (list(side) for side in zip(*pairs, strict=True))
    total, count, worst, where = 0.0, 0, -1.0, (0, 0)
    n_rows, per_frame = original.signals[0].n_rows, original.signals[0].samples_per_frame
    widest = max(original.skeleton.n_joints, other.skeleton.n_joints)
    step = max(1, BLOCK // (12 * widest))
    values = [np.asarray(m.values, np.float64) for m in (original, other)]
    for start in range(0, n_rows, step):
        rows = slice(start, start + step)
        with np.errstate(all="ignore"):  # overflow is no distance
            ours = origins_of(original.skeleton, values[0][rows])[:, left]
            theirs = origins_of(other.skeleton, values[1][rows])[:, right] * scale
            distances = np.sqrt(((ours - theirs) ** 2).sum(axis=2))
        known = np.isfinite(distances)
        total, count = total + float(distances[known].sum()), count + int(known.sum())
        if known.any():
            row, at = divmod(int(np.argmax(np.where(known, distances, -1.0))), len(pairs))
            if distances[row, at] > worst:
                worst, where = float(distances[row, at]), (start + row, at)
    if not count or not math.isfinite(total):
        return result
    facts = {k: getattr(result, k) for k in ("joints", "only_in_a", "only_in_b", "unit_cm")}
    return JointErrors(
        **facts,
        mean=total / count,
        greatest=worst,
        frame=where[0] // per_frame,
        joint=result.joints[where[1]],
    )
