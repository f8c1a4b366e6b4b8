"""Segments of a clip that a search for a target has already encoded.

A search encodes one clip again and again; what it asks for twice is not encoded twice, above all
the result. Where only steps of some rows differ, the other rows keep their values, see
``RowMemory``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from mcz.codecs.posewave.header import Header
from mcz.codecs.posewave.row_coder import RowMemory
from mcz.model.types import Floats, Ints

Streams = tuple[bytes, ...]


class Trial(NamedTuple):
    """Settings that differ between encodes of one segment, with the ``octaves`` of its frames."""

    header: bytes
    first: int
    stop: int
    octaves: bytes


def trial_of(header: bytes, first: int, stop: int, refinement: Ints | None) -> Trial:
    octaves = b"" if refinement is None else refinement.astype("u1").tobytes()
    return Trial(header, first, stop, octaves)


Encode = Callable[[RowMemory | None], tuple[Streams, Floats]]  # of one segment


class Memory:
    """The streams of all trials, and the rows of the last step that was tried.

    ``frame_bytes`` is about what a frame will take.
    """

    def __init__(self) -> None:
        self.frame_bytes = 0.0
        self._streams: dict[Trial, Streams] = {}
        self._settings: tuple[object, ...] = ()
        self._rows: dict[tuple[int, int], RowMemory] = {}

    def streams(self, trial: Trial, header: Header, encode: Encode) -> Streams:
        """The streams of a segment, by ``encode`` unless they are known."""
        if trial not in self._streams:
            rows = self._rows_of(trial, header) if trial.octaves else None
            self._streams[trial], _ = encode(rows)
        return self._streams[trial]

    def _rows_of(self, trial: Trial, header: Header) -> RowMemory:
        """The rows of a segment; new ones where more than steps of rows differs from earlier."""
        settings = header.step, header.levels, header.weights.tobytes()
        if settings != self._settings:
            self._settings, self._rows = settings, {}
        return self._rows.setdefault((trial.first, trial.stop), RowMemory())
