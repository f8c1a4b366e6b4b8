"""Functions of ``mcz.kinematics.poses`` as methods of a clip: only needed values are decoded."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

if TYPE_CHECKING:
    from mcz.kinematics.poses.motion_like import MotionLike

P = ParamSpec("P")
T = TypeVar("T")


class PoseMethod:
    """A function of ``mcz.kinematics.poses`` as a method of its name, imported on first use."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._owner, self._name = owner, name

    def __get__(self, instance: object, owner: type) -> object:
        function = getattr(import_module("mcz.kinematics.poses"), self._name)
        setattr(self._owner, self._name, function)
        return function.__get__(instance, owner)


def method_of(
    function: Callable[Concatenate[MotionLike, P], T],
) -> Callable[Concatenate[Any, P], T]:
    """Type of a method: checkers need not find out whether a clip is a ``ClipLike``."""
    return function
