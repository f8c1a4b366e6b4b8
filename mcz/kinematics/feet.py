"""Feet of a skeleton, found by joint names."""

from __future__ import annotations

import re

from mcz.motion import Skeleton

_SIDE = "(?:left|right|l|r)"
_PART = "(?:foot|fore ?foot|ankle|heel|hee|ball|toe ?base|toes?|toe0)"
# The side first or last, anything that ends in no letter before: "Bip01 L Foot", "mixamorig:...".
_FOOT = re.compile(rf"(?:.*[^a-z])?(?:{_SIDE} ?{_PART}|{_PART} ?{_SIDE})", re.DOTALL)
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")
_BETWEEN = re.compile(r"[\s_.\-]+")


def is_foot(name: str) -> bool:
    """Return whether a joint of this name is a part of a foot; docs/contacts.md lists the names.

    >>> [is_foot(name) for name in ("lfoot", "LeftToeBase", "Bip01 R Toe0", "foot_L", "lfemur")]
    [True, True, True, True, False]
    """
    words = _BETWEEN.sub(" ", _HUMP.sub(" ", name)).strip().lower()
    return _FOOT.fullmatch(words) is not None


def feet_of(skeleton: Skeleton) -> list[int]:
    """The joints that are parts of feet, by name, in joint order."""
    return [index for index, joint in enumerate(skeleton.joints) if is_foot(joint.name)]
