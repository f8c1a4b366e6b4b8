"""Data of a source file from which it is restored byte for byte."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

from mcz.errors import MotionError
from mcz.model import text_format
from mcz.model.checks import DATA, HASH, INTEGER, TEXT, Rule, check_fields


class FrameNotes(Protocol):
    """Notes of a source on each frame, other than its values; a source format defines them."""

    def cut(self, start: int, stop: int) -> bytes:
        """The notes of frames start <= f < stop as bytes of a segment, b"" if there are none."""

    def part(self, start: int, stop: int) -> FrameNotes:
        """The notes of frames start <= f < stop, numbered from 0."""


SOURCE = {
    "format": TEXT,
    "template": DATA,
    "detail": DATA,
    "notes": Rule("notes of frames or None", lambda notes: notes and notes.cut and notes),
    "path": TEXT,
    "size": INTEGER,
    "sha256": HASH,
}


@dataclass(frozen=True, slots=True)
class Source:
    """Data, other than the values, to restore a source file byte for byte.

    ``template`` is shared by clips of the same layout; ``detail`` belongs to this clip; ``notes``
    holds notes on single frames. The source format defines all three.
    """

    format: str
    template: bytes = field(repr=False)
    detail: bytes = b""
    notes: FrameNotes | None = field(default=None, repr=False)
    path: str = ""
    size: int = 0
    sha256: bytes = b""

    __repr__ = text_format.source_text

    def __post_init__(self) -> None:
        check_fields(self, SOURCE)
        if self.size < 0:
            raise MotionError(f"source: size is {self.size}")

    def of_no_file(self) -> Source:
        """The same for changed values or frames: without size and hash."""
        return replace(self, size=0, sha256=b"")

    def cut(self, start: int, stop: int) -> Source:
        """The source of frames start <= f < stop."""
        notes = self.notes and self.notes.part(start, stop)
        return replace(self, notes=notes).of_no_file()
