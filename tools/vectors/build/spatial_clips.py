"""Clips of lsdt-frame and lsdt-clip to order: models, headers, coefficients no encoder chooses.

Everything coded is integers that are written out or counted, so the bytes do not depend on a
machine's arithmetic; values are those of the decoder.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import codec_by_name, raw
from mcz.codecs.basis_models import Basis, build_model, known_models
from mcz.codecs.coding.prefix_codes import codes_from, fields_of
from mcz.codecs.contract import (
    Codec,
    Encoded,
    Layout,
    Model,
    Request,
    Segment,
    Span,
    model_finder,
    model_id,
)
from mcz.codecs.space import APART, COURSES, LEARNED, MEAN, WEIGHTED
from mcz.codecs.spatial import lsdt_frame, windows
from mcz.codecs.spatial.windows import WindowsHeader
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.schema import parse, varint
from tools.vectors.build.files import file_of

UNEXAMINED = 2**16  # bytes, more than any crafted stream has
Ints = NDArray[np.int64]
Lengths = tuple[Sequence[int], Sequence[int]]  # of the codes of gaps and values
FRAME, CLIP, MDTT, PCA_RDO = "lsdt-frame", "lsdt-clip", "mdtt", "pca-rdo"


def waves(number: int, n_rows: int, n: int) -> Ints:
    """Coefficients of all sizes, smaller from left to right, some zeros, no two tables alike."""
    i, k = np.ogrid[3 * number : 3 * number + n_rows, :n]
    sizes = (37 * i + 11 * k * k + 7 * i * k) % 129 - 64
    table = np.sign(sizes) * (np.abs(sizes) >> np.minimum(k // 2, 6))
    table[np.broadcast_to((i + k) % 5 == 3, table.shape) | (k >= n - i % 3)] = 0
    return table.astype(np.int64)


def still(number: int, n_rows: int, n: int) -> Ints:
    """Zeros."""
    return np.zeros((n_rows, n), np.int64)


def basis_of(n_points: int, n_vectors: int, seed: int = 0, **changes: Any) -> Basis:
    """A basis of integers of all sizes; ``shifts`` and ``entries`` may be given."""
    i, j = np.ogrid[:n_vectors, :n_points]
    fields = {
        "entries": (37 * (i + seed) + 11 * j * j + 5 * i * j) % 129 - 64,
        "shifts": [6 + (k + seed) % 2 for k in range(n_vectors)],
    } | changes
    entries = np.array(fields["entries"], np.int64).reshape(n_vectors, n_points)
    return Basis(np.array(fields["shifts"], np.int64), entries)


@dataclass(frozen=True, slots=True)
class Plan:
    """Header and coefficients of a signal.

    ``segments`` are the frames of each, ``fresh`` which of them start so (empty: all). ``fill``
    gives the coefficients of a window, (rows, frequencies), or of a segment of lsdt-frame,
    (frames, rows), by its number. ``bases`` are those of the matrices, none: cosines; ``known`` is
    the name of a well-known model in their place, ``embedded`` in the file, too. ``lengths`` of
    the codes of ``prefix`` are the best where they are None.
    """

    codec: str = CLIP
    n_channels: int = 3
    segments: tuple[int, ...] = (20,)
    fresh: tuple[bool, ...] = ()
    window: int = 8
    frequencies: int | None = None  # None: as many as frames
    apart: bool = False
    weights: bytes | None = None
    bases: tuple[Basis, ...] = ()
    courses: Basis | None = None
    mean: Basis | None = None
    known: str = ""
    embedded: bool = False
    step: float = 1.0
    prefix: bool = False
    lengths: Lengths | None = None
    fill: Callable[[int, int, int], Ints] = waves

    @property
    def n_frames(self) -> int:
        return sum(self.segments)

    @property
    def own_bases(self) -> tuple[Basis, ...]:
        """All bases of the model."""
        return (*self.bases, *(b for b in (self.courses, self.mean) if b is not None))

    @property
    def model(self) -> Model | None:
        if self.known:
            return known_models()[self.known]
        return build_model(self.own_bases) if self.own_bases else None

    @property
    def starts(self) -> Ints:
        """The first row of each matrix, and the end."""
        n_matrices = 3 if self.apart else 1
        counts = [self.n_channels // n_matrices] * n_matrices
        if self.bases:
            counts = [len(basis.entries) for basis in self.bases]
        return np.cumsum([0, *counts]).astype(np.int64)

    @property
    def firsts(self) -> list[int]:
        return np.cumsum([0, *self.segments]).tolist()[:-1]

    @property
    def layout(self) -> Layout:
        groups = (tuple(range(self.n_channels)),) if self.n_channels else ()
        models = (self.model,) if self.model else ()
        return Layout(self.n_frames, groups, find_model=model_finder(models))

    def windows(self) -> Iterator[tuple[int, list[int]]]:
        """First window's number and the frames of the windows, for each segment."""
        number = 0
        for n_frames in self.segments:
            sizes = [min(self.window, n_frames - at) for at in range(0, n_frames, self.window)]
            yield number, sizes
            number += len(sizes)


def tables(plan: Plan) -> list[list[Ints]]:
    """The coefficients of each segment: of its windows, or the one table of its frames."""
    n_rows = int(plan.starts[-1])
    if plan.codec == FRAME:
        return [[plan.fill(i, n, n_rows)] for i, n in enumerate(plan.segments)]
    most = plan.window if plan.frequencies is None else plan.frequencies
    return [
        [plan.fill(first + i, n_rows, min(most, n)) for i, n in enumerate(sizes)]
        for first, sizes in plan.windows()
    ]


def header(plan: Plan, **parts: bytes) -> bytes:
    """The header, field by field; ``parts`` are said in place of what the plan says."""
    model = plan.model
    flags = APART * plan.apart + WEIGHTED * (plan.weights is not None)
    flags += MEAN * (plan.mean is not None) + COURSES * (plan.courses is not None)
    weights = b"" if plan.weights is None else varint(len(plan.weights)) + plan.weights
    fields = {
        "window": varint(plan.window),
        "n_frequencies": varint(plan.frequencies or plan.window),
        "flags": bytes((flags,)),
        "basis": bytes((LEARNED if plan.bases or plan.known else 0,)),
        "model": model_id(model) if model else b"",
        "step": struct.pack("<d", plan.step),
        "weights": weights,
        "coder": bytes((plan.prefix,)),
        "gap_lengths": b"",
        "value_lengths": b"",
    }
    if plan.prefix:
        names = "gap_lengths", "value_lengths"
        for name, lengths in zip(names, lengths_of(plan), strict=True):
            fields[name] = varint(len(lengths)) + bytes(lengths)
    if plan.codec == FRAME:
        del fields["window"], fields["n_frequencies"]
    return b"".join((fields | parts).values())


def lengths_of(plan: Plan) -> Lengths:
    """The lengths of the codes: those given, else the best."""
    if plan.lengths is not None:
        return plan.lengths
    found = [table for segment in tables(plan) for table in segment]
    if plan.codec == FRAME:
        found = [part for t in found for part in np.split(t, plan.starts[1:-1], axis=1)]
    fields = fields_of(found)
    return fields.gap_lengths, fields.value_lengths


# Streams


def segments_of(plan: Plan) -> list[Segment]:
    fresh = plan.fresh or (True,) * len(plan.segments)
    rows = zip(plan.firsts, plan.segments, fresh, strict=True)
    if not plan.n_channels:
        return [Segment(first, n, (), fresh=begins) for first, n, begins in rows]
    streams = _frame_streams(plan, fresh) if plan.codec == FRAME else _window_streams_of(plan)
    return [
        Segment(first, n, (stream,), fresh=begins)
        for (first, n, begins), stream in zip(rows, streams, strict=True)
    ]


def _frame_streams(plan: Plan, fresh: Sequence[bool]) -> Iterator[bytes]:
    coder = lsdt_frame._Coder(header(plan), plan.layout)
    for (table,), begins in zip(tables(plan), fresh, strict=True):
        if begins:
            coder.restart()
        yield coder.build(table)


def _window_streams_of(plan: Plan) -> Iterator[bytes]:
    codes = codes_from(parse(WindowsHeader, header(plan), plan.codec).code, plan.codec)
    for segment in tables(plan):
        yield b"".join(windows.build_window(t, plan.starts, codes) for t in segment)


# Files


def codec_of(plan: Plan) -> Codec:
    """The codec with this content, whatever the values of the motion."""
    model = plan.model
    own = (model,) if model and (plan.embedded or not plan.known) else ()
    known = (model,) if model and plan.known else ()

    def encode(source: Any, params: Any) -> Encoded:
        return Encoded(header(plan), iter(segments_of(plan)), models=own, known_models=known)

    codec = codec_by_name(plan.codec)
    return replace(codec, encode=encode, parameters=raw.CODEC.parameters, dial=None, grouping="all")


def values_of(plan: Plan) -> NDArray[np.float64]:
    """The values of all frames."""
    made, layout = segments_of(plan), plan.layout
    values: NDArray[np.float64] = codec_by_name(plan.codec).decode(
        header(plan),
        layout,
        [Span(s.first, s.n_frames, fresh=s.fresh) for s in made],
        Request(0, plan.n_frames, tuple(range(len(layout.groups)))),
        lambda segment, _, __: made[segment].streams[0],
    )
    return values


def motion_of(plan: Plan, **changes: Any) -> Motion:
    """The clip as it is decoded: plain scalars of one joint, or as ``changes`` have it."""
    names = tuple(Channel("", f"n{c}") for c in range(plan.n_channels))
    skeleton = Skeleton((Joint("dial", channels=names),), name="dial")
    signal = Signal(values_of(plan), mask=changes.pop("mask", None))
    fields = {"skeleton": skeleton, "signals": (signal,), "name": "wave"}
    return Motion(**(fields | changes))


def file_with(plan: Plan, motion: Motion | None = None, **edits: Any) -> bytes:
    motion = motion_of(plan) if motion is None else motion
    return file_of(motion, codec=codec_of(plan), **{"grouping": "all", **edits})
