"""Codec 20, ``lsdt-clip``, all presets: windows of frames, transformed in time and space.

SPEC.md, "Codec 20: lsdt-clip", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mcz.codecs.coding.prefix_codes import (
    NO_CODES,
    CodeFields,
    Codes,
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
    Model,
    Request,
    Segment,
    SignalSource,
    Span,
    model_finder,
)
from mcz.codecs.parameters import Dial
from mcz.codecs.segments import SEGMENT_FRAMES, TARGET_BYTES
from mcz.codecs.source_readers import FrameReader
from mcz.codecs.space import Space, SpaceFields, check, space_of, uses_of
from mcz.codecs.spatial import kernels
from mcz.codecs.spatial.kernels import synthesize, synthesize_courses
from mcz.codecs.transforms.bases import dct_matrix
from mcz.errors import FormatError, MotionError
from mcz.model.schema import (
    UVARINT,
    CheckedInRecord,
    Record,
    bounded,
    build,
    field,
    parse,
    read_varint,
    varint,
)
from mcz.model.types import Floats, Ints

NAME = "lsdt-clip"
MAX_WINDOW = 2048  # WIND-05
MAX_PRODUCTS = 2**30  # of a model's courses with cosines


class WindowsHeader(Record):
    """Header of lsdt-clip."""

    window: int = field(bounded(UVARINT, 1, MAX_WINDOW), "frames, 1 to 2048")
    n_frequencies: int = field(
        CheckedInRecord(UVARINT, lambda n, fields: 1 <= n <= fields.window),
        "coefficients of a row, 1 to window",
    )  # WIND-06
    space: SpaceFields = field(SpaceFields, "how a frame becomes coefficients")
    code: CodeFields = field(CodeFields, "how coefficients become bits")


@dataclass(frozen=True, slots=True)
class Plan:
    """The choices of an encoder; ``space``: the header's field.

    A coefficient smaller than ``threshold`` steps becomes 0. ``segment_frames`` may be 0: as many
    windows as make a DATA of the usual size. ``prefix``: coded by prefix codes.
    """

    window: int
    n_frequencies: int
    space: SpaceFields
    models: tuple[Model, ...]
    known: tuple[Model, ...]
    threshold: float
    segment_frames: int
    prefix: bool = False


def temporal_of(space: Space, fields: WindowsHeader, n_frames: int) -> Floats:
    """Matrix from a row of coefficients to values over a window, (n_frequencies, n_frames).

    A shorter last window has cosines of its own length.
    """
    if space.courses is not None and n_frames == fields.window:  # WIND-14
        return space.courses
    return dct_matrix(n_frames)[: min(fields.n_frequencies, n_frames)]


def encode(name: str, source: SignalSource, plan: Plan) -> Encoded:
    """Encode the values of ``source``; raises MotionError for values that cannot be coded."""
    fields = WindowsHeader(
        window=plan.window, n_frequencies=plan.n_frequencies, space=plan.space, code=NO_CODES
    )
    quantizer = _Quantizer(name, source, plan, build(fields, f"{name} header"))
    if plan.prefix and source.layout.n_channels:  # the codes are common to all windows
        fields.code = fields_of(quantizer.windows())
    header = build(fields, f"{name} header")
    codes = codes_from(parse(WindowsHeader, header, name).code, name)
    segments = _segments(source.layout, quantizer.windows(), plan, quantizer.space.starts, codes)
    return Encoded(header, segments, models=plan.models, known_models=plan.known)


class _Quantizer:
    def __init__(self, name: str, source: SignalSource, plan: Plan, header: bytes) -> None:
        layout = source.layout
        layout = replace(layout, find_model=model_finder((*plan.models, *plan.known)))
        self.name, self.source, self.threshold = name, source, plan.threshold
        self.fields = parse(WindowsHeader, header, f"{name} header")
        self.space = space_of_windows(self.fields, layout)
        self.analysis = self.space.analysis()
        self.from_courses: Floats | None = None
        if self.space.courses is not None:
            self.from_courses = np.asarray(np.linalg.pinv(self.space.courses.T), np.float64)

    def windows(self) -> Iterator[Ints]:
        """Coefficients of each window, (n_rows, n_frequencies)."""
        reader = FrameReader(self.name, self.source)
        n_frames = self.source.layout.n_frames
        for start in range(0, n_frames, self.fields.window):
            yield self._indices(reader.next(min(start + self.fields.window, n_frames)))

    def _indices(self, values: Floats) -> Ints:
        """Quantize; raises MotionError for too large a coefficient."""
        space = self.space
        with np.errstate(all="ignore"):
            scaled = (values - space.mean) / space.weights / space.step
            in_time = (self._to_time(values) @ scaled).T
            pairs = zip(self.analysis, space.columns, strict=True)
            rows = np.concatenate([part @ in_time[columns] for part, columns in pairs])
            sizes = np.abs(rows)
            indices = np.floor(sizes + 0.5)
            indices[sizes < self.threshold] = 0
        if not (indices <= MAX_INDEX).all():  # NaN too
            raise MotionError(
                f"{self.name}: a coefficient exceeds 2^40 quantizer steps of {space.step:g}"
            )
        signed: Floats = np.where(rows < 0, -indices, indices)
        return signed.astype(np.int64)

    def _to_time(self, values: Floats) -> Floats:
        """Matrix from the frames of a window to coefficients in time, (n_frequencies, n_frames)."""
        if self.from_courses is not None and len(values) == self.fields.window:
            return self.from_courses
        return temporal_of(self.space, self.fields, len(values))


def _segments(
    layout: Layout, windows: Iterator[Ints], plan: Plan, starts: Ints, codes: Codes | None
) -> Iterator[Segment]:
    if not layout.n_channels:
        if layout.n_frames:
            yield Segment(0, layout.n_frames, ())
        return
    limit = min(plan.segment_frames or max(SEGMENT_FRAMES, plan.window), layout.most_frames)
    first, size = 0, 0
    parts: list[bytes] = []
    for start, rows in zip(range(0, layout.n_frames, plan.window), windows, strict=True):
        part = build_window(rows, starts, codes)
        stop = min(start + plan.window, layout.n_frames)
        full = stop - first > limit or (not plan.segment_frames and size + len(part) > TARGET_BYTES)
        if parts and full:
            yield Segment(first, start - first, (b"".join(parts),))
            first, parts, size = start, [], 0
        parts.append(part)
        size += len(part)
    if parts:
        yield Segment(first, layout.n_frames - first, (b"".join(parts),))


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Floats:
    """Return the values, (frames, channels of the groups); raise FormatError on bad bytes."""
    fields = parse(WindowsHeader, header, f"{NAME} header")
    check(NAME, layout, spans, fresh=True)
    n_channels = layout.n_channels if request.groups else 0
    out = np.zeros((request.stop - request.start, n_channels))
    space = space_of_windows(fields, layout)
    codes = codes_from(fields.code, f"{NAME} header")
    if not n_channels:
        return out
    for index, span in enumerate(spans):
        if span.first < request.stop and request.start < span.stop:
            _segment(space, fields, codes, span, fetch(index, 0, 0), request, out)
    return out


def uses(header: bytes) -> tuple[bytes, ...]:
    """The models that a header names."""
    return uses_of(parse(WindowsHeader, header, f"{NAME} header").space)


def space_of_windows(fields: WindowsHeader, layout: Layout) -> Space:
    """Space of a header, with courses over a whole window."""
    space = space_of(NAME, fields.space, layout)
    if space.courses is None:
        return space
    count, n_cosines = space.courses.shape
    if count != fields.n_frequencies or n_cosines > fields.window:  # WIND-16
        raise FormatError(
            f"{NAME}: {count} courses of {n_cosines} cosines do not fit "
            f"{fields.n_frequencies} coefficients and {fields.window} frames"
        )
    if count * n_cosines * fields.window > MAX_PRODUCTS:  # WIND-17
        raise FormatError(f"{NAME}: {count} courses of {fields.window} frames are too many")
    courses = np.zeros((count, fields.window))
    synthesize_courses(courses, space.courses, dct_matrix(fields.window))
    return replace(space, courses=courses)


def _segment(
    space: Space,
    fields: WindowsHeader,
    codes: Codes | None,
    span: Span,
    stream: bytes,
    request: Request,
    out: Floats,
) -> None:
    """Fill the requested frames of one segment into ``out``, window by window."""
    n_windows = -(-span.n_frames // fields.window)
    where = f"{NAME}: segment at {span.first}"
    for number, part in enumerate(windows_of(stream, n_windows, where)):
        start = span.first + number * fields.window
        stop = min(start + fields.window, span.stop)
        a, b = max(start, request.start), min(stop, request.stop)
        if start >= request.stop:
            break
        if a >= b:
            continue
        temporal = temporal_of(space, fields, stop - start)
        window = parse_window(part, space.starts, len(temporal), codes, where)
        whole = (a, b) == (start, stop)
        block = (
            out[a - request.start : b - request.start]
            if whole
            else np.empty((stop - start, out.shape[1]))
        )
        synthesize(block, window.rows, window.lengths, temporal, space.transform(), space.mean)
        if not whole:
            out[a - request.start : b - request.start] = block[a - start : b - start]


BITSTREAM = partial(
    Codec,
    id=20,
    version=0,
    domain="values",
    lossless=False,
    decode=decode,
    grouping="all",
    positions=True,
    uses=uses,
    dial=Dial("step", 2.0**-60, 2.0**60),
)


MAX_INDEX = 2**40


@dataclass(frozen=True, slots=True)
class Window:
    """Coefficients of a window, (n_rows, n_frequencies), and the used length of each row."""

    rows: Ints
    lengths: Ints


def build_window(rows: Ints, starts: Ints, codes: Codes | None) -> bytes:
    """The bytes of a window's coefficients, (n_rows, n_frequencies), none beyond MAX_INDEX."""
    coded = _adaptive(rows, starts) if codes is None else build_vectors(rows, _starts(rows), codes)
    return varint(len(coded)) + coded


def _starts(rows: Ints) -> Ints:
    return np.array([0, rows.shape[1]])


def _adaptive(rows: Ints, starts: Ints) -> bytes:
    lengths = np.zeros(len(rows), np.int64)
    return encode_stream(
        start_states("window")[0],
        rows.size + 256,
        lambda state, data: kernels.code_window(state, data, rows, starts, lengths) < 0,
        "a coefficient",
    )


def parse_window(
    data: bytes, starts: Ints, n_frequencies: int, codes: Codes | None, where: str
) -> Window:
    """The coefficients of a window; raises FormatError on bad bytes."""
    rows = np.zeros((int(starts[-1]), n_frequencies), np.int64)
    lengths = np.zeros(len(rows), np.int64)
    if codes is not None:
        # WIND-09
        parse_vectors(data, rows, _starts(rows), codes, f"{where}: a coefficient", whole=True)
        lengths = n_frequencies - np.argmax(rows[:, ::-1] != 0, axis=1)
        lengths[~rows.any(axis=1)] = 0
    else:
        decode_stream(
            data,
            start_states("window")[0],  # WIND-10
            # WIND-10
            lambda state, data: kernels.code_window(state, data, rows, starts, lengths) < 0,
            f"{where}: a coefficient",
            whole=True,  # WIND-08
        )
    return Window(rows, lengths)


def windows_of(stream: bytes, n_windows: int, where: str) -> Iterator[bytes]:
    """The bytes of each window; raises FormatError on bad bytes."""
    at = 0
    for _ in range(n_windows):
        size, at = read_varint(stream, at)
        if size > len(stream) - at:  # WIND-07
            raise FormatError(
                (f"a window of {size} bytes at {at} exceeds the {len(stream)} bytes of the stream"),
                where=where,
            )
        yield stream[at : at + size]
        at += size
    if at != len(stream):  # WIND-07
        raise FormatError(f"{len(stream) - at} bytes after the last window", where=where)
