"""The clips of a data set, and where their frames come from."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True, slots=True)
class Member:
    """One clip of a data set, or the part of one between two gaps.

    ``target`` is what ``mcz.open`` takes, ``n_source`` its frames at ``source_rate`` frames a
    second (None: unknown) from frame ``first`` on, at ``time`` in seconds (None: unknown);
    ``n_frames`` are those of the data set, at the rate of the data set. ``is_even``: each frame
    follows the one before by 1 / ``source_rate``; else the times of the clip say when it was.
    """

    target: str
    clip: str
    n_source: int
    source_rate: Fraction | None
    n_frames: int
    first: int = 0
    time: float | None = None
    is_even: bool = True

    @property
    def label(self) -> str:
        return f"{self.target}: {self.clip}"
