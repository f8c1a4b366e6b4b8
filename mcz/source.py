"""What is kept of a source file, so that it can be written again byte for byte."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from mcz import brief


class FrameNotes(Protocol):
    """What a source says about each frame beside its values; a source format defines it."""

    def cut(self, start: int, stop: int) -> bytes:
        """The notes of frames start <= f < stop as bytes of a segment, b"" where all is usual."""


@dataclass(frozen=True, slots=True)
class Source:
    """What is needed, beside the values, to restore a source file byte for byte.

    ``template`` is shared by clips that were printed alike; ``detail`` belongs to this clip;
    ``notes`` holds what is said frame by frame. All three are defined by the source format.
    """

    format: str
    template: bytes = field(repr=False)
    detail: bytes = b""
    notes: FrameNotes | None = field(default=None, repr=False)
    path: str = ""
    size: int = 0
    sha256: bytes = b""

    __repr__ = brief.source_text
