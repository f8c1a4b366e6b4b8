"""Units from frames and frames from units, with the state between frames.

SPEC.md, "Codec 21: online", is normative; the names below are its field names.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from construct import Int8ul
from numpy.typing import NDArray

from mcz.codecs.coding import mixing
from mcz.codecs.coding.streams import start_states
from mcz.codecs.contract import Layout
from mcz.codecs.online import kernels
from mcz.codecs.online.units import GOLOMB, INTRA, LTR, MIXED, STR, Unit
from mcz.codecs.space import (
    APART,
    COURSES,
    MEAN,
    N_COORDINATES,
    Space,
    SpaceFields,
    Transform,
    space_of,
)
from mcz.errors import FormatError, LostFrameError, MotionError
from mcz.model.schema import Record, field, one_of, parse
from mcz.model.types import Floats, Ints

NAME = "online"
N_KINDS = 2  # start tables of a coder: for intra coded LTRs, and others
AS_IS, REORDERED = 0, 1  # orders
COEFFICIENT_BYTES = 40  # more than the greatest size of one


class OnlineHeader(Record):
    """Header of online."""

    space: SpaceFields = field(SpaceFields, "how a frame becomes coefficients")
    order: int = field(
        one_of(Int8ul, (AS_IS, REORDERED)),
        "points of a matrix: 0 as in Space; 1 x of all, then y, then z",
    )
    coder: int = field(
        one_of(Int8ul, (MIXED, GOLOMB)), "how coefficients become bits: 0 mixed, 1 Golomb"
    )


def parse_online_header(header: bytes) -> OnlineHeader:
    """The fields of OnlineHeader; raises FormatError."""
    fields = parse(OnlineHeader, header, f"{NAME} header")
    if fields.space.flags & (MEAN | COURSES):  # ONLINE-04
        raise FormatError(
            f"{NAME}: flags {fields.space.flags:#x} announce a mean or courses, which it does "
            "not have"
        )
    if fields.order == REORDERED and fields.space.flags & APART:  # ONLINE-05
        raise FormatError(f"{NAME}: x, y and z cannot be both apart and reordered")
    return fields


def _space(fields: OnlineHeader, layout: Layout) -> Space:
    space = space_of(NAME, fields.space, layout)
    if fields.order == AS_IS:  # ONLINE-07
        return space
    if layout.n_channels % N_COORDINATES:  # ONLINE-06
        raise FormatError(
            f"{NAME}: {layout.n_channels} channels are not a multiple of three coordinates"
        )
    columns = space.columns.reshape(-1, N_COORDINATES).T.reshape(1, -1)  # ONLINE-07
    return replace(space, columns=np.ascontiguousarray(columns))  # ONLINE-07


class Coder:
    """Encoder or decoder of one signal; raises FormatError for a bad header."""

    def __init__(self, header: bytes, layout: Layout) -> None:
        fields = parse_online_header(header)
        self.header, self.coder = header, int(fields.coder)
        self.space = _space(fields, layout)
        self.at = 0  # number of the frame that is due
        self._ltr: int | None = None  # number of the last LTR, None if unknown
        self._whole = False  # the previous frame is known
        self._state = start_states("online")[N_KINDS * self.coder].copy()
        self._values = np.zeros(len(self.space.weights))
        self._reference = np.zeros(len(self.space.weights))
        self._memory = np.zeros(kernels.N_MEMORY, np.int64)
        self._lengths = np.zeros(len(self.space.starts) - 1, np.int64)
        self._tracks = np.zeros((self.space.n_rows, kernels.TRACK_SIZE), np.int64)
        self._analysis = np.zeros((0, 0))

    def skip(self, n_frames: int) -> None:
        """Skip ``n_frames`` lost frames."""
        self.at += n_frames
        self._whole = self._whole and not n_frames

    def distance(self) -> int:
        """Frames since the last LTR frame, for the next frame."""
        assert self._ltr is not None
        return self.at - self._ltr

    def decode(self, unit: Unit) -> Floats:
        """The frames of a unit, (frames, n_channels).

        Raises LostFrameError if a frame that it needs is unknown, FormatError on bad bytes; in both
        cases its frames are unknown then.
        """
        out = np.empty((unit.n_frames, len(self._values)))
        before = self._reference.copy(), self._memory.copy()
        try:
            self._check(unit)
            self._begin(unit.kind)
            data = np.frombuffer(unit.data, np.uint8).copy()
            mixing.start(self._state, data, 0)
            fault = kernels.decode_frames(*self._kernel_arguments(data, unit.kind, out))
            if fault >= 0:
                raise FormatError(f"{NAME}: frame {self.at + fault} is out of range")
            if mixing.coded_size(self._state) != len(data):  # ONLINE-23
                raise FormatError(
                    f"{NAME}: the unit at frame {self.at} should not have {len(data)} bytes"
                )
        except FormatError:
            self._reference[:], self._memory[:] = before
            self.skip(unit.n_frames)
            raise
        self._advance(unit.kind, unit.n_frames)
        return out

    def _check(self, unit: Unit) -> None:
        if unit.kind == STR and not self._whole:  # ONLINE-26
            raise LostFrameError(f"{NAME}: frame {self.at} needs the previous frame, which is lost")
        # ONLINE-14, ONLINE-27
        if unit.kind == LTR and (self._ltr is None or self.distance() != unit.distance):
            raise LostFrameError(
                f"{NAME}: frame {self.at} needs the LTR frame {unit.distance} frames before, "
                "which is lost or no LTR"
            )

    def encode(self, kind: int, frames: Floats, n_group: int, threshold: float, plan: Any) -> Unit:
        """Encode frames (frames, n_channels) as a unit of a group of ``n_group``; MotionError.

        A refused frame does not affect the next.
        """
        if not self._analysis.size:
            self._analysis = np.ascontiguousarray(np.concatenate(self.space.analysis()))
        self._begin(kind)
        data = np.empty(len(frames) * (COEFFICIENT_BYTES * self.space.n_rows + 64), np.uint8)
        mixing.start(self._state, data, 1)
        before = plan.numbers.copy()
        choice = kernels.Choice(
            self._analysis, threshold, n_group, plan.numbers, plan.laplace, plan.gauss
        )
        fault = kernels.encode_frames(*self._kernel_arguments(data, kind, frames), choice)
        if fault >= 0:
            plan.numbers[:] = before
            raise MotionError(
                f"{NAME}: a coefficient of frame {self.at + fault} exceeds 2^40 quantizer steps"
            )
        coded = data[: mixing.finish(self._state, data)].tobytes()
        if len(frames) == n_group:
            plan.round_up(len(coded))
        unit = Unit(kind, len(frames), coded, self.distance() if kind == LTR else 0)
        self._advance(kind, len(frames))
        return unit

    def _begin(self, kind: int) -> None:
        if kind != STR:  # ONLINE-15
            table = start_states("online")[N_KINDS * self.coder + (kind == LTR)]  # ONLINE-15
            self._state = table.copy()

    def _advance(self, kind: int, n_frames: int) -> None:
        if kind != STR:
            self._ltr = self.at
        self.at += n_frames
        self._whole = True

    def _kernel_arguments(
        self, data: NDArray[np.uint8], kind: int, frames: Floats
    ) -> tuple[Ints, NDArray[np.uint8], int, int, Floats, kernels.Past, Transform]:
        past = kernels.Past(
            self._values, self._reference, self._memory, self._lengths, self._tracks
        )
        return self._state, data, self.coder, kind, frames, past, self.space.transform()


__all__ = ["GOLOMB", "INTRA", "LTR", "MIXED", "NAME", "STR", "Coder", "OnlineHeader"]
