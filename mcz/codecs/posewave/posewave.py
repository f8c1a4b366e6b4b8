"""Codec 3, ``posewave``: wavelets in time, coded in the metric of the pose.

SPEC.md, "Codec 3: posewave", is normative; the names below are its field names.

Frames become a pyramid: an approximation of every 32nd frame or so, and details of five levels. All
channels of one time and level are a row. A row is coded not in degrees but in the metric of the
pose that a decoder has from the coarser levels: the movement of points and local axes. So one
quantizer step serves all channels, and invisible changes cost nothing.

Exactness: lossy; decoding is bit-exact (integers, and binary64 + - * / in the order that SPEC.md
states). A stream holds one resolution of one segment; segments decode independently.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mcz.codecs import contract
from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    Model,
    Request,
    Segment,
    SignalSource,
    Span,
)
from mcz.codecs.parameters import Dial, Parameter, choice, integer, number
from mcz.codecs.posewave.choices import PRESETS, Choice, choose, guess_step, live_choice
from mcz.codecs.posewave.contact_choice import parse_runs, run_words
from mcz.codecs.posewave.exact_channels import (
    build_exact,
    cut_header,
    decode_exact,
    joint_words,
    most_frames,
    partition,
)
from mcz.codecs.posewave.header import NAME, Header, parse_posewave_header
from mcz.codecs.posewave.memory import Memory, trial_of
from mcz.codecs.posewave.model_state import MAX_EXPONENT
from mcz.codecs.posewave.segment import SegmentChain, decode_segment, encode_segment
from mcz.codecs.segments import (
    SEGMENT_FRAMES_PARAMETER,
    Lengths,
    segment_frames_of,
    segments_by_halving,
    skeleton_of,
)
from mcz.codecs.source_readers import LiveRows, SegmentReader
from mcz.errors import FormatError, LostFrameError, OptionError
from mcz.kinematics.frames import FramePositions
from mcz.model.motion import Skeleton
from mcz.model.types import Bools, Floats, Params, Settings, Values
from mcz.model.units import UNIT_CM

JOINING = 480  # frames from one that starts fresh to the next, by default
NEEDS_ALL = ("quality", "lossless", "contacts")


class LiveEncoder(contract.LiveEncoder):
    """Encode one frame per push, periodically a fresh segment, else a continuation.

    With a preset each frame is coded with finer and finer steps until all its points are within the
    promised error. A refused frame changes no state.
    """

    models: tuple[Model, ...] = ()
    version: int | None

    def __init__(self, layout: Layout, options: Params) -> None:
        self.skeleton = skeleton_of(NAME, layout)
        if options["levels"]:
            raise OptionError(
                f"{NAME}: levels={options['levels']} needs later frames, which a live stream "
                "does not have; use levels=0"
            )
        for name in NEEDS_ALL:
            if options[name] is not None:
                raise OptionError(
                    f"{NAME}: {name} needs all frames, which a live stream does not have"
                )
        bound = PRESETS[options["preset"]] if options["step"] is None else None
        choice = live_choice(self.skeleton, options["step"], bound)
        self.header, self._weight = choice.header, choice.weights.approximations
        fields = parse_posewave_header(self.header, layout)
        self.version = fields.version
        self._chain = SegmentChain(fields, self.skeleton)
        self._bound = math.inf if bound is None else bound / (self.skeleton.unit_cm or 1.0)
        self._places = None if bound is None else FramePositions(self.skeleton)
        self._every = options["segment_frames"] or JOINING
        self._at = 0
        self._rows = LiveRows(NAME, layout)

    def push(self, values: Floats, valid: Bools | None = None) -> tuple[bytes, bool]:
        row = self._rows.row(values, valid, self._at)
        fresh = self._at % self._every == 0
        for exponent in range(MAX_EXPONENT + 1):
            chain = self._chain.copy()
            stream, decoded = chain.encode(row, self._weight, exponent, fresh=fresh)
            if self._is_near(row[0], decoded[0]):
                break
        self._chain = chain
        self._rows.keep()
        self._at += 1
        return stream, fresh

    def _is_near(self, row: Floats, decoded: Floats) -> bool:
        if self._places is None:
            return True
        away = self._places(row) - self._places(decoded)
        return bool((np.sqrt((away * away).sum(axis=1)) <= self._bound).all())

    def change(self, options: Params) -> None:
        raise OptionError(f"{NAME}: {', '.join(options)} cannot change within a stream")


class LiveDecoder:
    """The inverse of ``LiveEncoder``."""

    def __init__(self, header: bytes, layout: Layout) -> None:
        self._fields, self._skeleton = (
            parse_posewave_header(header, layout),
            skeleton_of(NAME, layout),
        )
        self._chain = SegmentChain(self._fields, self._skeleton)
        self._broken = True  # until a fresh frame comes

    def push(self, stream: bytes, fresh: bool) -> Floats:
        if self._broken and not fresh:  # PWAVE-31
            raise LostFrameError(f"{NAME}: a frame needs the previous frame, which did not arrive")
        self._broken = True
        if self._fields.may_go_on:
            values: Floats = self._chain.decode(stream, 1, NAME, fresh=fresh)[0]
        elif fresh:
            values = decode_segment(self._fields, self._skeleton, [stream], 1, NAME)[0]
        else:  # PWAVE-28
            raise FormatError(f"{NAME}: a frame does not start fresh")
        self._broken = False
        return values

    def skip(self, n_frames: int) -> None:
        self._broken = self._broken or n_frames > 0


MOST_FRAMES = 8192  # of a segment, by default
LEAST_FRAMES = 512
UNLIKE = 0.9  # of a trial's bytes, those that the next one takes at least
_LIMIT = re.compile(r"(?P<name>.+)=(?P<number>[0-9.e+-]+) ?(?P<unit>[a-z]+)")


def promise(options: Params) -> Settings:
    """The greatest error in cm of the preset."""
    return {"max_error_cm": PRESETS[options["preset"]]}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite or too large.
    """
    layout = source.layout
    choice = choose(source, params)
    header = parse_posewave_header(choice.header, layout)
    segments = _segments(source, header, choice, params)
    return Encoded(choice.header, segments, header.levels + 1, version=header.version)


def _segments(
    source: SignalSource, header: Header, choice: Choice, params: Params
) -> Iterator[Segment]:
    """Yield the segments of a signal, each of as many frames as its size allows."""
    layout = source.layout
    skeleton = skeleton_of(NAME, layout)
    if not layout.n_channels:
        if layout.n_frames:
            yield Segment(0, layout.n_frames, ())
        return
    requested = segment_frames_of(layout, params["segment_frames"])
    length = min(requested or MOST_FRAMES, layout.most_frames)
    if header.exact_groups:
        length = min(length, most_frames(layout, header.exact_groups))
    reader = SegmentReader(NAME, source)
    octaves, tracker, lossy = params["refinement"], choice.tracker, _lossy(header, layout)
    memory: Memory = (not tracker and params["memory"]) or Memory()
    lengths = Lengths(length, bool(requested), least=LEAST_FRAMES)
    if not requested:  # what is surely too large need not be coded first
        n_frames, each = min(length, layout.n_frames), choice.frame_bytes or memory.frame_bytes
        lengths = replace(lengths, length=lengths.fit(length, n_frames, each * n_frames))

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
            if tracker:
                tracker.first = first
            trial = trial_of(choice.header, first, stop, own)
            settings = header, skeleton, values, choice.weights, own, tracker
            with np.errstate(over="ignore"):  # of values that are refused in the end
                levels = memory.streams(trial, header, partial(encode_segment, *settings))
            streams |= {(level, lossy[0]): stream for level, stream in enumerate(levels)}
        places = itertools.product(range(header.levels + 1), range(len(layout.groups)))
        return tuple(streams.get(place, b"") for place in places)

    breaks = source.breaks if header.exact_groups else ()
    n_bytes = 0
    for first, stop, streams in segments_by_halving(layout.n_frames, lengths, code, breaks):
        yield Segment(first, stop - first, streams)
        n_bytes += sum(map(len, streams))
    memory.frame_bytes = UNLIKE * n_bytes / max(layout.n_frames, 1)
    if tracker and header.contacts:
        tracker.warn(skeleton, header.contacts)


def _lossy(header: Header, layout: Layout) -> list[int]:
    """The groups of lossy channels; the first has their streams."""
    return [group for group in range(len(layout.groups)) if group not in header.exact_groups]


def exact_groups(header: bytes, layout: Layout) -> tuple[int, ...]:
    """The groups of ordinals; raises FormatError on bad bytes."""
    return parse_posewave_header(header, layout).exact_groups


def decode(
    header: bytes,
    layout: Layout,
    spans: Sequence[Span],
    request: Request,
    fetch: Fetch,
    version: int = 1,
) -> Values:
    """The values, (frames, channels of the groups), ordinals of exact groups.

    Raises FormatError on bad bytes.
    """
    fields = parse_posewave_header(header, layout)
    if fields.version > version:  # PWAVE-40
        raise FormatError(f"{NAME}: whole turns are not allowed in version {version}")
    for span in spans:
        if span.lead or span.tail:  # PWAVE-03
            raise FormatError(f"{NAME}: the segment at {span.first} must not have a lead or tail")
        if not (span.fresh or fields.may_go_on):  # PWAVE-28
            raise FormatError(f"{NAME}: the segment at {span.first} must start fresh")
    if request.groups and set(request.groups) <= set(fields.exact_groups):
        return decode_exact(layout, spans, request, fetch, NAME)
    columns = [column for group in request.groups for column in layout.groups[group]]
    whole = columns == list(range(layout.n_channels))
    out = np.zeros((request.stop - request.start, len(columns)))
    if not columns:
        return out
    assert layout.skeleton is not None  # the header was checked against it
    lossy, decode_one = _lossy(fields, layout), _decoder(fields, layout.skeleton)
    for index in _needed_segments(spans, request):
        span = spans[index]
        stored = range(layout.n_resolutions - request.resolution)
        for group in set(lossy[1:]) & set(request.groups):
            if any(fetch(index, resolution, group) for resolution in stored):  # PWAVE-34
                raise FormatError(
                    f"{NAME}: segment at {span.first}: group {group} must not have a stream"
                )
        values = decode_one([fetch(index, resolution, lossy[0]) for resolution in stored], span)
        start, stop = max(span.first, request.start), min(span.stop, request.stop)
        if start < stop:
            rows = values[start - span.first : stop - span.first]
            out[start - request.start : stop - request.start] = rows if whole else rows[:, columns]
    return out


def _needed_segments(spans: Sequence[Span], request: Request) -> range:
    before = [i for i, span in enumerate(spans) if span.fresh and span.first <= request.start]
    stop = sum(span.first < request.stop for span in spans)
    return range(max(before, default=0), stop if request.start < request.stop else 0)


def _decoder(header: Header, skeleton: Skeleton) -> Callable[[Sequence[bytes], Span], Floats]:
    """Return a function that decodes segments in order, (n_frames, n_channels) each.

    Its results for exact channels are undefined.
    """
    chain = SegmentChain(header, skeleton)

    def decode_one(streams: Sequence[bytes], span: Span) -> Floats:
        where = f"{NAME}: segment at {span.first}"
        if header.may_go_on:
            return chain.decode(streams[0], span.n_frames, where, fresh=span.fresh)
        return decode_segment(header, skeleton, streams, span.n_frames, where)

    return decode_one


def joint_limits(text: object) -> tuple[tuple[str, float], ...]:
    """Parse joints or groups and their mean errors in cm; raises OptionError.

    >>> joint_limits("feet=0.5mm, lhand=2cm")
    (('feet', 0.05), ('lhand', 2.0))
    """
    if isinstance(text, tuple):
        return text
    limits = []
    for entry in str(text).split(","):
        match = _LIMIT.fullmatch(entry.strip())
        if match is None or match["unit"] not in UNIT_CM:
            units = ", ".join(UNIT_CM)
            raise OptionError(
                f"quality has {entry!r}; write it like feet=0.5mm, with one of the units {units}"
            )
        try:
            limit = float(match["number"]) * UNIT_CM[match["unit"]]
        except ValueError:
            raise OptionError(
                f"quality has {entry!r}; {match['number']!r} is not a number"
            ) from None
        if not 0 < limit < 1e9:
            raise OptionError(f"quality has {entry!r}; a limit must be above 0")
        limits.append((match["name"], limit))
    return tuple(limits)


def limit_words(limits: tuple[tuple[str, float], ...]) -> str:
    """Inverse of ``joint_limits``.

    >>> limit_words((("feet", 0.05), ("lhand", 2.0)))
    'feet=0.05cm,lhand=2.0cm'
    """
    return ",".join(f"{name}={limit!r}cm" for name, limit in limits)


CODEC = Codec(
    id=3,
    name=NAME,
    version=1,
    earlier={0: partial(decode, version=0)},
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    grouping="all",
    dial=Dial("step", 1e-9, 1e9, guess=guess_step),
    promise=promise,
    cut=cut_header,
    partition=partition,
    memory=Memory,
    exact=exact_groups,
    live=LiveEncoder,
    follow=LiveDecoder,
    live_options={"levels": 0},
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
        Parameter(
            "levels",
            None,
            "levels; default: what suits the clip; 0: no frame waits for a later one",
            integer("levels", 0, 8),
        ),
        Parameter(
            "contacts",
            None,
            "feet that stand keep their place: auto, joints (lfoot,rfoot) or frames (lfoot:120+45)",
            parse_runs,
            show=run_words,
        ),
        Parameter(
            "contact_tolerance",
            None,
            "cm that the displacement of a standing joint may be off; default: the step, 0.01 to "
            "0.05",
            number("contact_tolerance", 1e-6, 1e6),
        ),
        Parameter(
            "quality",
            None,
            "mean errors of joints or groups of them, such as feet=0.5mm,head=1mm",
            joint_limits,
            show=limit_words,
        ),
        Parameter(
            "lossless",
            None,
            "joints or groups of them that are coded exactly, such as lfoot,ltoes or feet",
            joint_words,
        ),
        Parameter("weights", None, "weight of each joint", np.asarray, inner=True),
        Parameter("like", None, "a header whose levels and orders are kept", bytes, inner=True),
        Parameter("limits", None, "bound of each channel", np.asarray, inner=True),
        Parameter("memory", None, "of earlier trials", lambda memory: memory, inner=True),
        Parameter("refinement", None, "octaves of each frame", np.asarray, inner=True),
        SEGMENT_FRAMES_PARAMETER,
    ),
)
