"""Codec 17, ``qbc``: quadratic Bezier curves, the channels of a joint as points of R^N.

SPEC.md, "Codec 17: qbc", is normative; the names below are its field names.
Source: M. A. Khan, An efficient algorithm for compression of motion capture signal using
multidimensional quadratic Bezier curve break-and-fit method, 2014 and 2017. The preset
``khan2014`` follows the published implementation; by default middle points are those of least
squares, and the bound holds for what is decoded.

Exactness: lossy; decoding is bit-exact (integers, then binary64 in the order that SPEC.md states).
The coarse resolution has a stream of marks for each joint, the points every ``delta`` frames; the
fine one has the curves between them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from construct import Float64l, If, Int8ul, this

from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    RecodeRequest,
    Request,
    Segment,
    SignalSource,
    Span,
)
from mcz.codecs.curves import kernels
from mcz.codecs.curves.choices import (
    BREAKS,
    LEAST_STEP,
    MIDDLES,
    PRESETS,
    Plan,
    plan_of_header,
    plan_of_options,
    position_channels,
)
from mcz.codecs.curves.streams import (
    Curves,
    build_curves,
    build_marks,
    parse_curves,
    parse_first_mark,
    parse_marks,
    straight_curves,
)
from mcz.codecs.parameters import (
    MAX_DECIMALS,
    SCALED,
    Dial,
    Parameter,
    choice,
    decimals_parameter,
    integer,
    number,
    preset_parameter,
)
from mcz.codecs.segments import (
    SEGMENT_FRAMES,
    SEGMENT_FRAMES_PARAMETER,
    Lengths,
    segments_by_halving,
)
from mcz.codecs.source_readers import SegmentReader, SubsetSource
from mcz.errors import FormatError, OptionError
from mcz.model.schema import UVARINT, Checked, Record, bounded, build, field, parse
from mcz.model.types import Floats, Ints, Params

MAX_DELTA = 2**20
LEAST_FRAMES = 240  # of a segment: in fewer, hundreds of channels would cost more than they save

STEP = If(this.decimals == SCALED, bounded(Float64l, LEAST_STEP, 1 / LEAST_STEP))  # QBC-04


class QbcHeader(Record):
    delta: int = field(
        bounded(UVARINT, 1, MAX_DELTA), "frames from mark to mark, 1 to 2^20"
    )  # QBC-02
    coded_frames: int = field(UVARINT, "frames of the signal that was coded, from frame 0 on")
    decimals: int = field(
        Checked(Int8ul, lambda value: value <= MAX_DECIMALS or value == SCALED),
        "decimals of control points, 0 to 15; 255: they are multiples of steps",
    )  # QBC-03
    step: float | None = field(STEP, "2^-100 to 2^100, only if decimals is 255")
    position_step: float | None = field(STEP, "the same of the channels tx, ty, tz and length")


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    plan = plan_of_options(params, source.layout)
    header = QbcHeader(
        delta=plan.delta,
        coded_frames=source.layout.n_frames,
        decimals=SCALED if plan.decimals is None else plan.decimals,
        step=plan.step if plan.decimals is None else None,
        position_step=plan.step * plan.lever if plan.decimals is None else None,
    )
    return Encoded(build(header, "qbc header"), _segments(source, plan), 2)


def _segments(source: SignalSource, plan: Plan) -> Iterator[Segment]:
    n_frames, delta = source.layout.n_frames, plan.delta
    code = _Coder(source, n_frames, plan)
    length = _segment_length(source.layout, plan)
    lengths = Lengths(length, bool(plan.segment_frames), delta, LEAST_FRAMES)
    for first, stop, streams in segments_by_halving(n_frames, lengths, code):
        yield Segment(first, stop - first, streams, lead=min(first, delta - 1))


class _Coder:
    """Codes segments of a signal of ``n_frames``, one after the other."""

    def __init__(self, source: SignalSource, n_frames: int, plan: Plan) -> None:
        self.groups, self.n_frames, self.plan = source.layout.groups, n_frames, plan
        levers = np.where(position_channels(source.layout), plan.lever, 1.0)
        self._frames = SegmentReader("qbc", source, levers)

    def __call__(self, first: int, stop: int) -> tuple[bytes, ...]:
        """The streams of frames first <= f < stop: all coarse ones, then all fine ones."""
        end = min(stop + 1, self.n_frames)  # the first mark of the next segment
        block = self._frames(first, end)
        marks = marks_of(first, stop, self.n_frames, self.plan.delta) - first
        pairs = [
            _joint_streams(block[:, list(group)], marks, stop - first, self.plan)
            for group in self.groups
        ]
        return (*(coarse for coarse, _ in pairs), *(fine for _, fine in pairs))


def _segment_length(layout: Layout, plan: Plan) -> int:
    """Frames per segment: the requested number, rounded to a multiple of delta within the limit."""
    delta, most = plan.delta, layout.most_frames
    if most < min(delta, layout.n_frames):
        raise OptionError(
            f"qbc: delta is {delta}, but a segment of {layout.n_channels} channels may have "
            f"at most {most} frames"
        )
    length = -(-(plan.segment_frames or SEGMENT_FRAMES) // delta) * delta
    return max(delta, min(length, most // delta * delta))


def recode(request: RecodeRequest) -> Iterator[tuple[bytes, ...]]:
    """The streams of some joints with new values, with marks and steps of the header."""
    fields = parse(QbcHeader, request.header, "qbc header")
    plan = plan_of_header(fields, request.options)
    part = SubsetSource(request.source, request.groups, fields.coded_frames)
    code = _Coder(part, fields.coded_frames, plan)
    for span in request.spans:
        yield code(span.first, span.stop)[
            : request.source.layout.n_resolutions * len(request.groups)
        ]


def preview(header: bytes, layout: Layout, spans: Sequence[Span]) -> Ints:
    """The stored frames with a mark."""
    fields = parse(QbcHeader, header, "qbc header")
    _check(fields, layout, spans)
    own = [
        marks[marks < span.stop]
        for span in spans
        for marks in (marks_of(span.first, span.stop, fields.coded_frames, fields.delta),)
    ]
    return np.concatenate([np.zeros(0, np.int64), *own])


def marks_of(first: int, stop: int, n_frames: int, delta: int) -> Ints:
    """Frames with a mark that affect the segment: its own, and the first after it."""
    frames = list(range(first, stop, delta))
    if stop < n_frames:
        frames.append(stop)
    elif frames[-1] != n_frames - 1:
        frames.append(n_frames - 1)
    return np.array(frames, np.int64)


def _joint_streams(points: Floats, marks: Ints, stop: int, plan: Plan) -> tuple[bytes, bytes]:
    """The two streams of a joint; ``marks`` counted from the segment's first frame."""
    points = np.ascontiguousarray(points)
    rounded = plan.points(plan.indices(points)) if plan.is_closed else points
    find = kernels.breaks_of_fewest if plan.has_fewest_breaks else kernels.breaks_by_splitting
    is_break = np.zeros(len(points), np.bool_)
    is_break[marks] = True
    rule = kernels.Rule(plan.method, *plan.grid, int(plan.is_closed))
    find(points, rounded, marks, plan.limit, rule, is_break)
    breaks = np.flatnonzero(is_break)
    middles = np.zeros((len(breaks) - 1, points.shape[1]))
    kernels.middles(middles, points, rounded, breaks, plan.method)
    mids = plan.indices(middles)
    ends = plan.indices(points[breaks])
    mark_points = ends[np.searchsorted(breaks, marks)]
    lengths = np.diff(breaks)
    mids[lengths == 1] = (ends[:-1][lengths == 1] + ends[1:][lengths == 1]) >> 1
    own = marks < stop
    fine = build_curves(mark_points, marks, Curves(lengths, ends[1:], mids))
    return build_marks(mark_points[own]), fine


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Floats:
    """Return the values, (frames, channels of the groups); raise FormatError on bad bytes."""
    fields = parse(QbcHeader, header, "qbc header")
    _check(fields, layout, spans)
    n_columns = sum(len(layout.groups[group]) for group in request.groups)
    out = np.zeros((request.stop - request.start, n_columns))
    for index, span in enumerate(spans):
        if span.first < request.stop and request.start < span.stop:
            _read_segment(out, fields, layout, spans, index, request, fetch)
    return out


def _check(fields: QbcHeader, layout: Layout, spans: Sequence[Span]) -> None:
    if layout.samples_per_frame != 1 or layout.n_resolutions > 2:  # QBC-01
        raise FormatError(
            f"qbc: {layout.samples_per_frame} samples a frame and {layout.n_resolutions} "
            "resolutions are not allowed"
        )
    for span in spans:
        lead = min(span.first, fields.delta - 1)
        # QBC-06, QBC-08, QBC-09, QBC-10
        if span.first % fields.delta or (span.lead, span.tail, span.fresh) != (lead, 0, True):
            raise FormatError(
                f"qbc: the segment at {span.first} has lead {span.lead} and tail {span.tail}, "
                f"which do not fit marks {fields.delta} frames apart"
            )
    end = spans[-1].stop if spans else 0
    # QBC-05, QBC-07
    if end > fields.coded_frames or (end < fields.coded_frames and end % fields.delta):
        raise FormatError(f"qbc: the segments end at frame {end}, not {fields.coded_frames}")


def _read_segment(
    out: Floats,
    fields: QbcHeader,
    layout: Layout,
    spans: Sequence[Span],
    index: int,
    request: Request,
    fetch: Fetch,
) -> None:
    """Fill the requested frames and channels of one segment into ``out``."""
    span = spans[index]
    start, stop = max(span.first, request.start), min(span.stop, request.stop)
    frames = marks_of(span.first, span.stop, fields.coded_frames, fields.delta)
    own = len(frames) - (span.stop < fields.coded_frames)
    # In a damaged file the next segment may be lost, and another one follow in the list.
    is_last = index + 1 == len(spans) or spans[index + 1].first != span.stop
    needs_next = stop > frames[own - 1] + 1
    if own < len(frames) and is_last and needs_next:  # QBC-12, QBC-13
        raise FormatError(f"qbc: frames before {span.stop} need the next segment")
    # The next segment is not fetched if the requested part of this one does not need it.
    whole = own == len(frames) or not (is_last or (stop < span.stop and not needs_next))
    frames = frames if whole else frames[:own]
    is_position = position_channels(layout)
    column = 0
    for group in request.groups:
        n = len(layout.groups[group])
        marks = parse_marks(fetch(index, 0, group), own, n)
        if own < len(frames):
            # DATA-09, QBC-11, QBC-12
            behind = parse_first_mark(fetch(index + 1, 0, group), n)
            marks = np.concatenate([marks, behind])
        fine = layout.n_resolutions - request.resolution > 1
        curves = (
            parse_curves(fetch(index, 1, group), marks, frames, whole=whole)
            if fine
            else straight_curves(marks, frames)
        )
        steps = None
        if fields.step is not None and fields.position_step is not None:  # QBC-27
            are_positions = is_position[list(layout.groups[group])]
            steps = np.array([fields.step, fields.position_step])[are_positions.astype(np.intp)]
        points = [_points(indices, fields, steps) for indices in (marks, curves.mids, curves.ends)]
        starts = np.concatenate([points[0][:1], points[2][:-1]])
        block = out[start - request.start : stop - request.start, column : column + n]
        kernels.evaluate(block, start, span.first, starts, points[1], points[2], curves.lengths)
        if start <= frames[-1] < stop:  # no curve begins there
            block[frames[-1] - start] = points[0][-1]
        column += n


def _points(indices: Ints, fields: QbcHeader, steps: Floats | None) -> Floats:
    if steps is not None:
        return np.asarray(indices * steps)
    return np.asarray(indices / 10.0**fields.decimals)  # QBC-26


def cut(header: bytes, layout: Layout, first: int, stop: int, groups: Sequence[int]) -> bytes:
    """The header for stored frames first <= f < stop."""
    fields = parse(QbcHeader, header, "qbc header")
    fields.coded_frames -= first
    return build(fields, "qbc header")


CODEC = Codec(
    id=17,
    name="qbc",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    cut=cut,
    recode=recode,
    preview=preview,
    dial=Dial("d2_lmt", 2.0**-40, 2.0**40),
    parameters=(
        preset_parameter(PRESETS),
        Parameter(
            "d2_lmt",
            None,
            "greatest squared distance of a joint's channels from their curve; default 1",
            number("d2_lmt", 0, 2.0**40),
        ),
        Parameter(
            "delta", None, "frames from mark to mark; default 40", integer("delta", 1, MAX_DELTA)
        ),
        decimals_parameter(
            "decimals of control points; default: 3/4 of the distance allowed is a step"
        ),
        Parameter("middle", None, f"{' or '.join(MIDDLES)}", choice("middle", MIDDLES)),
        Parameter("breaks", "split", f"{' or '.join(BREAKS)}", choice("breaks", BREAKS)),
        SEGMENT_FRAMES_PARAMETER,
    ),
)
