"""Joints by words: a joint's name, or a group of joints such as feet or hands."""

from __future__ import annotations

import re

from mcz.brief import among
from mcz.errors import OptionError
from mcz.kinematics.feet import feet_of
from mcz.motion import Skeleton

GROUPS = {
    "hands": r"hand|wrist|finger|thumb|index|middle|ring|pinky",
    "head": r"head|neck|eye|jaw",
    "arms": r"clavicle|collar|shoulder|humerus|arm|radius|elbow|hand|wrist|finger|thumb",
    "legs": r"hip|thigh|femur|upleg|leg|knee|shin|tibia|foot|toe|ankle",
    "spine": r"spine|back|chest|thorax|abdomen",
    "all": "",
}


def joints_of(skeleton: Skeleton, name: str, option: str) -> list[int]:
    """The joints that ``name`` means: a joint of that name, or else a group.

    Raises OptionError, which names the ``option``.
    """
    addresses = skeleton.addresses()
    if name in addresses:
        return [addresses.index(name)]
    found = []
    if name == "feet":
        found = feet_of(skeleton)
    elif name in GROUPS:
        pattern = re.compile(GROUPS[name], re.IGNORECASE)
        found = [i for i, joint in enumerate(skeleton.joints) if pattern.search(joint.name)]
    if not found and (name == "feet" or name in GROUPS):
        raise OptionError(
            f"{option}: no joint is one of the {name} by its name; name those that are"
        )
    if not found:
        known = ["feet", *GROUPS, *addresses]
        raise OptionError(f"{option}: no joint or group {name!r} among {among(known, name)}")
    return found
