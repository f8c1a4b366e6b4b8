"""Clips of ``pca``, to order: integers, heads and headers that no encoder chooses.

Everything coded is integers that are written out or counted, so the bytes do not depend on a
machine's arithmetic; values are those of the decoder.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import raw
from mcz.codecs.coding import mixing
from mcz.codecs.coding.residuals import code_table
from mcz.codecs.coding.streams import scale_of, start_states
from mcz.codecs.contract import Codec, Encoded, Layout, Request, Segment, Span
from mcz.codecs.pca import pca, streams
from mcz.model.schema import varint

UNEXAMINED = 2**16  # bytes, more than any crafted stream has
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Part:
    """One segment: means (channels), basis (components x channels), coefficients (frames x
    components), and the head; ``said``: the components that the head claims.
    """

    means: Sequence[int]
    basis: Sequence[Sequence[int]] = ()
    coefficients: Sequence[Sequence[int]] = ()
    step: int = 128
    mean_scale: int = 12
    shifts: Sequence[int] = ()
    forms: Sequence[int] = ()
    said: bytes | None = None
    faulty: bool = False  # an integer has no code
    n_frames: int = 0  # where there are no components


@dataclass(frozen=True, slots=True)
class Plan:
    """Header and segments of a signal; an empty stream where a part is None."""

    parts: tuple[Part, ...]
    decimals: int = 2
    empty: tuple[int, ...] = ()


def stream_of(part: Part, decimals: int) -> bytes:
    """The stream of one segment."""
    count = len(part.basis)
    means = np.array(part.means, np.int64)
    basis = np.array(part.basis, np.int64).reshape(count, len(means))
    rows = np.array(part.coefficients, np.int64).reshape(part.n_frames, count)
    head = bytes((part.step,)) if decimals == pca.SCALED else b""
    head += bytes((part.mean_scale,)) + (varint(count) if part.said is None else part.said)
    head += bytes((*part.shifts, *part.forms))
    data, state = np.zeros(UNEXAMINED, np.uint8), start_states("pca")[0].copy()
    mixing.start(state, data, 1)
    # What has no code is the last of its table, so that the next one follows all the same.
    forms = np.array(part.forms, np.int64)
    shifts = np.array(part.shifts, np.int64)
    scales = np.array([scale_of(form & 63) for form in part.forms], np.int64)
    firsts = (np.int64(1) << shifts) >> (len(means).bit_length() // 2)
    faults = (
        code_table(state, data, means[None], np.array([scale_of(part.mean_scale)]), 0),
        code_table(state, data, basis, firsts, 1),
        streams.code_coefficients(state, data, rows, forms >> 6, scales) >= 0,
    )
    assert any(faults) == part.faulty
    return head + data[: mixing.finish(state, data)].tobytes()


def segments_of(plan: Plan) -> list[Segment]:
    found, first = [], 0
    for index, part in enumerate(plan.parts):
        data = b"" if index in plan.empty else stream_of(part, plan.decimals)
        found.append(Segment(first, part.n_frames, (data,)))
        first += part.n_frames
    return found


def codec_of(plan: Plan) -> Codec:
    """Codec pca with this content, whatever the values of the motion."""

    def encode(source: Any, params: Any) -> Encoded:
        return Encoded(bytes((plan.decimals,)), iter(segments_of(plan)))

    return replace(pca.CODEC, encode=encode, parameters=raw.CODEC.parameters, dial=None)


def values_of(plan: Plan) -> NDArray[np.float64]:
    """The values of all frames."""
    made = segments_of(plan)
    n_frames, n_channels = sum(s.n_frames for s in made), len(plan.parts[0].means)
    spans = [Span(s.first, s.n_frames) for s in made]
    values: NDArray[np.float64] = pca.CODEC.decode(
        bytes((plan.decimals,)),
        Layout(n_frames, (tuple(range(n_channels)),)),
        spans,
        Request(0, n_frames, (0,)),
        lambda segment, _, __: made[segment].streams[0],
    )
    return values
