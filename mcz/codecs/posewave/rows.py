"""Streams of rows: one a level, of which a decoder needs those of all coarser levels.

SPEC.md, "Codec 13: posewave", is normative.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.header import NAME
from mcz.codecs.posewave.model import (
    Start,
    make_model,
    new_rows,
    no_rows,
    start_coder,
)
from mcz.codecs.posewave.state import N_SMALL
from mcz.errors import FormatError, MotionError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_WANTED = 2.0**29


@cache
def _model() -> Any:
    from mcz.codecs.posewave import model_kernels

    return model_kernels


@cache
def _head() -> Any:
    from mcz.codecs.posewave import head_kernels

    return head_kernels


@cache
def _coding() -> Any:
    from mcz.coding import mixing

    return mixing


class Stream:
    """The bytes of a level, being written, or, of a decoder, read; ``coder`` goes from one on."""

    def __init__(self, coder: Ints, size: int, given: bytes | None) -> None:
        self.coder = coder
        self.data = (
            np.zeros(size, np.uint8) if given is None else np.frombuffer(given, np.uint8).copy()
        )
        _coding().start(coder, self.data, 1 if given is None else 0)

    def finish(self) -> bytes:
        used = int(_coding().finish(self.coder, self.data))
        if used > len(self.data):
            raise AssertionError(f"{used} bytes in {len(self.data)}")
        return self.data[:used].tobytes()

    def check_whole(self, where: str) -> None:
        """Raises FormatError unless all bytes were due, after the last bit was decoded."""
        due = int(_coding().coded_size(self.coder))
        if due != len(self.data):  # ROWS-01
            raise FormatError(f"{where}: {len(self.data)} bytes, of which {due} were due")


def fresh_coder(start: Start) -> Ints:
    """The coder's state before the first stream of a segment."""
    return start_coder(start)


def code_head(stream: Stream, classes: Ints, kept: Ints, numbers: Ints, where: str) -> None:
    """Code which channels are ``kept`` and the ``numbers`` of all, in place."""
    if _head().code_head(stream.coder, stream.data, N_SMALL, classes, kept, numbers):
        raise FormatError(f"{where}: a first value of more than 40 bits")


class RowCoder:
    """Codes the rows of one level after the other, all with one model, which learns.

    ``classes`` are those of the kept channels; ``where`` opens messages.
    """

    def __init__(
        self, classes: Ints, start: Start, coder: Ints, where: str, *, refining: bool
    ) -> None:
        self.where, self.n_kept, self.refining = where, len(classes), refining
        self.model = make_model(classes, start, coder)
        nothing = no_rows(self.n_kept)
        self.here = nothing
        self.before = [nothing, nothing]  # the two levels of details before, the coarser one last

    def begin(self, level: int, kind: int, n_rows: int, stream: Stream) -> None:
        """A level, whose ``kind`` says how large its coefficients are on the whole."""
        if level > 1:
            self.before = [self.here[3:], self.before[0]]
        self.kind, self.stream = kind, stream
        self.here = new_rows(n_rows, self.n_kept)
        self.indices = np.zeros((n_rows, self.n_kept), np.int64)
        self.exponents = np.zeros(n_rows, np.int64)
        self.means = np.zeros((n_rows, self.n_kept))
        _model().begin_level(self.model, kind)

    def encode(self, rate_weight: float, first: int, wanted: Floats) -> Floats:
        """Rows of coefficients, in steps, as a decoder will have them."""
        targets = np.zeros(self.indices.shape)
        targets[first : first + len(wanted)] = wanted
        if not (np.abs(wanted) < MOST_WANTED).all():  # NaN too
            raise MotionError(f"{NAME}: a coefficient exceeds 2^29 quantizer steps")
        self._run(first, first + len(wanted), targets, rate_weight)
        return self._decoded(first, first + len(wanted))

    def decode(self) -> Floats:
        """All rows of the level, (n_rows, n_kept), in steps."""
        self._run(0, len(self.indices), np.zeros((1, self.n_kept)), -1.0)
        return self._decoded(0, len(self.indices))

    def _run(self, first: int, stop: int, targets: Floats, rate_weight: float) -> None:
        if not self.n_kept:
            return  # PWAVE-20
        fault = _model().code_rows(
            self.model,
            self.stream.data,
            self.indices,
            targets,
            self.means,
            self.here,
            *self.before,
            self.kind,
            first,
            stop,
            rate_weight,
            self.exponents,
            1 if self.refining else 0,
        )
        if fault >= 0:
            raise FormatError(
                f"{self.where}: row {fault} of level of kind {self.kind} is out of range"
            )

    def _decoded(self, first: int, stop: int) -> Floats:
        return self.indices[first:stop].astype(np.float64)
