"""The two streams of one joint in one segment: its marks, and the curves between them.

SPEC.md, "Codec 17: qbc", is normative; names are its field names.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.coding.streams import (
    bare_state,
    decode_stream,
    encode_stream,
    halves_of,
    scale_of,
    start_states,
)
from mcz.codecs.curves import kernels
from mcz.errors import FormatError
from mcz.model.types import Ints

MARKS, DETAILS = 0, 1  # the sets of the start table
MAX_SCALE = 63


@dataclass(frozen=True, slots=True)
class Curves:
    """Curves one after the other: frames of each, the point at its end, its middle point."""

    lengths: Ints  # (curves,)
    ends: Ints  # (curves, channels)
    mids: Ints  # (curves, channels)


def _halves(errors: Ints) -> int:
    """The byte of a scale of about the mean absolute error."""
    return halves_of(float(np.abs(errors).mean()) if errors.size else 0.0, MAX_SCALE)


def build_marks(points: Ints) -> bytes:
    """The stream of marks (k, channels)."""
    if not points.any():
        return b""
    halves = _halves(np.diff(points, axis=0))
    body = encode_stream(
        start_states("qbc")[MARKS],
        4 * points.size + 256,
        lambda state, data: (
            kernels.code_marks(state, data, points.copy(), len(points), scale_of(halves)) < 0
        ),
        "qbc: a mark",
    )
    return bytes((halves,)) + body


def parse_marks(stream: bytes, count: int, n_channels: int) -> Ints:
    """All ``count`` marks; raises FormatError on bad bytes."""
    points = np.zeros((count, n_channels), np.int64)
    if not stream:
        return points
    halves = _scale(stream, 0)
    decode_stream(
        stream[1:],
        start_states("qbc")[MARKS],
        lambda state, data: kernels.code_marks(state, data, points, count, scale_of(halves)) < 0,
        "qbc: a mark",
        whole=True,  # QBC-15
    )
    return points


def parse_first_mark(stream: bytes, n_channels: int) -> Ints:
    """The first of some marks, (1, channels), which is coded without context."""
    points = np.zeros((1, n_channels), np.int64)
    if stream:
        _scale(stream, 0)
        decode_stream(
            stream[1:],
            bare_state(),
            lambda state, data: kernels.code_marks(state, data, points, 1, 1) < 0,
            "qbc: a mark",
            whole=False,
        )
    return points


def straight_curves(marks: Ints, frames: Ints) -> Curves:
    """One straight curve from each mark to the next."""
    return Curves(np.diff(frames), marks[1:], (marks[:-1] + marks[1:]) >> 1)  # QBC-25


def build_curves(marks: Ints, frames: Ints, curves: Curves) -> bytes:
    """The stream of the curves between marks (k, channels) at ``frames`` (k,)."""
    plain = straight_curves(marks, frames)
    if len(plain.lengths) == len(curves.lengths) and (plain.mids == curves.mids).all():
        return b""
    starts = np.concatenate([marks[:1], curves.ends[:-1]])
    inner = ~np.isin(np.cumsum(curves.lengths) + frames[0], frames)
    steps = (curves.ends - starts)[inner]
    bends = (curves.mids - ((starts + curves.ends) >> 1))[curves.lengths > 1]
    halves = np.array([_halves(steps // 2), _halves(bends)])
    scales = np.array([scale_of(int(h)) for h in halves])
    body = encode_stream(
        start_states("qbc")[DETAILS],
        8 * curves.ends.size + 4 * len(curves.lengths) + 256,
        lambda state, data: (
            kernels.code_details(
                state,
                data,
                marks,
                frames,
                curves.lengths.copy(),
                curves.ends.copy(),
                curves.mids.copy(),
                scales,
            )
            == len(curves.lengths)
        ),
        "qbc: a curve",
    )
    return bytes(halves.astype(np.uint8)) + body


def parse_curves(stream: bytes, marks: Ints, frames: Ints, *, whole: bool) -> Curves:
    """The curves between marks; raises FormatError on bad bytes."""
    if not stream:
        return straight_curves(marks, frames)
    scales = np.array([scale_of(_scale(stream, at)) for at in range(2)])
    most = int(frames[-1] - frames[0])
    lengths = np.zeros(most, np.int64)
    ends = np.zeros((most, marks.shape[1]), np.int64)
    mids = np.zeros_like(ends)
    n_curves = [0]

    def loop(state: Ints, data: NDArray[np.uint8]) -> bool:
        n_curves[0] = kernels.code_details(state, data, marks, frames, lengths, ends, mids, scales)
        return n_curves[0] >= 0

    # QBC-15
    decode_stream(stream[2:], start_states("qbc")[DETAILS], loop, "qbc: a curve", whole=whole)
    n = n_curves[0]
    return Curves(lengths[:n], ends[:n], mids[:n])


def _scale(stream: bytes, at: int) -> int:
    if at >= len(stream) or stream[at] > MAX_SCALE:  # QBC-16, QBC-22
        raise FormatError(f"qbc: a scale is missing at {at} of a stream of {len(stream)} bytes")
    return stream[at]
