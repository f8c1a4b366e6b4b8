"""Arguments of functions and parameters of codecs, read and checked: OptionError names them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from mcz.errors import OptionError


def in_range(text: str, parse: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """``parse``, which takes what ``text`` says in words."""
    parse.range = text  # type: ignore[attr-defined]
    return parse


def integer(name: str, low: int, high: int) -> Callable[[Any], int]:
    """A parser of integers from ``low`` to ``high``."""

    def parse(text: Any) -> int:
        try:
            value = int(text)
            if isinstance(text, bool) or (isinstance(text, float) and value != text):
                raise ValueError
        except (TypeError, ValueError, OverflowError):
            raise OptionError(f"{name} is {text!r}, not an integer") from None
        if not low <= value <= high:
            raise OptionError(f"{name} is {value}, not from {low} to {high}", value=value)
        return value

    return in_range(f"{low:,} to {high:,}", parse)


def number(name: str, low: float, high: float) -> Callable[[Any], float]:
    """A parser of numbers from ``low`` to ``high``."""

    def parse(text: Any) -> float:
        try:
            if isinstance(text, bool):
                raise ValueError
            value = float(text)
        except (TypeError, ValueError, OverflowError):
            raise OptionError(f"{name} is {text!r}, not a number") from None
        if not low <= value <= high:
            raise OptionError(f"{name} is {value}, not from {low:g} to {high:g}", value=value)
        return value

    return in_range(f"{low:g} to {high:g}", parse)


def choice(
    name: str, among: tuple[str, ...], formerly: Mapping[str, str] = MappingProxyType({})
) -> Callable[[Any], str]:
    """A parser of one word of several; ``formerly``: words of older files -> today's."""

    def parse(text: Any) -> str:
        if isinstance(text, str):
            text = formerly.get(text, text)
        if text not in among:
            raise OptionError(f"{name} is {text!r}, not one of {', '.join(among)}")
        return str(text)

    return in_range(", ".join(among), parse)
