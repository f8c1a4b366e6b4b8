"""Codec 19, ``lsdt-frame``: frame differences in a learned basis.

SPEC.md, "Codec 19: lsdt-frame", is normative; the names below are its field names.
Source: J. Hou, L.-P. Chau, N. Magnenat-Thalmann, Y. He, Low-latency compression of mocap data using
learned spatial decorrelation transform, 2016, section 3.1.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). No delay: a frame is coded before the next is known.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import space_choices
from mcz.codecs.coding.prefix_codes import (
    NO_CODES,
    CodeFields,
    build_vectors,
    codes_from,
    fields_of,
    parse_vectors,
)
from mcz.codecs.coding.streams import decode_stream, encode_stream, start_states
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
from mcz.codecs.parameters import Dial, preset_parameter, preset_values
from mcz.codecs.segments import (
    SEGMENT_FRAMES_PARAMETER,
    Lengths,
    segment_frames_of,
    segments_by_halving,
)
from mcz.codecs.source_readers import FrameReader, LiveRows, SegmentReader
from mcz.codecs.space import COURSES, MEAN, SpaceFields, check, space_of, uses_of
from mcz.codecs.spatial import kernels
from mcz.errors import FormatError, LostFrameError, MotionError, OptionError
from mcz.model.schema import Record, build, field, parse
from mcz.model.types import Bools, Floats, Ints, Params, Settings

NAME = "lsdt-frame"
BLOCK_FRAMES = 512  # coded at a time
SEGMENT_FRAMES = 1200


class FrameHeader(Record):
    """Header of lsdt-frame."""

    space: SpaceFields = field(SpaceFields, "how a frame becomes coefficients")
    code: CodeFields = field(CodeFields, "how coefficients become bits")


PRESETS: dict[str, Settings] = {
    "default": {"threshold": space_choices.THRESHOLD, "coder": "mixed"},
    "hou2016": {"threshold": 0.5, "coder": "prefix"},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source``; invalid values are interpolated.

    Raises MotionError for a value that is not finite, or is too large.
    """
    chosen = preset_values(PRESETS, params)
    sample = space_choices.sample_of(NAME, source)
    step = params["step"] or space_choices.default_step(sample)
    choice = space_choices.choose_space(
        NAME, sample, step, params["basis"], space_choices.frame_differences
    )
    layout = replace(source.layout, find_model=model_finder((*choice.models, *choice.known)))
    fields = FrameHeader(space=choice.fields, code=NO_CODES)
    published = params["preset"] == "hou2016"
    length = segment_frames_of(layout, params["segment_frames"], as_published=published)
    coder = _Coder(build(fields, f"{NAME} header"), layout, chosen["threshold"])
    if chosen["coder"] == "prefix" and layout.n_channels:
        length = min(length or SEGMENT_FRAMES, layout.most_frames)  # each begins with large ones
        fields.code = fields_of(_vectors(coder, source, length))
        coder = _Coder(build(fields, f"{NAME} header"), layout, chosen["threshold"])
    segments = _segments(source, coder, length)
    return Encoded(coder.header, segments, models=choice.models, known_models=choice.known)


def _vectors(coder: _Coder, source: SignalSource, length: int) -> Iterator[Ints]:
    """Coefficients of segments of ``length`` frames, as matrices (frames, n_vectors)."""
    reader = FrameReader(NAME, source)
    n_frames = source.layout.n_frames
    for start in range(0, n_frames, length):
        coder.restart()
        indices = coder.quantize(reader.next(min(start + length, n_frames)))
        yield from np.split(indices, coder.space.starts[1:-1], axis=1)


def _segments(source: SignalSource, coder: _Coder, length: int) -> Iterator[Segment]:
    """Segments of ``length`` frames; 0: as many as fill a DATA of the usual size."""
    layout = source.layout
    if not layout.n_channels:
        if layout.n_frames:
            yield Segment(0, layout.n_frames, ())
        return
    frames = SegmentReader(NAME, source)

    def code(first: int, stop: int) -> tuple[bytes, ...]:
        coder.restart()
        return (coder.build(coder.quantize(frames(first, stop))),)

    lengths = Lengths(min(length or SEGMENT_FRAMES, layout.most_frames), bool(length))
    for first, stop, streams in segments_by_halving(layout.n_frames, lengths, code):
        yield Segment(first, stop - first, streams)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Floats:
    """Return the values, (frames, channels of the groups); raise FormatError on bad bytes."""
    check(NAME, layout, spans, fresh=False)
    n_channels = layout.n_channels if request.groups else 0
    out = np.zeros((request.stop - request.start, n_channels))
    coder = _Coder(header, layout)
    if not n_channels:
        return out
    fresh = [i for i, span in enumerate(spans) if span.fresh and span.first <= request.start]
    for index in range(max(fresh, default=0), len(spans)):
        span = spans[index]
        if span.first >= request.stop:
            break
        if span.fresh:  # FRAME-04
            coder.restart()
        elif not index or spans[index - 1].stop != span.first:
            raise FormatError(
                f"{NAME}: the segment before frame {span.first} is needed, but missing"
            )
        stop = min(span.stop, request.stop)
        block = coder.decode(fetch(index, 0, 0), span.n_frames, stop - span.first)
        begin = max(span.first, request.start)
        if begin < stop:
            out[begin - request.start : stop - request.start] = block[begin - span.first :]
    return out


def _header(header: bytes) -> FrameHeader:
    """The fields of FrameHeader; raises FormatError."""
    fields = parse(FrameHeader, header, f"{NAME} header")
    if fields.space.flags & (MEAN | COURSES):  # FRAME-05
        raise FormatError(
            f"{NAME}: flags {fields.space.flags:#x} announce a mean or courses, which it does "
            "not have"
        )
    return fields


def uses(header: bytes) -> tuple[bytes, ...]:
    """The models that a header names."""
    return uses_of(_header(header).space)


class _Coder:
    """Encoder and decoder state across frames.

    Raises FormatError for a bad header.
    """

    def __init__(
        self, header: bytes, layout: Layout, threshold: float = space_choices.THRESHOLD
    ) -> None:
        fields = _header(header)
        self.header, self.threshold = header, threshold
        self.space = space_of(NAME, fields.space, layout)
        self.codes = codes_from(fields.code, f"{NAME} header")
        self._analysis = np.zeros((0, 0))
        self.restart()

    def restart(self) -> None:
        """Forget all frames."""
        space = self.space
        self._models = start_states("frame")[0].copy()  # FRAME-07
        self._values = np.zeros(len(space.weights))
        self._lengths = np.zeros(len(space.starts) - 1, np.int64)
        self._tracks = np.zeros((space.n_rows, kernels.TRACK_SIZE), np.int64)
        self._begins = 1

    def decode(self, stream: bytes, n_frames: int, n_decoded: int) -> Floats:
        """The first ``n_decoded`` frames of a segment; raises FormatError on bad bytes."""
        indices = np.zeros((n_decoded, self.space.n_rows), np.int64)
        self._parse(stream, indices, whole=n_decoded == n_frames)  # FRAME-10
        out = np.empty((n_decoded, len(self._values)))
        kernels.add_frames(out, self._values, indices, self.space.transform())
        return out

    def quantize(self, frames: Floats) -> Ints:
        """The coefficients of a segment, (frames, n_rows); raises MotionError."""
        if not self._analysis.size:
            self._analysis = np.ascontiguousarray(np.concatenate(self.space.analysis()))
        indices = np.zeros((len(frames), self.space.n_rows), np.int64)
        fault = kernels.quantize_frames(
            indices,
            np.ascontiguousarray(frames),
            self._values,
            self.space.transform(),
            self._analysis,
            self.threshold,
        )
        if fault >= 0:
            raise MotionError(
                f"{NAME}: a coefficient of frame {fault} of a segment exceeds 2^40 quantizer steps "
                f"of {self.space.step:g}"
            )
        return indices

    def build(self, indices: Ints) -> bytes:
        """The stream of a segment's coefficients."""
        if self.codes is not None:
            return build_vectors(indices, self.space.starts, self.codes)
        before = self._lengths.copy(), self._tracks.copy()

        def loop(state: Ints, data: NDArray[np.uint8]) -> bool:
            self._lengths, self._tracks = before[0].copy(), before[1].copy()
            return self._code(state, data, indices)

        stream = encode_stream(self._models.copy(), indices.size + 256, loop, "a coefficient")
        self._begins = 0
        return stream

    def _parse(self, stream: bytes, indices: Ints, *, whole: bool) -> None:
        label = f"{NAME}: a coefficient"
        if self.codes is not None:
            # FRAME-06
            parse_vectors(stream, indices, self.space.starts, self.codes, label, whole=whole)
            return
        decode_stream(
            stream,
            self._models,  # FRAME-07
            lambda state, data: self._code(state, data, indices),
            label,
            whole=whole,
        )
        self._begins = 0

    def _code(self, state: Ints, data: NDArray[np.uint8], indices: Ints) -> bool:
        memory = self._lengths, self._tracks, self._begins
        fault = kernels.code_frames(state, data, indices, self.space.starts, *memory)
        self._models[:] = state
        return bool(fault < 0)


class _LiveEncoder(LiveEncoder):
    """Encodes a frame a push, as a segment that needs the previous one or is fresh."""

    version: int | None = None

    def __init__(self, layout: Layout, options: Params) -> None:
        chosen = preset_values(PRESETS, options)
        choice = space_choices.live_choice(NAME, layout, options["step"], options["basis"])
        if chosen["coder"] == "prefix":
            raise OptionError(f"{NAME}: coder=prefix needs all frames; use coder=mixed")
        fields = FrameHeader(space=choice.fields, code=NO_CODES)
        self.header = build(fields, f"{NAME} header")
        self.models = choice.models
        resolved = replace(layout, find_model=model_finder((*choice.models, *choice.known)))
        self._coder = _Coder(self.header, resolved, chosen["threshold"])
        self._every = options["segment_frames"] or SEGMENT_FRAMES
        self._at = 0
        self._rows = LiveRows(NAME, layout)

    def push(self, values: Floats, valid: Bools | None = None) -> tuple[bytes, bool]:
        row = self._rows.row(values, valid, self._at)
        fresh = self._at % self._every == 0
        if fresh:
            self._coder.restart()
        stream = self._coder.build(self._coder.quantize(row))
        self._rows.keep()
        self._at += 1
        return stream, fresh

    def change(self, options: Params) -> None:
        raise OptionError(f"{NAME}: {', '.join(options)} cannot change within a stream")


class _LiveDecoder:
    """The inverse of ``_LiveEncoder``."""

    def __init__(self, header: bytes, layout: Layout) -> None:
        self._coder = _Coder(header, layout)
        self._broken = True  # until a fresh frame comes

    def push(self, stream: bytes, fresh: bool) -> Floats:
        if fresh:
            self._coder.restart()
        elif self._broken:
            raise LostFrameError(f"{NAME}: a frame needs the previous frame, which did not arrive")
        self._broken = True
        values: Floats = self._coder.decode(stream, 1, 1)[0]
        self._broken = False
        return values

    def skip(self, n_frames: int) -> None:
        self._broken = self._broken or n_frames > 0


CODEC = Codec(
    id=19,
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
    parameters=(
        preset_parameter(PRESETS),
        space_choices.STEP,
        space_choices.THRESHOLD_PARAMETER,
        space_choices.BASIS,
        space_choices.CODER,
        space_choices.DOMAIN,
        space_choices.VIRTUAL_MARKERS,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
