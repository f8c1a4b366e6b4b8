"""Joints recognized by name: feet, groups such as hands or legs, left and right."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from mcz.errors import OptionError
from mcz.model.motion import Skeleton
from mcz.model.text_format import suggest_names

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
            f"{option}: no joint or group {name!r}; the names are {suggest_names(known, name)}"
        )
    return joints


# A whole word: "LeftUpLeg", "upperarm_left", "LEFT_HIP", but neither "Bright" nor "cleft".
_WORD = re.compile(r"Left|Right|LEFT|RIGHT|(?<![A-Za-z])(?:left|right)")
# A separate letter: "Bip01 L Foot", "thigh_R", "hand.l".
_LETTER = re.compile(r"(?<![A-Za-z0-9])[LlRr](?![A-Za-z0-9])")
# A letter before or after a word: "lfemur", "LHipJoint", "__rThigh", "ThighL". Other words begin
# so as well, such as "lowerback" and "root".
_PREFIX = re.compile(r"(?<![A-Za-z0-9])[LlRr](?=[A-Za-z])")
_SUFFIX = re.compile(r"(?<=[a-z])[LR](?=$|[^A-Za-z])")
# Rests of a word after the letter that prove a side.
_BODY = re.compile(
    r"hip|buttock|thigh|up(?:per)?_?leg|femur|knee|shin|calf|tibia|leg|ankle|foot|toe|heel|collar|"
    r"clavicle|shoulder|shldr|humerus|up(?:per)?_?arm|arm|elbow|fore_?arm|radius|ulna|wrist|hand|"
    r"finger|thumb|index|mid|ring|pinky|eye|breast",
    re.IGNORECASE,
)
_OTHER = {
    "left": "right",
    "right": "left",
    "Left": "Right",
    "Right": "Left",
    "LEFT": "RIGHT",
    "RIGHT": "LEFT",
    "l": "r",
    "r": "l",
    "L": "R",
    "R": "L",
}


def counterparts(names: Sequence[str], pairs: Mapping[str, str] | None = None) -> list[int]:
    """Index of every joint's counterpart on the other side; its own without a side.

    ``names`` are the names of all joints, each once. ``pairs`` maps names to names, in one
    direction or both, with precedence; a joint without a side maps to its own name. Raises
    OptionError for a joint in ``pairs`` that is unknown or has two counterparts, and for a name of
    a side whose counterpart is missing.
    """
    numbers = {name: number for number, name in enumerate(names)}
    partners = _pair_numbers(numbers, pairs or {})
    for name, number in numbers.items():
        if number not in partners:
            other = (
                numbers[name]
                if (mate := _find_counterpart(name, numbers)) is None
                else numbers[mate]
            )
            if other in partners:  # taken by ``pairs``
                raise OptionError(
                    f"mirror: {names[other]!r} would be the counterpart of {name!r} and of "
                    f"{names[partners[other]]!r}; name the pairs of all three"
                )
            partners[number], partners[other] = other, number
    return [partners[number] for number in range(len(names))]


def _pair_numbers(numbers: Mapping[str, int], pairs: Mapping[str, str]) -> dict[int, int]:
    partners: dict[int, int] = {}
    for one, other in pairs.items():
        for name in (one, other):
            if name not in numbers:
                known = suggest_names(list(numbers), name)
                raise OptionError(f"mirror: pairs: no joint {name!r}; the joints are {known}")
        a, b = numbers[one], numbers[other]
        if partners.get(a, b) != b or partners.get(b, a) != a:
            raise OptionError(f"mirror: pairs: {one!r} or {other!r} has more than one counterpart")
        partners[a], partners[b] = b, a
    return partners


def _find_counterpart(name: str, names: Mapping[str, int]) -> str | None:
    for pattern in (_WORD, _LETTER):
        others = [other for other in _swap_sides(pattern, name) if other in names]
        if others:
            return others[0]
        if pattern.search(name):
            raise OptionError(
                f"mirror: joint {name!r} is named like one side, but there is no joint "
                f"{next(_swap_sides(pattern, name))!r}; name its counterpart, or itself, with "
                "pairs="
            )
    for pattern in (_PREFIX, _SUFFIX):
        others = [other for other in _swap_sides(pattern, name) if other in names]
        if others:
            return others[0]
    match = _PREFIX.search(name)
    if match and _BODY.match(name, match.end()):
        raise OptionError(
            f"mirror: joint {name!r} is named like one side, but there is no joint "
            f"{next(_swap_sides(_PREFIX, name))!r}; name its counterpart, or itself, with "
            "pairs="
        )
    return None


def _swap_sides(pattern: re.Pattern[str], name: str) -> Iterator[str]:
    """Yield the name with all its sides swapped, then with each one swapped."""
    if pattern.search(name):
        yield pattern.sub(lambda match: _OTHER[match[0]], name)
    for match in pattern.finditer(name):
        yield name[: match.start()] + _OTHER[match[0]] + name[match.end() :]


def sides_of(names: Sequence[str]) -> list[str]:
    """Side of every joint by its name: "left", "right" or "".

    A single letter before or after a word counts if the name with the other letter exists, or the
    word is a part of the body. ``names`` are the names of all joints.

    >>> sides_of(["root", "lfemur", "rfemur", "lowerback", "Hand.L", "LeftFoot"])
    ['', 'left', 'right', '', 'left', 'left']
    """
    known_names = set(names)
    return [_side(name, known_names) for name in names]


def _side(name: str, names: set[str]) -> str:
    for pattern in (_WORD, _LETTER, _PREFIX, _SUFFIX):
        match = pattern.search(name)
        if match is None:
            continue
        sure = pattern in (_WORD, _LETTER) or bool(_BODY.match(name, match.end()))
        if sure or any(other in names for other in _swap_sides(pattern, name)):
            return "left" if match[0][0] in "lL" else "right"
    return ""
