"""Codec 18, ``pca``: principal components of the frames, coefficients predicted in time.

SPEC.md, "Codec 18: pca", is normative; the names below are its field names.
Source: M. A. Khan, An efficient algorithm for compression of motion capture signal using
multidimensional quadratic Bezier curve break-and-fit method, 2014, section 4; the preset
``khan2014`` has the errors that its tables print, the defaults improve upon it:
mcz/codecs/pca/README.md describes the encoder.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). A stream holds all channels of one segment, with a basis of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from construct import Int8ul

from mcz.codecs.contract import Codec, Encoded, Fetch, Layout, Request, Segment, SignalSource, Span
from mcz.codecs.parameters import (
    MAX_DECIMALS,
    SCALED,
    Dial,
    Parameter,
    code_of,
    decimals_parameter,
    integer,
    preset_parameter,
    preset_values,
    ratio_of,
)
from mcz.codecs.pca.streams import (
    MAX_INDEX,
    MAX_SHIFT,
    Components,
    build_stream,
    evaluate,
    parse_stream,
)
from mcz.codecs.segments import (
    SEGMENT_FRAMES,
    SEGMENT_FRAMES_PARAMETER,
    Lengths,
    segment_frames_of,
    segments_by_halving,
)
from mcz.codecs.source_readers import SegmentReader
from mcz.errors import FormatError, MotionError
from mcz.model.schema import Checked, Record, build, field, parse
from mcz.model.types import Floats, Ints, Params, Reals, Settings, Values

LEAST_FRAMES = 256  # of a segment: in fewer the basis would cost more than it saves


class PcaHeader(Record):
    """Header of pca."""

    decimals: int = field(
        Checked(Int8ul, lambda value: value <= MAX_DECIMALS or value == SCALED),
        "decimals of means and coefficients, 0 to 15; 255: they are multiples of a step",
    )  # PCA-05


PRESETS: dict[str, Settings] = {
    "khan2014": {"q": 13, "Q": 2},
    "default": {"q": 20, "Q": None},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, or is too large.
    """
    published = params["preset"] == "khan2014"
    chosen = preset_values(PRESETS, params)
    frames = segment_frames_of(source.layout, params["segment_frames"], as_published=published)
    decimals = SCALED if chosen["Q"] is None else chosen["Q"]
    header = build(PcaHeader(decimals=decimals), "pca header")
    return Encoded(header, _segments(source, chosen["q"], chosen["Q"], frames, published))


def _segments(
    source: SignalSource, q: int, decimals: int | None, segment_frames: int, published: bool
) -> Iterator[Segment]:
    layout = source.layout
    frames = SegmentReader("pca", source)

    def code(first: int, stop: int) -> tuple[bytes, ...]:
        components = components_of(frames(first, stop), q, decimals, by_frame=published)
        return (build_stream(components, scaled=decimals is None),) * len(layout.groups)

    length = min(segment_frames or SEGMENT_FRAMES, layout.most_frames)
    if segment_frames >= layout.n_frames:
        length = layout.n_frames
    lengths = Lengths(length, bool(segment_frames), least=LEAST_FRAMES)
    for first, stop, streams in segments_by_halving(layout.n_frames, lengths, code):
        yield Segment(first, stop - first, streams)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Floats:
    """Return the values, (frames, channels of the groups); raise FormatError on bad bytes."""
    fields = parse(PcaHeader, header, "pca header")
    _check(layout, spans)
    n_columns = sum(len(layout.groups[group]) for group in request.groups)
    out = np.zeros((request.stop - request.start, n_columns))
    if not n_columns:
        return out
    for index, span in enumerate(spans):
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start < stop:
            block = _segment(fetch(index, 0, 0), fields.decimals, layout, span, stop - span.first)
            out[start - request.start : stop - request.start] = block[start - span.first :]
    return out


def _check(layout: Layout, spans: Sequence[Span]) -> None:
    if layout.samples_per_frame != 1 or layout.n_resolutions != 1:  # PCA-02
        raise FormatError(
            f"pca: {layout.samples_per_frame} samples a frame and {layout.n_resolutions} "
            "resolutions are not allowed"
        )
    if len(layout.groups) > 1:  # PCA-01
        raise FormatError(f"pca: the codec has one group, not {len(layout.groups)}")
    for span in spans:
        if (span.lead, span.tail, span.fresh) != (0, 0, True):  # PCA-03, PCA-04
            raise FormatError(f"pca: the segment at {span.first} must not have a lead or tail")


def _segment(stream: bytes, decimals: int, layout: Layout, span: Span, n_frames: int) -> Floats:
    """The first ``n_frames`` frames of a segment."""
    scaled = decimals == SCALED
    parts = parse_stream(stream, layout.n_channels, span.n_frames, n_frames, scaled=scaled)
    if scaled:
        step = ratio_of(parts.step)
        means, rows = parts.means * (step / MEAN_STEPS), parts.coefficients * step  # PCA-15
    else:
        means, rows = parts.means / 10.0**decimals, parts.coefficients / 10.0**decimals  # PCA-16
    basis = np.ldexp(parts.basis.astype(np.float64), -parts.shifts[:, None])
    out = np.zeros((n_frames, layout.n_channels))
    evaluate(out, _plain(means), _plain(basis), _plain(rows))
    return out


def _plain(values: Reals | Values) -> Floats:
    return np.ascontiguousarray(values, np.float64)


CODEC = Codec(
    id=18,
    name="pca",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    grouping="all",
    dial=Dial("q", 1, 2**20, rises=True, is_integer=True),
    parameters=(
        preset_parameter(PRESETS),
        Parameter("q", None, "components of a segment; default 20", integer("q", 1, 2**20)),
        decimals_parameter(
            "decimals of means and coefficients; default: a step that suits what is left out"
        ),
        SEGMENT_FRAMES_PARAMETER,
    ),
)


MEAN_STEPS = 4  # of means per step of coefficients, without Q
NOISE = 1.0  # of quantizing, as a share of the energy of omitted components
FINEST = 2.0**-16  # of the greatest component or mean: the least step
LARGEST = 2.0**80
NEGLIGIBLE = 1e-24  # of the greatest energy: less is rounding
WELL_CONDITIONED = 1e4


@dataclass(frozen=True, slots=True)
class Grid:
    """The steps of a segment; ``code`` is the step's if it is scaled."""

    step: float
    mean_step: float
    code: int


def grid_of(code: int) -> Grid:
    """Grid of a scale code that names no decimals."""
    step = ratio_of(code)
    return Grid(step, step / MEAN_STEPS, code)


def components_of(values: Floats, q: int, decimals: int | None, *, by_frame: bool) -> Components:
    """The q greatest components of one segment, (frames, channels), in integers.

    ``by_frame``: the mean over the channels of each frame is subtracted, and kept as another
    component, instead of the mean of each channel. Raises MotionError for values that are too
    large.
    """
    if np.abs(values).max(initial=0.0) > LARGEST:
        raise MotionError("pca: a value exceeds 2^40 quantizer steps")
    n_frames, n_channels = values.shape
    if not values.size:
        empty = np.zeros((0, n_channels), np.int64)
        return Components(0, np.zeros(n_channels, np.int64), np.zeros(0, np.int64), empty, empty.T)
    means = np.zeros(n_channels) if by_frame else values.mean(axis=0)
    rest = values - (values.mean(axis=1, keepdims=True) if by_frame else means)
    vectors, energies = principal_components(rest)
    # Without their mean the channels of a frame have a dimension less.
    q = min(q, len(energies), n_channels - 1 if by_frame else n_channels)
    grid = _decimal_grid(decimals) if decimals is not None else _grid(energies, q, means, n_frames)
    vectors = vectors[:q]
    sizes = np.sqrt(energies[:q] / n_frames)
    if decimals is not None:  # not the usual size of a coefficient but the greatest
        sizes = np.abs(rest @ vectors.T).max(axis=0, initial=0.0)
    fine = math.sqrt(n_channels) * np.maximum(sizes, 1e-300) / grid.step
    shifts = np.clip(np.ceil(np.log2(fine)), 0, MAX_SHIFT)
    basis = np.rint(np.ldexp(vectors, shifts.astype(np.int64)[:, None]))
    if by_frame:
        basis = np.concatenate([np.ones((1, n_channels)), basis])
        shifts = np.concatenate([[0.0], shifts])
    some = basis.any(axis=1)
    basis, powers = basis[some], shifts[some].astype(np.int64)
    mean_indices = _round_components(means, grid.mean_step, decimals)
    left = values - _values(mean_indices, grid.mean_step, decimals)
    real = np.ldexp(basis, -powers[:, None])
    indices = _round_components(_fit_components(real, left), grid.step, decimals)
    used = indices.any(axis=0)
    return Components(
        grid.code,
        mean_indices,
        powers[used],
        basis[used].astype(np.int64),
        np.ascontiguousarray(indices[:, used]),
    )


def principal_components(rest: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (components, channels) and the energies along them, the greatest first.

    The largest entry of each vector is positive.
    """
    n_frames, n_channels = rest.shape
    scale = float(np.abs(rest).max(initial=0.0))
    if not scale > 0:
        return np.zeros((0, n_channels)), np.zeros(0)
    # Not by singular values: those take several threads, and on a busy machine 100 times as long.
    scaled = rest / scale
    if n_channels <= n_frames:
        vectors = np.linalg.eigh(scaled.T @ scaled)[1].T
    else:
        # The longest first: if one is nothing but rounding, as there always is when means have
        # been taken away, it must not come back at unit length along another.
        spanned = (scaled.T @ np.linalg.eigh(scaled @ scaled.T)[1])[:, ::-1]
        vectors = np.linalg.qr(spanned)[0].T
    energies = ((scaled @ vectors.T) ** 2).sum(axis=0)  # more exact than eigenvalues
    order = np.argsort(-energies, kind="stable")
    order = order[energies[order] > energies[order[0]] * NEGLIGIBLE]
    vectors = vectors[order]
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=1)[:, None], axis=1)
    return vectors * np.where(largest < 0, -1.0, 1.0), energies[order] * scale**2


def _fit_components(basis: Floats, left: Floats) -> Floats:
    """Coefficients (frames, components) of least squares upon ``basis`` (components, channels)."""
    gram = basis @ basis.T
    if len(gram) and np.linalg.cond(gram) < WELL_CONDITIONED:
        return np.asarray(np.linalg.solve(gram, basis @ left.T).T)
    return np.asarray(np.linalg.lstsq(basis.T, left.T, rcond=None)[0].T)


def _grid(energies: Floats, q: int, means: Floats, n_frames: int) -> Grid:
    """Steps whose noise is ``NOISE`` of the energy of the omitted components."""
    lost = float(energies[q:].sum()) / n_frames
    step = math.sqrt(12 * NOISE * lost / q) if q else 0.0
    greatest = math.sqrt(float(energies[0]) / n_frames) if len(energies) else 0.0
    floor = FINEST * max(greatest, float(np.abs(means).max(initial=0.0)) / 16)
    return grid_of(code_of(max(step, floor)))


def _decimal_grid(decimals: int) -> Grid:
    return Grid(10.0**-decimals, 10.0**-decimals, 0)


def _round_components(values: Floats, step: float, decimals: int | None) -> Ints:
    """Integers, halves away from zero; raises MotionError if one is too large."""
    sizes = np.abs(values) / step if decimals is None else np.abs(values) * 10.0**decimals
    rounded = np.floor(sizes + 0.5)
    if not (rounded <= MAX_INDEX).all():
        raise MotionError("pca: a coefficient exceeds 2^40 quantizer steps")
    return np.where(values < 0, -rounded, rounded).astype(np.int64)


def _values(indices: Ints, step: float, decimals: int | None) -> Floats:
    return np.asarray(indices * step if decimals is None else indices / 10.0**decimals)
