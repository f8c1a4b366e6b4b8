"""Joints in a quality record: by index in a file, by name for people. SPEC.md, "QUAL"."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

from mcz.kinematics import point_names
from mcz.motion import Skeleton

LISTS = ("cut-joints", "edit-joints")
JOINTS = ("shell_max_joint", "slide_max_joint")
POINT = "max_position_error_point"
WORDS = ("param.contacts", "param.lossless", "param.quality")  # joints, or groups of them
REACHED = "quality_reached."  # the key of what such a joint or group has reached
_BEFORE = re.compile(r"(?:uncut_|unedited_|edit_)*")
_WORD = re.compile(r"(.*?)((?::[0-9]+\+[0-9]+|=[^=,]*)?)")  # a joint, and its frames or limit
_INDEX = re.compile(r"0|[1-9][0-9]{0,15}")

Lookup = Callable[[str], str | None]  # None: there is no such joint


def with_names(entries: Mapping[str, str], skeleton: Skeleton) -> dict[str, str]:
    """The entries of a stored record with names of joints; an index beyond all stays."""
    return _translated(entries, _name_of(skeleton.addresses()), _name_of(point_names(skeleton)))


def with_indices(entries: Mapping[str, str], skeleton: Skeleton) -> dict[str, str]:
    """The entries as a file has them; joints that ``skeleton`` has not are left out."""
    return _translated(entries, _index_of(skeleton.addresses()), _index_of(point_names(skeleton)))


def _name_of(names: Sequence[str]) -> Lookup:
    def look_up(text: str) -> str:
        known = _INDEX.fullmatch(text) and int(text) < len(names)
        return names[int(text)] if known else text

    return look_up


def _index_of(names: Sequence[str]) -> Lookup:
    places = {name: str(index) for index, name in reversed(list(enumerate(names)))}

    def look_up(text: str) -> str | None:
        return places.get(text, None if _INDEX.fullmatch(text) else text)

    return look_up


def _translated(entries: Mapping[str, str], joint: Lookup, point: Lookup) -> dict[str, str]:
    found = {}
    for key, value in entries.items():
        before = _BEFORE.match(key)
        assert before is not None
        start, name, text = before[0], key[before.end() :], value
        if name in LISTS or name in WORDS:
            words = [_WORD.fullmatch(word) for word in value.split(",")]
            parts = [(joint(word[1]), word[2]) for word in words if word is not None]
            text = ",".join(f"{known}{rest}" for known, rest in parts if known is not None)
        elif name in JOINTS or name == POINT:
            text = (joint if name in JOINTS else point)(value) or ""
        elif name.startswith(REACHED):
            known = joint(name.removeprefix(REACHED))
            name = "" if known is None else REACHED + known
        if name and (text or not value):
            found[start + name] = text
    return found
