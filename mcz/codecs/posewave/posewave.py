"""Codec 13, ``posewave``: wavelets in time, coded in the metric of the pose.

SPEC.md, "Codec 13: posewave", is normative; the names below are its field names.

Frames become a pyramid: an approximation of every 32nd frame or so, and details of five levels. All
channels of one time and level are a row. A row is not coded in degrees but in the metric of the
pose that a decoder has from the coarser levels: how far points and local axes move. So one
quantizer step serves all channels, and what is not seen costs nothing.

Exactness: lossy; decoding is bit-exact (integers, and binary64 + - * / in the order that SPEC.md
states). A stream holds one resolution of one segment; a segment decodes by itself.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    Request,
    Segment,
    SignalSource,
    Span,
)
from mcz.codecs.gaps import SegmentReader
from mcz.codecs.parameters import Dial, Parameter, choice, integer, number
from mcz.codecs.posewave.choices import choose, guess
from mcz.codecs.posewave.exact import build_exact, decode_exact, joint_words, partition
from mcz.codecs.posewave.header import (
    NAME,
    POSEWAVE_HEADER,
    Header,
    build_header,
    parse_header,
)
from mcz.codecs.posewave.limits import joint_limits
from mcz.codecs.posewave.segment import Weights, decode_segment, encode_segment
from mcz.codecs.segments import (
    SEGMENT_FRAMES_PARAMETER,
    Lengths,
    halving,
    segment_frames_of,
    skeleton_of,
)
from mcz.errors import FormatError, OptionError
from mcz.schema import parse

Floats = NDArray[np.float64]

MOST_FRAMES = 8192  # of a segment, where the caller leaves it open
LEAST_FRAMES = 512


# What a preset promises: that no point is farther off in any frame.
PRESETS = {"mm": 0.1, "visible": 0.5, "preview": 3.0}


def promise(options: Mapping[str, Any]) -> dict[str, Any]:
    """The greatest error in cm of the preset."""
    return {"max_error_cm": PRESETS[options["preset"]]}


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the values of ``source``, rotations unwrapped; what is invalid is filled.

    Raises MotionError for a value that is not finite or too large.
    """
    layout = source.layout
    choice = choose(source, params)
    header = parse_header(choice.header, layout)
    segments = _segments(source, header, choice.weights, params)
    return Encoded(choice.header, segments, header.levels + 1)


def _segments(
    source: SignalSource, header: Header, weights: Weights, params: Mapping[str, Any]
) -> Iterator[Segment]:
    layout = source.layout
    skeleton = skeleton_of(NAME, layout)
    if not layout.n_channels:
        if layout.n_frames:
            yield Segment(0, layout.n_frames, ())
        return
    wanted = segment_frames_of(layout, params["segment_frames"])
    length = min(wanted or MOST_FRAMES, layout.most_frames)
    lengths = Lengths(length, bool(wanted), least=LEAST_FRAMES)
    reader = SegmentReader(NAME, source)
    octaves, lossy = params["refinement"], _lossy(header, layout)

    def code(first: int, stop: int) -> tuple[bytes, ...]:
        own = None if octaves is None else octaves[first:stop]
        streams = {
            (0, group): stream
            for group, stream in zip(
                header.exact_groups,
                build_exact(source, header.exact_groups, first, stop),
                strict=True,
            )
        }
        values = reader(first, stop)
        if lossy:
            levels = encode_segment(header, skeleton, values, weights, own)[0]
            streams |= {(level, lossy[0]): stream for level, stream in enumerate(levels)}
        places = itertools.product(range(header.levels + 1), range(len(layout.groups)))
        return tuple(streams.get(place, b"") for place in places)

    breaks = source.breaks if header.exact_groups else ()
    for first, stop, streams in halving(layout.n_frames, lengths, code, breaks):
        yield Segment(first, stop - first, streams)


def _lossy(header: Header, layout: Layout) -> list[int]:
    """The groups of lossy channels, the first of which has the streams."""
    return [group for group in range(len(layout.groups)) if group not in header.exact_groups]


def cut(header: bytes, layout: Layout, first: int, stop: int, groups: tuple[int, ...]) -> bytes:
    """Exact groups can be left alone; rows, of which all lossy joints have a part, cannot be cut.

    Raises OptionError for other groups.
    """
    fields = parse(POSEWAVE_HEADER, header, f"{NAME} header")
    if len(groups) == len(layout.groups):
        return header
    if not set(groups) <= set(fields.exact):
        raise OptionError(
            f"{NAME}: joints that are not coded exactly cannot be cut out or left out; all of them "
            f"are coded in one"
        )
    left = {"plain": [], "orders": [], "exact": range(len(groups))}
    return build_header(**{**fields, **left})


def exact_groups(header: bytes, layout: Layout) -> tuple[int, ...]:
    """The groups of ordinals; raises FormatError on bad bytes."""
    return parse_header(header, layout).exact_groups


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> NDArray[Any]:
    """The values, (frames, channels of the groups), ordinals of exact groups.

    Raises FormatError on bad bytes.
    """
    fields = parse_header(header, layout)
    for span in spans:
        if span.lead or span.tail or not span.fresh:  # PWAVE-03
            raise FormatError(f"{NAME}: the segment at {span.first} bears upon others")
    if request.groups and set(request.groups) <= set(fields.exact_groups):
        return decode_exact(layout, spans, request, fetch, NAME)
    columns = [column for group in request.groups for column in layout.groups[group]]
    out = np.zeros((request.stop - request.start, len(columns)))
    if not columns:
        return out
    for index, span in enumerate(spans):
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start >= stop:
            continue
        values = _lossy_values(fields, layout, index, span, request, fetch)
        out[start - request.start : stop - request.start] = values[
            start - span.first : stop - span.first, columns
        ]
    return out


def _lossy_values(
    fields: Header, layout: Layout, index: int, span: Span, request: Request, fetch: Fetch
) -> Floats:
    """All channels of a segment, in which exact ones are of no account."""
    skeleton, where = layout.skeleton, f"{NAME}: segment at {span.first}"
    assert skeleton is not None  # the header was checked against it
    stored = range(layout.n_resolutions - request.resolution)
    first, *others = _lossy(fields, layout)
    for group in set(others) & set(request.groups):
        if any(fetch(index, resolution, group) for resolution in stored):  # PWAVE-30
            raise FormatError(f"{where}: a stream of the group {group}, whose rows {first} has")
    streams = [fetch(index, resolution, first) for resolution in stored]
    return decode_segment(fields, skeleton, streams, span.n_frames, where)


CODEC = Codec(
    id=13,
    name=NAME,
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    grouping="all",
    dial=Dial("step", 2.0**-30, 2.0**30, guess=guess),
    promise=promise,
    cut=cut,
    partition=partition,
    exact=exact_groups,
    parameters=(
        Parameter(
            "preset",
            "visible",
            "no point is farther off than 1 mm (mm), 5 mm (visible), 3 cm (preview)",
            choice("preset", tuple(PRESETS)),
        ),
        Parameter(
            "step",
            None,
            "quantizer step in cm; default: what the preset takes",
            number("step", 1e-9, 1e9),
        ),
        Parameter("levels", None, "levels; default: what suits the clip", integer("levels", 0, 8)),
        Parameter(
            "quality",
            None,
            "mean errors of joints or groups of them, such as feet=0.5mm,head=1mm",
            joint_limits,
        ),
        Parameter(
            "lossless",
            None,
            "joints or groups of them that are coded exactly, such as lfoot,ltoes or feet",
            joint_words,
        ),
        Parameter("weights", None, "weight of each joint", np.asarray, inner=True),
        Parameter("refinement", None, "octaves of each frame", np.asarray, inner=True),
        SEGMENT_FRAMES_PARAMETER,
    ),
)
