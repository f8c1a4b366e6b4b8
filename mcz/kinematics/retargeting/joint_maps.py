"""Match joints between skeletons, by names and by maps of usual skeletons.

The maps name the part of the body that each joint turns. Parts have the names of SMPL's joints.
Joints of one part turn alike: rotations of clips that exist as AMC and as BVH were compared.
``lwrist``, LeftHand in CMU's BVH files, turns the part of ``left_wrist``; ``abdomen`` of the
Daz-friendly files turns with ``upperback``.

``{s}``, ``{S}``, ``{side}`` and ``{Side}`` stand for a side: l, L, left, Left and their likes. A
bar separates alternatives, of which a file has one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.model.motion import POSITION_KINDS, TURNING_KINDS, Channel, Motion, Signal, Skeleton
from mcz.model.numbers import Grid, GridKind
from mcz.model.text_format import named, nearest_names, suggest_names
from mcz.model.types import Floats

LIMBS = ("hip", "knee", "ankle", "shoulder", "elbow")  # parts of a side


def joint_map(a: str | Skeleton, b: str | Skeleton) -> dict[str, str]:
    """Map joint names of ``a`` to those of ``b`` that turn the same part of the body.

    Each is the name of a usual skeleton or a Skeleton with the names of one: "cmu-amc" (also its
    ASF), "cmu-bvh" (cgspeed's MotionBuilder-friendly files), "cmu-bvh-3dsmax", "cmu-bvh-daz",
    "humanml3d-22", "smpl-24" (SMPL), "smplh-52" (SMPL-H). Joints without a counterpart are left
    out. ``joint_map(a, a)`` lists the names of a skeleton, SMPL's in its order.

    Raises OptionError for an unknown name or Skeleton.
    """
    ours, theirs = _joints(a), _joints(b)
    return {name: theirs[part] for part, name in ours.items() if part in theirs}


def _joints(known: str | Skeleton) -> dict[str, str]:
    if isinstance(known, Skeleton):
        return _recognize_joints(known)
    if not isinstance(known, str) or known not in SKELETONS:
        near = nearest_names(known, SKELETONS) if isinstance(known, str) else ""
        raise OptionError(
            f"joint_map: no skeleton {known!r} among {', '.join(SKELETONS)}"
            + (f"; did you mean {near}?" if near else "")
        )
    return {part: names[0] for part, names in SKELETONS[known].items()}


def _recognize_joints(skeleton: Skeleton) -> dict[str, str]:
    """The joints of ``skeleton`` by part, from the usual skeleton that shares most joints with it.

    All of the body's joints are required; fingers, eyes and the like may be missing. SMPL's
    skeletons, which differ in little else, require all joints.
    """
    joint_names = set(skeleton.joint_names)
    best: dict[str, str] = {}
    for kind, joints in SKELETONS.items():
        matches = {
            part: present[0]
            for part, names in joints.items()
            if (present := _in(names, joint_names))
        }
        needed = set(joints) if not kind.startswith("cmu") else set(joints) & set(SMPL_BODY)
        if needed <= set(matches) and len(matches) > len(best):
            best = matches
    if not best:
        raise OptionError(
            f"joint_map: {named('skeleton', skeleton.name)} has the joint names of none of "
            f"{', '.join(SKELETONS)}"
        )
    return best


def limbs_of(skeleton: Skeleton) -> set[str]:
    """The joints of thighs, shins, feet and arms of a usual skeleton; empty for another."""
    try:
        known = _recognize_joints(skeleton)
    except OptionError:
        return set()
    return {name for part, name in known.items() if part.partition("_")[2] in LIMBS}


def _in(names: tuple[str, ...], joint_names: set[str]) -> list[str]:
    return [name for name in names if name in joint_names]


SMPL_BODY = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck"),
    *("left_collar", "right_collar", "head", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
SMPL_HANDS = ("left_hand", "right_hand")
SMPLH_FINGERS = tuple(
    f"{side}_{finger}{number}"
    for side in ("left", "right")
    for finger in ("index", "middle", "pinky", "ring", "thumb")
    for number in (1, 2, 3)
)

CMU_AMC = {
    "pelvis": "root",
    "spine1": "lowerback",
    "spine2": "upperback",
    "spine3": "thorax",
    "neck": "lowerneck",
    "upper_neck": "upperneck",
    "head": "head",
    "{side}_hip_joint": "{s}hipjoint",
    "{side}_hip": "{s}femur",
    "{side}_knee": "{s}tibia",
    "{side}_ankle": "{s}foot",
    "{side}_foot": "{s}toes",
    "{side}_collar": "{s}clavicle",
    "{side}_shoulder": "{s}humerus",
    "{side}_elbow": "{s}radius",
    "{side}_wrist": "{s}wrist",
    "{side}_hand": "{s}hand",
    "{side}_fingers": "{s}fingers",
    "{side}_thumb1": "{s}thumb",
}
CMU_BVH = {
    "pelvis": "Hips",
    "spine1": "LowerBack",
    "spine2": "Spine",
    "spine3": "Spine1",
    "neck": "Neck",
    "upper_neck": "Neck1",
    "head": "Head",
    "{side}_hip_joint": "{S}HipJoint",
    "{side}_hip": "{Side}UpLeg",
    "{side}_knee": "{Side}Leg",
    "{side}_ankle": "{Side}Foot",
    "{side}_foot": "{Side}ToeBase",
    "{side}_collar": "{Side}Shoulder",
    "{side}_shoulder": "{Side}Arm",
    "{side}_elbow": "{Side}ForeArm",
    "{side}_wrist": "{Side}Hand",
    "{side}_hand": "{Side}FingerBase",
    "{side}_fingers": "{Side}HandIndex1|{S}Fingers",
    "{side}_thumb1": "{S}Thumb",
}
CMU_BVH_3DSMAX = {
    "pelvis": "Hips",
    "spine1": "lowerback",
    "spine2": "Chest",
    "spine3": "Chest2",
    "neck": "lowerneck",
    "upper_neck": "Neck",
    "head": "Head",
    "{side}_hip_joint": "{S}HipJoint",
    "{side}_hip": "{Side}Hip",
    "{side}_knee": "{Side}Knee",
    "{side}_ankle": "{Side}Ankle",
    "{side}_foot": "{Side}Toe",
    "{side}_collar": "{Side}Collar",
    "{side}_shoulder": "{Side}Shoulder",
    "{side}_elbow": "{Side}Elbow",
    "{side}_wrist": "{Side}Wrist",
    "{side}_hand": "{s}hand",
    "{side}_fingers": "{S}Fingers",
    "{side}_thumb1": "{S}Thumb",
}
CMU_BVH_DAZ = {
    "pelvis": "hip",
    "spine2": "abdomen",
    "spine3": "chest",
    "neck": "neck",
    "head": "head",
    "{side}_eye": "{side}Eye",
    "{side}_hip_joint": "{s}Buttock",
    "{side}_hip": "{s}Thigh",
    "{side}_knee": "{s}Shin",
    "{side}_ankle": "{s}Foot",
    "{side}_collar": "{s}Collar",
    "{side}_shoulder": "{s}Shldr",
    "{side}_elbow": "{s}ForeArm",
    "{side}_wrist": "{s}Hand",
    "{side}_thumb1": "{s}Thumb1",
    "{side}_thumb2": "{s}Thumb2",
    "{side}_index1": "{s}Index1",
    "{side}_index2": "{s}Index2",
    "{side}_middle1": "{s}Mid1",
    "{side}_middle2": "{s}Mid2",
    "{side}_ring1": "{s}Ring1",
    "{side}_ring2": "{s}Ring2",
    "{side}_pinky1": "{s}Pinky1",
    "{side}_pinky2": "{s}Pinky2",
}


def _both_sides(rows: dict[str, str]) -> dict[str, tuple[str, ...]]:
    """The rows, with a row for each side where they have placeholders of sides."""
    maps: dict[str, tuple[str, ...]] = {}
    for side in ("left", "right"):
        words = {"side": side, "Side": side.title(), "s": side[0], "S": side[0].upper()}
        for part, names in rows.items():
            maps[part.format(**words)] = tuple(names.format(**words).split("|"))
    return maps


def _themselves(*parts: str) -> dict[str, tuple[str, ...]]:
    return {part: (part,) for part in parts}


# For each skeleton its joints by part; the most usual of several names comes first.
SKELETONS = {
    "cmu-amc": _both_sides(CMU_AMC),
    "cmu-bvh": _both_sides(CMU_BVH),
    "cmu-bvh-3dsmax": _both_sides(CMU_BVH_3DSMAX),
    "cmu-bvh-daz": _both_sides(CMU_BVH_DAZ),
    "humanml3d-22": _themselves(*SMPL_BODY),
    "smpl-24": _themselves(*SMPL_BODY, *SMPL_HANDS),
    "smplh-52": _themselves(*SMPL_BODY, *SMPLH_FINGERS),
}


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
                f"{suggest_names(theirs, name)}"
            )
        if other not in ours:
            raise OptionError(
                f"retarget: joint_map: the skeleton has no joint {other!r}; its joints are "
                f"{suggest_names(ours, other)}"
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
    """Raise MotionError if the motion's channels differ from those of its joints."""
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
