"""Joints by name: feet, and groups such as hands or legs."""

from __future__ import annotations

import re

from mcz.errors import OptionError
from mcz.model.motion import Skeleton
from mcz.model.text_format import among

GROUPS = {
    "hands": r"hand|wrist|finger|thumb|index|middle|ring|pinky",
    "head": r"head|neck|eye|jaw",
    "arms": r"clavicle|collar|shoulder|humerus|arm|radius|elbow|hand|wrist|finger|thumb",
    "legs": r"hip|thigh|femur|upleg|leg|knee|shin|tibia|foot|toe|ankle",
    "spine": r"spine|back|chest|thorax|abdomen",
    "all": "",
}
_SIDE = "(?:left|right|l|r)"
_PART = "(?:foot|fore ?foot|ankle|heel|hee|ball|toe ?base|toes?|toe0)"
# The side first or last, before it any text that ends without a letter: "Bip01 L Foot",
# "mixamorig:...".
_FOOT = re.compile(rf"(?:.*[^a-z])?(?:{_SIDE} ?{_PART}|{_PART} ?{_SIDE})", re.DOTALL)
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")
_BETWEEN = re.compile(r"[\s_.\-]+")


def is_foot(name: str) -> bool:
    """Return True if a joint of this name is a part of a foot, by docs/guides/contacts.md.

    >>> [is_foot(name) for name in ("lfoot", "LeftToeBase", "Bip01 R Toe0", "foot_L", "lfemur")]
    [True, True, True, True, False]
    """
    words = _BETWEEN.sub(" ", _HUMP.sub(" ", name)).strip().lower()
    return _FOOT.fullmatch(words) is not None


def find_feet(skeleton: Skeleton) -> list[int]:
    """The joints that are parts of feet, by name, in joint order."""
    return [index for index, joint in enumerate(skeleton.joints) if is_foot(joint.name)]


def find_joints(skeleton: Skeleton, name: str, option: str) -> list[int]:
    """The joints for ``name``: a joint of that name, or else a group.

    Raises OptionError, which names the ``option``.
    """
    addresses = skeleton.addresses()
    if name in addresses:
        return [addresses.index(name)]
    joints = []
    if name == "feet":
        joints = find_feet(skeleton)
    elif name in GROUPS:
        pattern = re.compile(GROUPS[name], re.IGNORECASE)
        joints = [i for i, joint in enumerate(skeleton.joints) if pattern.search(joint.name)]
    if not joints and (name == "feet" or name in GROUPS):
        raise OptionError(f"{option}: no joint is named like one of the {name}; name the joints")
    if not joints:
        known = ["feet", *GROUPS, *addresses]
        raise OptionError(
            f"{option}: no joint or group {name!r}; the names are {among(known, name)}"
        )
    return joints
