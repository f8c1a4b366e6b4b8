"""Codec 18, ``pca``: principal components of the frames, coefficients predicted in time.

SPEC.md, "Codec 18: pca", is normative; the names below are its field names.
Source: M. A. Khan, An efficient algorithm for compression of motion capture signal using
multidimensional quadratic Bezier curve break-and-fit method, 2014, section 4; the preset
``khan2014`` has the errors that its tables print, the defaults improve upon it.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). A stream holds all channels of one segment, with a basis of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from construct import Int8ul
from numpy.typing import NDArray

from mcz.codecs.contract import Codec, Encoded, Fetch, Layout, Request, Segment, SignalSource, Span
from mcz.codecs.gaps import SegmentReader
from mcz.codecs.parameters import (
    MAX_DECIMALS,
    SCALED,
    Dial,
    Parameter,
    decimals_parameter,
    integer,
    preset_parameter,
    preset_values,
)
from mcz.codecs.pca.choices import MEAN_STEPS, components_of
from mcz.codecs.pca.streams import build_stream, parse_stream
from mcz.codecs.segments import (
    SEGMENT_FRAMES,
    SEGMENT_FRAMES_PARAMETER,
    Lengths,
    segment_frames_of,
    segments_by_halving,
)
from mcz.codecs.step_codes import ratio_of
from mcz.errors import FormatError
from mcz.model.schema import Checked, Record, build, field, parse
from mcz.model.types import Params, Reals, Settings, Values

Floats = NDArray[np.float64]

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
            f"pca: {layout.samples_per_frame} samples a frame, {layout.n_resolutions} resolutions"
        )
    if len(layout.groups) > 1:  # PCA-01
        raise FormatError(f"pca: {len(layout.groups)} groups, it has one")
    for span in spans:
        if (span.lead, span.tail, span.fresh) != (0, 0, True):  # PCA-03, PCA-04
            raise FormatError(f"pca: the segment at {span.first} bears upon others")


def _segment(stream: bytes, decimals: int, layout: Layout, span: Span, wanted: int) -> Floats:
    """The first ``wanted`` frames of a segment."""
    from mcz.codecs.pca import kernels

    scaled = decimals == SCALED
    parts = parse_stream(stream, layout.n_channels, span.n_frames, wanted, scaled=scaled)
    if scaled:
        step = ratio_of(parts.step)
        means, rows = parts.means * (step / MEAN_STEPS), parts.coefficients * step  # PCA-15
    else:
        means, rows = parts.means / 10.0**decimals, parts.coefficients / 10.0**decimals  # PCA-16
    basis = np.ldexp(parts.basis.astype(np.float64), -parts.shifts[:, None])
    out = np.zeros((wanted, layout.n_channels))
    kernels.evaluate(out, _plain(means), _plain(basis), _plain(rows))
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
    dial=Dial("q", 1, 2**20, rises=True, whole=True),
    parameters=(
        preset_parameter(PRESETS),
        Parameter("q", None, "components of a segment; default 20", integer("q", 1, 2**20)),
        decimals_parameter(
            "decimals of means and coefficients; default: a step that suits what is left out"
        ),
        SEGMENT_FRAMES_PARAMETER,
    ),
)
