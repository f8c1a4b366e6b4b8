"""Maps of joints between usual skeletons."""

from __future__ import annotations

from mcz.errors import OptionError
from mcz.kinematics.retargeting.joint_names import SKELETONS, SMPL_BODY
from mcz.model.motion import Skeleton
from mcz.model.text_format import nearest

LIMBS = ("hip", "knee", "ankle", "shoulder", "elbow")  # parts of a side


def joint_map(a: str | Skeleton, b: str | Skeleton) -> dict[str, str]:
    """From joint names of ``a`` to those of ``b``, of joints that turn the same part of the body.

    Each is the name of a usual skeleton or a Skeleton with the names of one: "cmu-amc" (also its
    ASF), "cmu-bvh" (cgspeed's MotionBuilder-friendly files), "cmu-bvh-3dsmax", "cmu-bvh-daz",
    "humanml3d-22", "smpl-24" (SMPL), "smplh-52" (SMPL-H). What the other has no counterpart of is
    left out. ``joint_map(a, a)`` lists the names of a skeleton, those of SMPL in its order.

    Raises OptionError for a name or a Skeleton that is none of these.
    """
    ours, theirs = _joints(a), _joints(b)
    return {name: theirs[part] for part, name in ours.items() if part in theirs}


def _joints(known: str | Skeleton) -> dict[str, str]:
    """The joints of a skeleton by part."""
    if isinstance(known, Skeleton):
        return _recognized(known)
    if not isinstance(known, str) or known not in SKELETONS:
        near = nearest(known, SKELETONS) if isinstance(known, str) else ""
        raise OptionError(
            f"joint_map: no skeleton {known!r} among {', '.join(SKELETONS)}"
            + (f"; did you mean {near}?" if near else "")
        )
    return {part: names[0] for part, names in SKELETONS[known].items()}


def _recognized(skeleton: Skeleton) -> dict[str, str]:
    """The joints of ``skeleton`` as of the usual one that it has most joints of.

    It has to have all of the body's; fingers, eyes and the like may be missing. Of SMPL's, which
    differ in little else, all.
    """
    held = set(skeleton.joint_names)
    best: dict[str, str] = {}
    for kind, joints in SKELETONS.items():
        found = {
            part: present[0] for part, names in joints.items() if (present := _in(names, held))
        }
        needed = set(joints) if not kind.startswith("cmu") else set(joints) & set(SMPL_BODY)
        if needed <= set(found) and len(found) > len(best):
            best = found
    if not best:
        raise OptionError(
            f"joint_map: skeleton {skeleton.name!r} has the joint names of none of "
            f"{', '.join(SKELETONS)}"
        )
    return best


def limbs_of(skeleton: Skeleton) -> set[str]:
    """The names of the joints of thighs, shins, feet and arms, of a usual skeleton; else none."""
    try:
        known = _recognized(skeleton)
    except OptionError:
        return set()
    return {name for part, name in known.items() if part.partition("_")[2] in LIMBS}


def _in(names: tuple[str, ...], held: set[str]) -> list[str]:
    return [name for name in names if name in held]
