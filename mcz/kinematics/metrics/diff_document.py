"""JSON document of ``mcz diff``, and distances of joints of equal names in different skeletons.

SPEC.md's metrics compare points in order, which is useless for an AMC and a BVH: an AMC has points
at the ends of bones, a BVH at the joints. Here the origins of joints count.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from mcz.errors import MczError, MotionError
from mcz.kinematics.joint_names import find_feet
from mcz.kinematics.metrics.comparison import compare
from mcz.kinematics.metrics.figures import Comparison
from mcz.kinematics.points import SHELL_CM, origins_of, point_set
from mcz.kinematics.rest_pose import NO_LENGTHS, has_no_lengths
from mcz.model.motion import Motion, Skeleton
from mcz.model.text_format import fields_text
from mcz.model.types import JsonObject, Params

BLOCK = 2**20  # coordinates a block


@dataclass(frozen=True, slots=True)
class JointErrors:
    """Distances of joints of the same names, in length units of the original.

    ``joints`` are those compared, ``only_in_a`` and ``only_in_b`` the others; ``where`` is the
    frame, from 0, and the joint of the greatest distance. None if no position is known.
    """

    joints: tuple[str, ...]
    only_in_a: tuple[str, ...]
    only_in_b: tuple[str, ...]
    unit_cm: float | None
    mean: float | None = None
    greatest: float | None = None
    frame: int | None = None
    joint: str | None = None

    __repr__ = fields_text

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

    Raises MotionError if the two differ in frames, or one has no kinematics or no lengths.
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
    indices = {name.lower(): index for index, name in reversed(list(enumerate(b.addresses())))}
    names = enumerate(a.addresses())
    return [(index, indices[name.lower()]) for index, name in names if name.lower() in indices]


def _measure_joints(
    result: JointErrors, original: Motion, other: Motion, pairs: list[tuple[int, int]], scale: float
) -> JointErrors:
    """Measure the distances of the origins of ``pairs`` of joints, a block at a time."""
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


def diff_document(
    a: Motion,
    b: Motion,
    *,
    start: int = 0,
    shell_cm: float = SHELL_CM,
    contacts: Sequence[int | str] | bool | None = None,
    by_joint: bool = False,
    contact_list: bool = False,
) -> JsonObject:
    """The figures of ``b`` against ``a``, the original; docs/reference/scripts.md has the keys.

    ``start`` is the first frame of both in their clips, from which frames are counted. ``contacts``
    as in ``compare``; None: contacts of feet found by name. ``by_joint`` and ``contact_list`` add
    those lists. Raises MotionError for motions of different length.
    """
    if contacts is None:
        contacts = bool(find_feet(a.skeleton))
    comparison = compare(a, b, shell_cm=shell_cm, contacts=contacts if a.skeleton.joints else False)
    entries = _in_clip(comparison.entries(), start)
    document: JsonObject = {"name_a": a.name, "name_b": b.name, **entries}
    document["feet"] = _feet(comparison)
    if by_joint:
        document["by_joint"] = [_in_clip(each.entries(), start) for each in comparison.by_joint]
    if contact_list:
        slides = () if comparison.sliding is None else comparison.sliding.slides
        document["contact_list"] = [
            asdict(slide) | {"first": slide.first + start} for slide in slides
        ]
    document["equal_joints"] = _equal_joints(a, b)
    document["joints"] = _by_joints(a, b, comparison, start)
    return document | {"notes": list(comparison.notes)}


def _in_clip(entries: Params, start: int) -> JsonObject:
    """Shift frame numbers of figures by ``start``, to count from the clip's first frame."""
    return {
        key: value + start if key.endswith("_frame") and value is not None else value
        for key, value in entries.items()
    }


def _feet(comparison: Comparison) -> JsonObject | None:
    """Settings of the contact search; None if there was none."""
    if comparison.sliding is None:
        return None
    contacts = comparison.sliding.contacts
    return {
        "joints": list(contacts.joints),
        "up_axis": contacts.up_axis,
        "up_guessed": contacts.up_guessed,
        "frame_rate": contacts.frame_rate,
        "rate_assumed": contacts.rate_assumed,
    }


def _equal_joints(a: Motion, b: Motion) -> list[str]:
    """The joints of the same name whose channels are bit for bit equal in every frame."""
    if any(not motion.signals[0].has_poses for motion in (a, b)):
        return []
    theirs = {name: joint for joint, name in enumerate(b.skeleton.addresses())}
    rows = [motion.signals[0].masked().astype("<f8") for motion in (a, b)]
    starts = [motion.skeleton.column_starts() for motion in (a, b)]
    equal = []
    for joint, name in enumerate(a.skeleton.addresses()):
        kinds = [channel.kind for channel in a.skeleton.joints[joint].channels]
        other = theirs.get(name)
        if other is None or not kinds:
            continue
        if kinds != [channel.kind for channel in b.skeleton.joints[other].channels]:
            continue
        bits = [
            values[:, first[index] : first[index + 1]].tobytes()
            for values, first, index in zip(rows, starts, (joint, other), strict=True)
        ]
        equal += [name] if bits[0] == bits[1] else []
    return equal


def _by_joints(a: Motion, b: Motion, comparison: Comparison, start: int) -> JsonObject | None:
    """Distances of joints of the same name, if the skeletons have different points."""
    if comparison.points is not None and point_set(a.skeleton) == point_set(b.skeleton):
        return None
    try:
        errors = joint_errors(a, b)
    except MczError:  # no kinematics, as the notes say
        return None
    document = errors.document()
    if errors.frame is not None:
        document["frame"] = errors.frame + start
    return document
