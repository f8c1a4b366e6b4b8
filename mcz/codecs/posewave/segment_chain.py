"""Segments without levels, each of which may continue the state of the one before.

SPEC.md, "Codec 3: posewave", "Segments that go on", is normative.
"""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.header import NAME, Header
from mcz.codecs.posewave.level_coder import LevelCoder
from mcz.codecs.posewave.pyramid import Pyramid
from mcz.codecs.posewave.row_coder import RowCoder, Stream, code_head, fresh_coder
from mcz.codecs.posewave.segment import Head, choose_head, classes_of, kinds_of, room_of
from mcz.errors import FormatError
from mcz.model.motion import Skeleton

Floats = NDArray[np.float64]


class SegmentChain:
    """State carried from segment to segment; after a refused one only a fresh one decodes."""

    def __init__(self, header: Header, skeleton: Skeleton) -> None:
        self.header, self.skeleton = header, skeleton
        self._classes = classes_of(skeleton, header.whole)
        self._kinds = kinds_of(skeleton, header.whole)
        self._level_coder: LevelCoder | None = None  # None: nothing can go on
        self._rows: RowCoder | None = None

    def copy(self) -> SegmentChain:
        """Return an independent copy."""
        clone = copy(self)
        if self._level_coder is not None and self._rows is not None:
            clone._level_coder, clone._rows = self._level_coder.copy(), self._rows.copy()
        return clone

    def decode(self, stream: bytes, n_frames: int, where: str, *, fresh: bool) -> Floats:
        """The values of a segment, (n_frames, n_channels); raises FormatError for bad bytes."""
        if fresh:
            coding = Stream(fresh_coder(self.header.start), 0, stream)
            kept, numbers = np.zeros((2, len(self._classes)), np.int64)
            code_head(coding, self._kinds, kept, numbers, where)
            level_coder, rows = self._begin(Head(kept == 1, numbers), n_frames, coding)
        else:
            level_coder, rows = self._continued_state(where)
            rows.go_on(n_frames, Stream(rows.model.coder, 0, stream))  # PWAVE-29
        self._level_coder = None
        rows.where = where
        level_coder.take_coarsest(0, rows.decode(), rows.exponents)
        self._level_coder, self._rows = level_coder, rows
        return level_coder.values()

    def encode(
        self, values: Floats, weight: float, exponent: int, *, fresh: bool
    ) -> tuple[bytes, Floats]:
        """Encode a segment of unwrapped ``values``; return its stream and the decoded values.

        Both are (n_frames, n_channels). A bit costs ``weight`` squared steps; the step is
        2^-``exponent`` of the usual one. Raises MotionError for values that are too large.
        """
        n_frames = len(values)
        if fresh:
            head = choose_head(self.header, values, np.ones(values.shape[1], np.bool_), values)
            coder = fresh_coder(self.header.start)
            coding = Stream(coder, room_of(Pyramid(n_frames, 0, 0), 0, head.moving), None)
            code_head(coding, self._kinds, head.moving.astype(np.int64), head.numbers.copy(), NAME)
            level_coder, rows = self._begin(head, n_frames, coding)
        else:
            level_coder, rows = self._continued_state(NAME)
            room = n_frames * (8 * rows.n_kept + 1) + 1024
            rows.go_on(n_frames, Stream(rows.model.coder, room, None))
        rows.exponents[:] = exponent

        def code(first: int, wanted: Floats) -> Floats:
            return rows.encode(weight, first, wanted)

        level_coder.code_coarsest(0, code, values[:, level_coder.kept], rows.exponents)
        self._level_coder, self._rows = level_coder, rows
        return rows.stream.finish(), level_coder.values()

    def _continued_state(self, where: str) -> tuple[LevelCoder, RowCoder]:
        if self._level_coder is None or self._rows is None:  # DATA-11
            raise FormatError("goes on from a segment that is not there", where=where)
        return self._level_coder, self._rows

    def _begin(self, head: Head, n_frames: int, coding: Stream) -> tuple[LevelCoder, RowCoder]:
        header = self.header
        pyramid = Pyramid(n_frames, 0, 0)
        level_coder = LevelCoder(header, self.skeleton, pyramid, head.moving, head.values(header))
        rows = RowCoder(header, self._classes, head.moving, coding.coder, NAME)
        rows.begin(0, pyramid.kind(0), n_frames, coding)
        return level_coder, rows
