"""Spatial transform of a frame and its inverse, shared by the codecs of Hou's family.

SPEC.md, "Space" and "Rows of a frame", is normative and has the steps below in the same order;
names of fields are its own. Coefficients are coded and made into values by compiled functions, one
for encoder and decoder.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from construct import Float64l, If, Int8ul, this

from mcz.codecs.basis_models import MAX_POINTS, Basis, Head, find_bases
from mcz.codecs.coding import residuals
from mcz.codecs.coding.residuals import FAULT, bits, code_residual, side_of
from mcz.codecs.contract import ID_SIZE, Layout, Span
from mcz.codecs.parameters import ratio_of
from mcz.codecs.transforms.bases import dct_matrix
from mcz.errors import FormatError
from mcz.kernels.types import Bytes, Floats, Floats2, Ints, Ints2
from mcz.model.schema import Checked, Exactly, Record, bounded, counted, field, one_of

MAX_INDEX = 1 << 40
LENGTHS = 0, 0  # residuals of a stream
FIRSTS = residuals.N_CONTEXTS, residuals.N_MIXERS
OTHERS = 2 * residuals.N_CONTEXTS, 2 * residuals.N_MIXERS
N_SETS = 3


class Transform(NamedTuple):
    """Transform from coefficients to values (SPEC.md, "Space"): a row each, matrix by matrix.

    ``vectors`` (n_rows, n_points), ``starts`` the first row of each matrix and the end, ``columns``
    (n_matrices, n_points) the channel of each point, ``weights`` (n_channels,).
    """

    vectors: Floats2
    starts: Ints
    columns: Ints2
    step: float
    weights: Floats


LAST, BEFORE, FAST, SLOW, TRACK_SIZE = range(5)  # remembered of a coefficient


def code_frame(
    state: Ints, data: Bytes, indices: Ints, starts: Ints, lengths: Ints, tracks: Ints2, first: int
) -> int:
    """Code ``indices`` (n_rows,) in place; 1 if that is impossible.

    ``lengths`` (n_matrices,) and ``tracks`` (n_rows, TRACK_SIZE) remember the frames before.
    """
    for m in range(len(starts) - 1):
        start, stop = starts[m], starts[m + 1]
        length = stop - start
        while length > 0 and indices[start + length - 1] == 0:
            length -= 1
        scales = 16 * lengths[m], 16 * lengths[max(m - 1, 0)]  # FRAME-08
        length = code_residual(state, data, length, scales, 0, (0, 0, 0), LENGTHS)
        if length < 0 or length > stop - start:  # FAULT is far below 0 (FRAME-09)
            return 1
        lengths[m] = length
        above = higher = 0
        for r in range(start, start + length):
            beside = starts[m - 1] + r - start if m > 0 else -1
            side = indices[beside] if 0 <= beside < start else 0  # FRAME-08
            track = tracks[r]
            if first:
                scales, near = (16 * abs(above), 16 * abs(side)), 0
                sides, base = (side_of(above), side_of(side), 0), FIRSTS
            else:
                fast = (3 * track[FAST] + 16 * abs(side)) >> 2
                slow = (track[SLOW] + 8 * abs(above) + 4 * abs(higher)) >> 1  # FRAME-08
                scales, near = (fast, slow), min(bits(start + length - r), 7)
                sides, base = (side_of(track[LAST]), side_of(side), side_of(track[BEFORE])), OTHERS
            fault = code_residual(state, data, indices[r], scales, near, sides, base)
            if fault == FAULT or abs(fault) > MAX_INDEX:  # SPACE-12
                return 1
            indices[r] = fault
            higher, above = above, fault
    if first == 0:  # FRAME-08
        update_tracks(indices, tracks)
    return 0


def update_tracks(indices: Ints, tracks: Ints2) -> None:
    for r in range(len(indices)):
        track, size = tracks[r], 16 * abs(indices[r])
        track[BEFORE] = track[LAST]
        track[LAST] = indices[r]
        track[FAST] += (size - track[FAST]) >> 1
        track[SLOW] += (size - track[SLOW]) >> 4  # FRAME-08


def add_frame(
    values: Floats, indices: Ints, transform: Transform, step: float, sums: Floats
) -> None:
    """Add the synthesis of the coefficients to ``values`` (n_channels,).

    ``step`` is that of the frame; ``sums`` (n_points,) is worked in.
    """
    vectors, starts, columns, _, weights = transform
    for m in range(len(starts) - 1):
        sums[:] = 0.0
        for r in range(starts[m], starts[m + 1]):  # FRAME-11
            if indices[r] != 0:
                index = float(indices[r])
                for j in range(len(sums)):
                    sums[j] = sums[j] + index * vectors[r, j]
        for j in range(len(sums)):
            c = columns[m, j]
            values[c] = values[c] + (sums[j] * step) * weights[c]  # FRAME-11, ONLINE-24


def coefficient_of(points: Floats, row: Floats) -> float:
    """Coefficient of points for one row of the analysis."""
    total = 0.0
    for j in range(len(points)):
        total += points[j] * row[j]
    return total


def index_of(coefficient: float, threshold: float) -> int:
    """A coefficient in steps as an integer; MAX_INDEX + 1 if it is too large."""
    size = abs(coefficient)
    if not size <= MAX_INDEX:  # NaN too
        return MAX_INDEX + 1
    if size < threshold:
        return 0
    index = int(np.floor(size + 0.5))
    return -index if coefficient < 0 else index


APART, WEIGHTED, MEAN, COURSES = 1, 2, 4, 8  # flags
COSINES, LEARNED = 0, 1  # basis
LEAST_STEP, GREATEST_STEP = 2.0**-100, 2.0**100
N_COORDINATES = 3

Step = bounded(Float64l, LEAST_STEP, GREATEST_STEP)  # SPACE-09


class SpaceFields(Record):
    """Transform of a frame into coefficients, in headers."""

    flags: int = field(
        Checked(Int8ul, lambda value: value < 16),
        "bit 0: x, y and z apart; 1: has weights; 2: the model has a mean; 3: it has courses",
    )
    basis: int = field(one_of(Int8ul, (COSINES, LEARNED)), "0 cosines, 1 the bases of a model")
    model: bytes | None = field(
        If((this.basis == LEARNED) | (this.flags & (MEAN | COURSES)), Exactly(ID_SIZE)),
        "id of the MODL, of kind 1",
    )
    step: float = field(Step, "quantizer step, 2^-100 to 2^100")
    weights: list[int] | None = field(
        If(this.flags & WEIGHTED, counted(Int8ul, 2**14)),
        "code of the weight of each channel; only if bit 1 of flags is set",
    )


@dataclass(frozen=True, slots=True)
class Space:
    """Matrices of a frame, and the weights of its channels.

    ``vectors`` (n_rows, n_points) has the rows of all matrices, one below the other, ``starts`` the
    first of each and the end; ``columns`` (n_matrices, n_points) the channel of each point;
    ``weights`` and ``mean`` (n_channels,). ``courses`` (n_courses, frames of a window) replace the
    cosines in time, None without any.
    """

    step: float
    vectors: Floats
    starts: Ints
    columns: Ints
    weights: Floats
    mean: Floats
    courses: Floats | None = None

    @property
    def n_rows(self) -> int:
        return len(self.vectors)

    def transform(self) -> Transform:
        """The transform for the kernels."""
        return Transform(self.vectors, self.starts, self.columns, self.step, self.weights)

    def analysis(self) -> list[Floats]:
        """Matrices from points to coefficients, (n_rows, n_points) each.

        The inverse of a decoder's transform, whose vectors are rounded.
        """
        parts = (self.vectors[a:b] for a, b in zip(self.starts, self.starts[1:], strict=False))
        return [np.asarray(np.linalg.pinv(part.T), np.float64) for part in parts]


def columns_of(n_channels: int, *, apart: bool) -> Ints:
    """The channel of each point of each matrix, (n_matrices, n_points)."""
    channels = np.arange(n_channels, dtype=np.int64)
    if apart:
        return np.ascontiguousarray(channels.reshape(-1, N_COORDINATES).T)  # SPACE-01
    return channels[None]


def space_of(name: str, fields: SpaceFields, layout: Layout) -> Space:
    """Build the Space of the fields of SPACE; raises FormatError or UnsupportedError."""
    apart, n_channels = bool(fields.flags & APART), layout.n_channels
    if apart and n_channels % N_COORDINATES:  # SPACE-02
        raise FormatError(f"{name}: {n_channels} channels are not a multiple of three coordinates")
    columns = columns_of(n_channels, apart=apart)
    n_matrices, n_points = columns.shape
    if n_points > MAX_POINTS:  # SPACE-03
        raise FormatError(f"{name}: {n_points} points in a matrix exceed the limit of {MAX_POINTS}")
    n_spatial = n_matrices if fields.basis == LEARNED else 0
    rest: list[Basis] = []
    if fields.model is not None:
        check = partial(_check_heads, name, fields.flags, [n_points] * n_spatial, n_channels)
        rest = list(find_bases(name, layout, bytes(fields.model), check))
    spatial, rest = rest[:n_spatial], rest[n_spatial:]  # SPACE-05
    courses = rest.pop(0).vectors if fields.flags & COURSES else None  # SPACE-06
    mean = rest.pop(0).vectors[0] if fields.flags & MEAN else np.zeros(n_channels)
    # SPACE-04
    vectors = [basis.vectors for basis in spatial] or [dct_matrix(n_points)] * n_matrices
    return Space(
        float(fields.step),
        np.ascontiguousarray(np.concatenate(vectors)),
        np.cumsum([0, *map(len, vectors)]).astype(np.int64),
        columns,
        _weights(name, fields, n_channels),  # SPACE-10
        mean,  # WIND-15
        courses,
    )


def uses_of(fields: SpaceFields) -> tuple[bytes, ...]:
    """The ids of the models that the fields of SPACE name."""
    return () if fields.model is None else (bytes(fields.model),)


def _check_heads(
    name: str, flags: int, n_points: Sequence[int], n_channels: int, heads: Sequence[Head]
) -> None:
    """Refuse a model unless it has a basis of each of ``n_points``, then courses and a mean."""
    n_due = len(n_points) + sum(bool(flags & flag) for flag in (COURSES, MEAN))
    if len(heads) != n_due:  # BASES-02, SPACE-06
        raise FormatError(f"{name}: the model has {len(heads)} bases; expected {n_due}")
    for head, expected in zip(heads, n_points, strict=False):
        if head.n_points != expected:  # SPACE-07
            raise FormatError(f"{name}: vectors of {head.n_points} entries for {expected} points")
    # SPACE-06, SPACE-07
    if flags & MEAN and (len(heads[-1].shifts), heads[-1].n_points) != (1, n_channels):
        shape = len(heads[-1].shifts), heads[-1].n_points
        raise FormatError(f"{name}: a mean of {shape} does not fit {n_channels} channels")


def _weights(name: str, fields: SpaceFields, n_channels: int) -> Floats:
    if fields.weights is None:
        return np.ones(n_channels)
    if len(fields.weights) != n_channels:  # SPACE-11
        raise FormatError(f"{name}: {len(fields.weights)} weights for {n_channels} channels")
    return np.array([ratio_of(code) for code in fields.weights])  # SPACE-10


def check(name: str, layout: Layout, spans: Sequence[Span], *, fresh: bool) -> None:
    """Raise FormatError for a layout or segments that no codec of this family has.

    ``fresh``: all segments start so.
    """
    # FRAME-02, FRAME-03, ONLINE-02, ONLINE-03, WIND-02
    if layout.samples_per_frame != 1 or layout.n_resolutions != 1:
        raise FormatError(
            f"{name}: {layout.samples_per_frame} samples a frame and {layout.n_resolutions} "
            "resolutions are not allowed"
        )
    if len(layout.groups) > 1:  # FRAME-01, ONLINE-01, WIND-01
        raise FormatError(f"{name}: the codec has one group, not {len(layout.groups)}")
    for span in spans:
        # FRAME-03, ONLINE-03, WIND-03, WIND-04
        if span.lead or span.tail or (fresh and not span.fresh):
            raise FormatError(f"{name}: the segment at {span.first} must be independent of others")
