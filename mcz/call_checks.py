"""Arguments of the public functions, checked against what their signatures say."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import wraps
from types import FunctionType
from typing import Any

import numpy as np

from mcz.checks import INTEGER, TEXT, TEXT_MAP, TRUTH, Rule, of_type, optional, shortened
from mcz.errors import OptionError
from mcz.motion import Motion, Skeleton


def _fits(words: str, test: Callable[[Any], bool]) -> Rule:
    def form(value: Any) -> Any:
        if not test(value):
            raise TypeError
        return value

    return Rule(words, form)


def _is_number(value: Any) -> bool:
    if isinstance(value, (bool, np.bool_)):
        return False
    return isinstance(value, (int, float, Fraction, np.number)) and not isinstance(
        value, np.complexfloating
    )


def _is_moving(value: Any) -> bool:
    return isinstance(value, Motion) or all(hasattr(value, n) for n in ("skeleton", "signals"))


def _is_joint(value: Any) -> bool:
    return isinstance(value, (str, int, np.integer)) and not isinstance(value, bool)


def _all(value: Any, test: Callable[[Any], bool]) -> bool:
    """Whether an iterable has such items alone; an iterator is not asked for them."""
    if isinstance(value, (bytes, Mapping)) or not np.iterable(value):
        return False
    return not isinstance(value, (list, tuple, set, np.ndarray)) or all(map(test, value))


def _are_joints(value: Any) -> bool:
    return _is_joint(value) or _all(value, _is_joint)


def _are_several(value: Any) -> bool:
    return not _is_joint(value) and _are_joints(value)


def _is_name(value: Any) -> bool:
    return isinstance(value, str)


def _are_names(value: Any) -> bool:
    return isinstance(value, str) or _all(value, _is_name)


def _is_path(value: Any) -> bool:
    return isinstance(value, (str, os.PathLike))


def _is_target(value: Any) -> bool:
    return _is_path(value) or hasattr(value, "clips")


def _are_two(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and len(value) == 2 and all(map(_is_integer, value))


def _is_integer(value: Any) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _are_frames(value: Any) -> bool:
    ends = (value.start, value.stop, value.step) if isinstance(value, slice) else value
    if not isinstance(value, slice) and (not isinstance(value, (tuple, list)) or len(ends) != 2):
        return False
    return all(end is None or _is_integer(end) for end in ends)


def _is_float_type(value: Any) -> bool:
    return value is not None and np.dtype(value).kind in "fiub"


MOTION, SKELETON = of_type(Motion, "a Motion"), of_type(Skeleton, "a Skeleton")
MOVING = _fits("a Motion or a Clip", _is_moving)
EITHER = _fits("a Motion or a Skeleton", lambda value: isinstance(value, (Motion, Skeleton)))
NUMBER = _fits("a number", _is_number)
JOINTS = _fits("a joint or several", _are_joints)
SEVERAL_JOINTS = _fits("several joints", _are_several)
JOINT = _fits("the name or number of a joint", _is_joint)
MAPPING = of_type(Mapping, "a mapping")
PATH = _fits("a path", _is_path)
NAMES = _fits("a name or several", _are_names)
FRAMES = _fits("a slice, or two numbers of frames", _are_frames)
CALLABLE = _fits("a function", callable)
RULES = {
    "Motion": MOTION,
    "Skeleton": SKELETON,
    "Moving": MOVING,
    "Moving | Skeleton": _fits(
        "a Motion, a Clip or a Skeleton", lambda v: _is_moving(v) or isinstance(v, Skeleton)
    ),
    "Named": EITHER,
    "Given": EITHER,
    "str": TEXT,
    "int": INTEGER,
    "bool": TRUTH,
    "float": NUMBER,
    "Fraction": NUMBER,
    "Fraction | float": NUMBER,
    "Joints": JOINTS,
    "str | int | Iterable[str | int]": JOINTS,
    "Sequence[int | str]": SEVERAL_JOINTS,
    "Contacts | Sequence[int | str] | bool": _fits(
        "Contacts, joints or a bool",
        lambda v: isinstance(v, bool) or type(v).__name__ == "Contacts" or _are_several(v),
    ),
    "ContactRule": _fits("a ContactRule", lambda v: type(v).__name__ == "ContactRule"),
    "Collection[str]": NAMES,
    "Sequence[str]": NAMES,
    "Iterable[str]": NAMES,
    "str | Sequence[str]": NAMES,
    "str | Iterable[str]": NAMES,
    "Sequence[str | os.PathLike[str]]": _fits("several paths", lambda v: _all(v, _is_path)),
    "Target | Iterable[Target]": _fits(
        "a path, a File or several", lambda v: _is_target(v) or _all(v, _is_target)
    ),
    "Progress": CALLABLE,
    "Step": CALLABLE,
    "Callable[[int, int, str], object]": CALLABLE,
    "int | str": JOINT,
    "Frames": FRAMES,
    "tuple[int, int | None]": FRAMES,
    "tuple[int, int]": _fits("two integers", _are_two),
    "str | os.PathLike[str]": PATH,
    "Mapping[str, str]": MAPPING,
    "Mapping[str, Any]": MAPPING,
    "Mapping[str, Said]": _fits(
        "a mapping of names to mappings",
        lambda v: all(isinstance(said, Mapping) for said in v.values()),
    ),
}
BY_NAME = {"dtype": _fits("a type of numbers", _is_float_type), "info": optional(TEXT_MAP)}
MAY_BE_NONE = ("Joints", "Frames")


def checked(function: FunctionType) -> Callable[..., Any]:
    """``function`` that raises OptionError for arguments of other types than its signature says."""
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    rules = {name: rule for name in function.__annotations__ if (rule := _rule_of(function, name))}

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        for name, value in (*zip(names, arguments, strict=False), *named.items()):
            if name in rules:
                _check(function.__name__, name, rules[name], value)
        return function(*arguments, **named)

    call.__module__ = "mcz"  # by which it is pickled
    return call


def _rule_of(function: FunctionType, name: str) -> Rule | None:
    said = str(function.__annotations__[name])
    if name in BY_NAME:
        return BY_NAME[name]
    rule = RULES.get(said.removesuffix(" | None"))
    if rule is not None and (said.endswith(" | None") or said in MAY_BE_NONE):
        return optional(rule)
    return rule


def _check(function: str, name: str, rule: Rule, value: Any) -> None:
    try:
        rule.form(value)
    except (TypeError, ValueError, OverflowError, AttributeError):
        said = f"{function}: {name} is {shortened(value)}, not {rule.words}"
        raise OptionError(said) from None
