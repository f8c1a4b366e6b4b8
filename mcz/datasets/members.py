"""The clips of a data set, and where their frames come from."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True, slots=True)
class Member:
    """One clip of a data set.

    ``target`` is what ``mcz.open`` takes, ``n_source`` its frames at ``source_rate`` frames a
    second (None: unknown), ``n_frames`` those of the data set, at the rate of the data set.
    """

    target: str
    clip: str
    n_source: int
    source_rate: Fraction | None
    n_frames: int

    @property
    def label(self) -> str:
        return f"{self.target}: {self.clip}"
