"""JSON document of ``mcz diff`` about a pair of motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from mcz.errors import MczError
from mcz.kinematics import SHELL_CM, point_set
from mcz.kinematics.joint_groups import find_feet
from mcz.kinematics.metrics.comparison import compare
from mcz.kinematics.metrics.figures import Comparison
from mcz.kinematics.metrics.joint_errors import joint_errors
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Params


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
    equal = []
    for joint, name in enumerate(a.skeleton.addresses()):
        kinds = [channel.kind for channel in a.skeleton.joints[joint].channels]
        other = theirs.get(name)
        if other is None or not kinds:
            continue
        if kinds != [channel.kind for channel in b.skeleton.joints[other].channels]:
            continue
        both = ((a, a.skeleton.columns(joint)), (b, b.skeleton.columns(other)))
        bits = [
            motion.signals[0].masked()[:, list(columns)].astype("<f8").tobytes()
            for motion, columns in both
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
