"""Conditions on fields, as they are written: ``this.flags & 1``, ``this.kind == 3``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mcz.schema.source import Fields


class Term:
    """What ``this.name`` is: a condition that looks at the field ``name``."""

    def __init__(self, of: Callable[[Fields], Any]) -> None:
        self.of = of

    def __call__(self, fields: Fields) -> Any:
        return self.of(fields)

    def __and__(self, bits: int) -> Term:
        return Term(lambda fields: self.of(fields) & bits)

    def __eq__(self, value: object) -> Term:  # type: ignore[override]
        return Term(lambda fields: self.of(fields) == value)

    __hash__ = object.__hash__


class This:
    """The structure whose fields a condition looks at: ``this.flags & 1``, ``this.kind == 3``."""

    def __getattr__(self, name: str) -> Term:
        return Term(lambda fields: fields[name])


this = This()
