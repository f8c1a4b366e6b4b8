"""Codec 21, ``online``: groups of frames after long-term references, with a step for each frame.

SPEC.md, "Codec 21: online", is normative; the names below are its field names.
Source: C.-H. Kwak, I. V. Bajic, Online MoCap data coding with bit allocation, rate control, and
motion-adaptive post-processing, sections II and III.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). No delay: a frame is coded before the next is known.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mcz.codecs.contract import (
    Codec,
    Encoded,
    Fetch,
    Layout,
    LiveEncoder,
    Request,
    Segment,
    SignalSource,
    Span,
    model_finder,
)
from mcz.codecs.online.coder import (
    GOLOMB,
    INTRA,
    LTR,
    MIXED,
    NAME,
    STR,
    Coder,
    OnlineHeader,
    parse_online_header,
)
from mcz.codecs.online.rate_control import (
    CHANGEABLE,
    PARAMETERS,
    PRESET_IDS,
    choose_live_options,
    choose_options,
    plan_of,
    set_plan,
    settle_options,
)
from mcz.codecs.online.units import Unit, build_units, parse_units
from mcz.codecs.parameters import Dial
from mcz.codecs.segments import TARGET_BYTES
from mcz.codecs.source_readers import FrameReader, LiveRows
from mcz.codecs.space import SpaceFields, check, uses_of
from mcz.codecs.space_choices import sample_of
from mcz.errors import FormatError, OptionError
from mcz.model.schema import build
from mcz.model.types import Bools, Floats, Params, Settings

SEGMENT_FRAMES = 1200  # at least, except for the last


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source``; invalid values are interpolated.

    Raises MotionError for a value that is not finite, or is too large, OptionError for
    contradictory parameters, or a rate without a known frame rate.
    """
    parameters = settle_options(params)
    choice, order = choose_options(sample_of(NAME, source), parameters)
    layout = replace(source.layout, find_model=model_finder((*choice.models, *choice.known)))
    header = build(_header(choice.fields, order, parameters), f"{NAME} header")
    writer = _Writer(header, layout, parameters)
    preset = PRESET_IDS[params["preset"]]
    coded = _segments(source, writer)
    return Encoded(header, coded, models=choice.models, known_models=choice.known, preset=preset)


def _header(space: SpaceFields, order: int, parameters: Params) -> OnlineHeader:
    coder = MIXED if parameters["coder"] == "mixed" else GOLOMB
    return OnlineHeader(space=space, order=order, coder=coder)


class _Writer:
    """Frame kinds (LTR or STR, intra or not), the same for files and live streams."""

    def __init__(self, header: bytes, layout: Layout, parameters: Params) -> None:
        self.parameters, self.layout = dict(parameters), layout
        self.coder = Coder(header, layout)
        self.plan = plan_of(parameters, layout, self.coder.space.step)
        self.frames_left = 0  # remaining frames of the group
        self._size = 0  # of the group
        self._groups = 0  # since the last intra coded one
        self._waiting: Settings | None = None  # parameters of the next group on

    def kind(self) -> int:
        """Kind of the next frame."""
        if self.frames_left:
            return STR
        period = self.parameters["intra_period"]
        if self.coder.at == 0 or (period and self._groups >= period):
            return INTRA
        return LTR

    def code(self, frames: Floats, n_group: int | None = None) -> Unit:
        """Encode frames as a unit of a group of ``n_group`` frames; raises MotionError."""
        if not self.frames_left and self._waiting is not None:
            self.parameters, self._waiting = self._waiting, None
            set_plan(self.plan, self.parameters, self.layout, self.coder.space.step)
        kind = self.kind()
        size = self._size if kind == STR else n_group or self.parameters["gof"]
        unit = self.coder.encode(kind, frames, size, self.parameters["threshold"], self.plan)
        if kind != STR:
            self._groups = 1 if kind == INTRA else self._groups + 1
            self.frames_left = self._size = size
        self.frames_left -= len(frames)
        return unit

    def change(self, options: Params) -> None:
        """Apply parameters from the next group on."""
        self._waiting = settle_options({**self.parameters, **(self._waiting or {}), **options})


def _segments(source: SignalSource, writer: _Writer) -> Iterator[Segment]:
    """Whole groups, and from an intra coded LTR on if there are any."""
    layout = source.layout
    if not layout.n_channels:
        if layout.n_frames:
            yield Segment(0, layout.n_frames, ())
        return
    reader = FrameReader(NAME, source)
    least = writer.parameters["segment_frames"] or SEGMENT_FRAMES
    units: list[Unit] = []
    first = 0
    while reader.at < layout.n_frames:
        n_group = min(writer.parameters["gof"], layout.n_frames - reader.at)
        n_frames = min(writer.frames_left or n_group, layout.most_frames)
        if units and _is_full(units, reader.at - first, least, n_frames, writer):
            yield _segment(first, units)
            units, first = [], reader.at
        units.append(writer.code(reader.next(reader.at + n_frames), n_group))
    if units:
        yield _segment(first, units)


def _is_full(
    units: Sequence[Unit], n_frames: int, least: int, n_more: int, writer: _Writer
) -> bool:
    """Return True if the segment ends before the next unit of ``n_more`` frames."""
    if n_frames + n_more > writer.layout.most_frames:
        return True
    needed = INTRA if writer.parameters["intra_period"] else LTR
    large = n_frames >= least or sum(len(unit.data) for unit in units) > TARGET_BYTES
    return large and writer.kind() >= needed


def _segment(first: int, units: Sequence[Unit]) -> Segment:
    n_frames = sum(unit.n_frames for unit in units)
    return Segment(first, n_frames, (build_units(units),), fresh=units[0].kind == INTRA)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Floats:
    """Return the values, (frames, channels of the groups); raise FormatError on bad bytes."""
    check(NAME, layout, spans, fresh=False)
    n_channels = layout.n_channels if request.groups else 0
    out = np.zeros((request.stop - request.start, n_channels))
    coder = Coder(header, layout)
    if not n_channels:
        return out
    for first, unit in _needed_units(spans, request, fetch):
        coder.skip(first - coder.at)
        block = coder.decode(unit)  # ONLINE-28
        begin, stop = max(first, request.start), min(coder.at, request.stop)
        if begin < stop:
            out[begin - request.start : stop - request.start] = block[begin - first : stop - first]
    return out


def _needed_units(spans: Sequence[Span], request: Request, fetch: Fetch) -> list[tuple[int, Unit]]:
    """The units with which the requested frames can be decoded, each with its first frame."""
    fresh = [i for i, span in enumerate(spans) if span.fresh and span.first <= request.start]
    needed: list[tuple[int, Unit]] = []
    for index in range(max(fresh, default=0), len(spans)):  # DATA-11
        span = spans[index]
        if span.first >= request.stop:
            break
        at = span.first
        units = parse_units(NAME, fetch(index, 0, 0), span.n_frames)
        if span.fresh != (units[0].kind == INTRA):  # ONLINE-13
            raise FormatError(
                f"{NAME}: the segment at {at} must not begin with kind {units[0].kind}"
            )
        for unit in units:
            if unit.kind == INTRA and at <= request.start:
                needed.clear()
            if at < request.stop:
                needed.append((at, unit))
            at += unit.n_frames
    return needed


def uses(header: bytes) -> tuple[bytes, ...]:
    """The models that a header names."""
    return uses_of(parse_online_header(header).space)


class _LiveEncoder(LiveEncoder):
    """One frame a push, each a unit and a segment; fresh ones are intra coded."""

    version: int | None = None

    def __init__(self, layout: Layout, options: Params) -> None:
        parameters = settle_options(options)
        choice, order = choose_live_options(layout, parameters)
        self.header = build(_header(choice.fields, order, parameters), f"{NAME} header")
        self.models, self.preset = choice.models, PRESET_IDS[options["preset"]]
        resolved = replace(layout, find_model=model_finder((*choice.models, *choice.known)))
        self._writer = _Writer(self.header, resolved, parameters)
        self._rows = LiveRows(NAME, layout)

    def push(self, values: Floats, valid: Bools | None = None) -> tuple[bytes, bool]:
        writer = self._writer
        unit = writer.code(self._rows.row(values, valid, writer.coder.at))
        self._rows.keep()
        self._is_intra, self.is_reference = unit.kind == INTRA, unit.kind != STR
        return build_units([unit]), self._is_intra

    def change(self, options: Params) -> None:
        fixed = sorted(set(options) - CHANGEABLE)
        if fixed:
            raise OptionError(
                f"{NAME}: {fixed[0]} cannot change within a stream; "
                f"{', '.join(sorted(CHANGEABLE))} can"
            )
        self._writer.change(options)

    def charge(self, n_bytes: int) -> None:
        self._writer.plan.charge(n_bytes, intra=self._is_intra)


class _LiveDecoder:
    """The inverse of ``_LiveEncoder``."""

    def __init__(self, header: bytes, layout: Layout) -> None:
        self._coder = Coder(header, layout)

    def push(self, stream: bytes, fresh: bool) -> Floats:
        try:
            (unit,) = parse_units(NAME, stream, 1)
            if fresh != (unit.kind == INTRA):
                raise FormatError(f"{NAME}: frame {self._coder.at} must not be of kind {unit.kind}")
        except FormatError:
            self._coder.skip(1)
            raise
        result: Floats = self._coder.decode(unit)[0]
        return result

    def skip(self, n_frames: int) -> None:
        self._coder.skip(n_frames)


CODEC = Codec(
    id=21,
    name=NAME,
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=decode,
    grouping="all",
    positions=True,
    uses=uses,
    live=_LiveEncoder,
    follow=_LiveDecoder,
    dial=Dial("step", 2.0**-60, 2.0**60),
    parameters=PARAMETERS,
)
