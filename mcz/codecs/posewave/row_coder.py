"""Streams of rows, one per level; decoding a level needs all coarser ones.

SPEC.md, "Codec 3: posewave", is normative.
"""

from __future__ import annotations

from copy import copy, deepcopy
from typing import TYPE_CHECKING

import numpy as np

from mcz.codecs.coding import mixing
from mcz.codecs.posewave import head_kernels, model_kernels
from mcz.codecs.posewave.header import NAME, Header
from mcz.codecs.posewave.model import make_model, new_rows, no_rows
from mcz.codecs.posewave.model_state import N_SMALL, LevelRows
from mcz.errors import FormatError, MotionError
from mcz.model.types import Bools, Floats, Ints

if TYPE_CHECKING:
    from mcz.codecs.posewave.level_coder import CourseMetric

TOO_LARGE = f"{NAME}: a coefficient exceeds 2^29 quantizer steps"
CARRIED = 40.0  # most rows for which coarser levels count


class Stream:
    """The bytes of a level, written or read; ``coder`` is passed from one to the next."""

    def __init__(self, coder: Ints, size: int, stream: bytes | None) -> None:
        self.coder = coder
        self.data = (
            np.zeros(size, np.uint8) if stream is None else np.frombuffer(stream, np.uint8).copy()
        )
        mixing.start(coder, self.data, 1 if stream is None else 0)

    def finish(self) -> bytes:
        n_bytes = int(mixing.finish(self.coder, self.data))
        if n_bytes > len(self.data):
            raise AssertionError(f"{n_bytes} bytes in {len(self.data)}")
        return self.data[:n_bytes].tobytes()

    @property
    def is_whole(self) -> bool:
        """True if every byte was needed, after the last bit was decoded."""
        return bool(mixing.coded_size(self.coder) == len(self.data))


def code_head(stream: Stream, classes: Ints, kept: Ints, numbers: Ints, where: str) -> None:
    """Code the mask ``kept`` of channels and the ``numbers`` of all, in place."""
    if head_kernels.code_head(stream.coder, stream.data, N_SMALL, classes, kept, numbers):
        raise FormatError("a first value exceeds 40 bits", where=where)


class RowMemory:
    """The last coded rows of a segment, for an encode in which few of them differ.

    Only the steps of some rows may differ: all others keep their values, which is faster than
    choosing them, and keeps errors elsewhere.
    """

    def __init__(self) -> None:
        self._levels: dict[int, tuple[Ints, Ints]] = {}  # exponents and doubles

    def recall(self, level: int, rows: RowCoder) -> None:
        """Let ``rows`` keep values of the last encode, before a level is coded."""
        if level not in self._levels:
            return
        exponents, doubles = self._levels[level]
        kept = exponents == rows.exponents
        if level == 0:  # each row is a difference from what those before have come to
            kept = np.logical_and.accumulate(kept)
        rows.keep(kept, doubles)

    def note(self, level: int, exponents: Ints, rows: RowCoder) -> None:
        """Remember a level; ``exponents`` are the requested ones."""
        self._levels[level] = exponents, rows.doubles


class RowCoder:
    """Codes the rows of one level after the other, all with one adaptive model.

    ``classes`` and ``kept`` are of all channels; ``where`` opens messages.
    """

    stream: Stream
    _rows: LevelRows

    def __init__(self, header: Header, classes: Ints, kept: Bools, coder: Ints, where: str) -> None:
        known, channels = header.prior, np.flatnonzero(kept)
        self.where, self.n_kept = where, len(channels)
        self._flags = int(header.refining), int(header.dependent)
        prior = None if known is None else known.of(channels)
        self.model = make_model(classes[channels], header.start, coder, prior)
        self._coarser = [no_rows(self.n_kept)] * 2  # two levels of details, the coarser one last

    def copy(self) -> RowCoder:
        """Return an independent copy, between two streams."""
        clone = copy(self)
        clone.model = deepcopy(self.model)
        return clone

    def begin(self, level: int, kind: int, n_rows: int, stream: Stream) -> None:
        """Begin a level; ``kind`` selects the usual size of its coefficients."""
        if level > 1:
            self._coarser = [self._rows.here[3:], self._coarser[0]]
        self.kind, self.stream = kind, stream
        self._make_room(0, new_rows(n_rows, self.n_kept))
        seen = self.model.seen
        if seen[0] > CARRIED:
            self.model.variances[:] *= CARRIED / seen[0]
            seen[0] = CARRIED

    def go_on(self, n_rows: int, stream: Stream) -> None:
        """Continue a level in another stream."""
        n_known = 2 - len(self._rows.q) % 2  # keeps the parity of numbers of rows
        last, known = self._rows.exponents[-1], self._rows.here[-3 - n_known :]
        self.stream = stream
        self._make_room(n_known, np.concatenate([known, new_rows(n_rows, self.n_kept)[3:]]))
        self._rows.exponents[n_known - 1] = last

    def _make_room(self, n_known: int, here: Floats) -> None:
        """Allocate rows for ``here``, which begins with ``n_known`` rows of the previous stream."""
        self._n_known, n_rows = n_known, len(here) - 3
        self._rows = LevelRows(
            q=np.zeros((n_rows, self.n_kept), np.int64),
            y=np.zeros((n_rows, self.n_kept)),
            here=here,
            parent=self._coarser[0],
            grand=self._coarser[1],
            exponents=np.zeros(n_rows, np.int64),
            is_kept=np.zeros(n_rows, np.bool_),
        )

    @property
    def exponents(self) -> Ints:
        """Octaves by which the steps of each row are finer, (n_rows,)."""
        return self._rows.exponents[self._n_known :]

    @property
    def doubles(self) -> Ints:
        """Twice the values of these rows, (n_rows, n_kept), in steps."""
        return self._rows.q[self._n_known :]

    def keep(self, kept: Bools, doubles: Ints) -> None:
        """Let an encoder take these values of the rows that are ``kept`` (n_rows,)."""
        self._rows.is_kept[self._n_known :] = kept
        self.doubles[kept] = doubles[kept]

    def encode(self, rate_weight: float, rows: Floats) -> Floats:
        """Encode all rows of coefficients; return them as a decoder will have them, in steps."""
        self._rows.y[self._n_known :] = rows
        if not (np.abs(rows) < model_kernels.MOST_WANTED).all():  # NaN too
            raise MotionError(TOO_LARGE)
        self._run(rate_weight)
        return self._row_values()

    def encode_course(
        self,
        rate_weight: float,
        metric: CourseMetric,
        rows: Floats,
        steps: Floats,
        approx: Floats,
    ) -> None:
        """Code approximations (n_rows, n_kept) row by row; fill ``approx`` with decoded ones.

        ``steps`` (n_rows,): the step of each row.
        """
        if not self.n_kept:
            return
        fault = model_kernels.code_course(
            *metric,
            rows,
            steps,
            approx,
            self.model,
            self.stream.data,
            self._rows,
            self.kind,
            self._n_known,
            rate_weight,
            *self._flags,
        )
        if fault == model_kernels.TOO_LARGE:
            raise MotionError(TOO_LARGE)
        self._check(fault)

    def decode(self, *, ends: bool = True) -> Floats:
        """All rows of the level, (n_rows, n_kept), in steps; ``ends``: the stream must end too."""
        if not self.n_kept:
            if not self.stream.is_whole:  # PWAVE-20, PWAVE-30
                raise FormatError("rows have bytes, but no channel is kept", where=self.where)
            return self._row_values()
        self._run(-1.0)
        if ends and not self.stream.is_whole:  # ROWS-01
            raise FormatError(
                f"rows of kind {self.kind} should not have {len(self.stream.data)} bytes",
                where=self.where,
            )
        return self._row_values()

    def _run(self, rate_weight: float) -> None:
        if not self.n_kept:
            return
        fault = model_kernels.code_rows(
            self.model,
            self.stream.data,
            self._rows,
            self.kind,
            self._n_known,
            len(self._rows.q),
            rate_weight,
            *self._flags,
        )
        self._check(fault)

    def _check(self, fault: int) -> None:
        if fault >= 0:
            raise FormatError(
                f"row {fault} of level of kind {self.kind} is out of range", where=self.where
            )

    def _row_values(self) -> Floats:
        return np.multiply(self.doubles, 0.5, dtype=np.float64)
