"""Codec 16, ``wavelet``: header, segments, and the decoder of all its presets.

SPEC.md, "Codec 16: wavelet", is normative; names are its field names. A preset defines how its
encoder chooses a ``Plan``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from construct import Float64l, If, Int8ul, this

from mcz.codecs.contract import Codec, Encoded, Fetch, Layout, Request, Segment, SignalSource, Span
from mcz.codecs.parameters import (
    MAX_DECIMALS,
    SCALED,
    Parameter,
    decimals_parameter,
    integer,
    ratio_of,
)
from mcz.codecs.segments import SEGMENT_FRAMES, Lengths, segments_by_halving
from mcz.codecs.source_readers import FrameReader
from mcz.codecs.transforms import wavelets
from mcz.codecs.transforms.wavelets import INLINE, MAX_LEVELS, MAX_TAPS, Wavelet, by_id, by_name
from mcz.codecs.wavelet.streams import Coding, Quantizer, build_streams, parse_streams
from mcz.errors import FormatError
from mcz.model.schema import UVARINT, Checked, Record, bounded, build, counted, field, parse
from mcz.model.types import Bools, Floats, Ints

NAME = "wavelet"
LEAST_FRAMES = 256  # of a segment; a shorter one of hundreds of channels is mostly overhead
INWARD = 1 / 16  # of a step: distance that a scaled detail is set back towards zero (MRDWT-34)

TAPS = counted(Float64l, MAX_TAPS)  # MRDWT-06


class WaveletHeader(Record):
    """Header of wavelet."""

    wavelet: int = field(Int8ul, "id of the registered wavelet; 0: its filters follow")
    lo: list[float] | None = field(
        If(this.wavelet == INLINE, TAPS), "synthesis filter of approximations"
    )
    hi: list[float] | None = field(If(this.wavelet == INLINE, TAPS), "synthesis filter of details")
    levels: int = field(bounded(Int8ul, 0, MAX_LEVELS), "levels, 0 to 16")  # MRDWT-08
    coded_frames: int = field(UVARINT, "frames of the signal that was transformed, from frame 0 on")
    decimals: int = field(
        Checked(Int8ul, lambda value: value <= MAX_DECIMALS or value == SCALED),
        "decimals of a coefficient, 0 to 15; 255: it is scaled",
    )  # MRDWT-09
    unit: float | None = field(
        If(this.decimals == SCALED, bounded(Float64l, 2.0**-100, 2.0**100)),
        "factor of step codes, 2^-100 to 2^100, only if decimals is 255",
    )  # MRDWT-10
    least: int = field(
        bounded(UVARINT, 1, 2**39), "least magnitude of a detail that is not zero, 1 to 2^39"
    )  # MRDWT-11


Q = decimals_parameter("decimals of coefficients; default: steps follow the thresholds")
N = Parameter("N", None, "levels; default 4", integer("N", 0, MAX_LEVELS))
WAVELET = Parameter("wavelet", None, "name as in PyWavelets; default bior4.4", str)


@dataclass(frozen=True, slots=True)
class Transform:
    """A wavelet, and the levels of a clip."""

    wavelet_id: int
    wavelet: Wavelet
    levels: int


@dataclass(frozen=True, slots=True)
class Plan:
    """Encoder decisions before the first segment.

    ``kept``: for each band of the clip, the coarsest first, a mask (coefficients, channels) of
    those that do not become 0; None: the quantizer decides.
    """

    name: str
    transform: Transform
    quantizer: Quantizer
    segment_frames: int  # 0: the size decides
    kept: Sequence[Bools] | None = None

    @property
    def wavelet(self) -> Wavelet:
        return self.transform.wavelet

    @property
    def levels(self) -> int:
        return self.transform.levels

    @property
    def coding(self) -> Coding:
        scaled = self.quantizer.decimals is None
        return Coding(self.name, scaled, self.quantizer.least, (self.wavelet.n_taps - 2) // 2)


def transform_of(
    layout: Layout, wavelet: str, levels: int, *, as_published: bool = False
) -> Transform:
    """The transform with ``levels``, or with fewer if the clip is too short.

    ``as_published``: always with ``levels``.
    """
    wavelet_id, taps = by_name(wavelet)
    levels = levels if layout.n_frames else 0
    while levels and not as_published and layout.n_frames < (taps.n_taps - 1) << levels:
        levels -= 1
    return Transform(wavelet_id, taps, levels)


def encode(source: SignalSource, plan: Plan) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite.
    """
    inline = plan.transform.wavelet_id == INLINE
    decimals = plan.quantizer.decimals
    fields = WaveletHeader(
        wavelet=plan.transform.wavelet_id,
        lo=list(plan.wavelet.lo) if inline else None,
        hi=list(plan.wavelet.hi) if inline else None,
        levels=plan.levels,
        coded_frames=source.layout.n_frames,
        decimals=SCALED if decimals is None else decimals,
        unit=plan.quantizer.unit if decimals is None else None,
        least=plan.quantizer.least,
    )
    header = build(fields, f"{plan.name} header")
    return Encoded(header, _segments(source, plan), plan.levels + 1)


def _segments(source: SignalSource, plan: Plan) -> Iterator[Segment]:
    n_frames = source.layout.n_frames
    frames = Frames(plan.name, source, plan.wavelet, plan.levels)
    code = partial(segment_streams, frames, plan)
    for first, stop, streams in segments_by_halving(n_frames, _lengths(source.layout, plan), code):
        frames.keep(first, stop)
        lead = min(first, plan.wavelet.lead(plan.levels))
        yield Segment(first, stop - first, streams, lead)


def _lengths(layout: Layout, plan: Plan) -> Lengths:
    unit = 1 << plan.levels
    n_frames = min(plan.segment_frames or SEGMENT_FRAMES, layout.most_frames)
    length = max(unit, -(-n_frames // unit) * unit)
    if plan.segment_frames >= layout.n_frames:
        length = max(length, layout.n_frames)
    return Lengths(length, bool(plan.segment_frames), unit, LEAST_FRAMES)


def segment_streams(frames: Frames, plan: Plan, first: int, stop: int) -> tuple[bytes, ...]:
    """The streams of a segment, by resolution, then by channel."""
    bands = frames.coefficients(first, stop)
    if plan.kept is not None:
        levels = [plan.levels, *range(plan.levels, 0, -1)]
        ranges = [wavelets.own_range(first, stop, level, frames.lengths) for level in levels]
        bands = [
            np.where(kept[start:end], band, 0.0)
            for kept, (start, end), band in zip(plan.kept, ranges, bands, strict=True)
        ]
    by_channel = []
    for channel in range(bands[0].shape[1]):
        indices = [
            plan.quantizer.indices(band[:, channel], channel, detail=number > 0)
            for number, band in enumerate(bands)
        ]
        step = plan.quantizer.codes[channel]
        by_channel.append(build_streams(indices, step, plan.coding))
    return tuple(streams[band] for band in range(len(bands)) for streams in by_channel)


def decode(
    header: bytes, layout: Layout, spans: Sequence[Span], request: Request, fetch: Fetch
) -> Floats:
    """Return the values, (frames, channels of the groups); raise FormatError on bad bytes."""
    decoder = _Decoder(header, layout, spans)
    n_columns = sum(len(layout.groups[group]) for group in request.groups)
    if request.start == request.stop or not n_columns:
        return np.zeros((request.stop - request.start, n_columns))
    return decoder.read(request, fetch)


class _Decoder:
    """A checked header and the segments of a signal."""

    def __init__(self, header: bytes, layout: Layout, spans: Sequence[Span]) -> None:
        fields = parse(WaveletHeader, header, f"{NAME} header")  # CODEC-05
        self.fields, self.layout, self.spans = fields, layout, spans
        if layout.samples_per_frame != 1:  # MRDWT-02
            raise FormatError(
                f"{NAME}: the codec has 1 sample a frame, not {layout.samples_per_frame}"
            )
        if layout.n_resolutions > fields.levels + 1:  # CUT-04, MRDWT-03
            raise FormatError(
                f"{NAME}: {layout.n_resolutions} resolutions do not fit {fields.levels} levels"
            )
        if any(len(group) != 1 for group in layout.groups):  # MRDWT-01
            raise FormatError(f"{NAME}: a group has more than one channel")
        self.wavelet = (
            by_id(fields.wavelet)
            if fields.wavelet != INLINE
            else Wavelet(tuple(fields.lo or ()), tuple(fields.hi or ()))
        )
        scaled = fields.decimals == SCALED
        self.coding = Coding(NAME, scaled, fields.least, (self.wavelet.n_taps - 2) // 2)
        self.lengths = self.wavelet.lengths(fields.coded_frames, fields.levels)
        unit, end = 1 << fields.levels, spans[-1].stop if spans else 0
        lead = self.wavelet.lead(fields.levels)
        for span in spans:
            # MRDWT-15, MRDWT-16, MRDWT-17
            if (span.lead, span.tail, span.fresh) != (min(span.first, lead), 0, True):
                raise FormatError(
                    f"{NAME}: the segment at {span.first} has lead {span.lead} and tail "
                    f"{span.tail}, not {min(span.first, lead)} and 0, or is not fresh"
                )
        # MRDWT-05, MRDWT-12
        if any(span.first % unit for span in spans) or end > fields.coded_frames:
            raise FormatError(
                f"{NAME}: segments up to frame {end} of {fields.coded_frames} do not fit "
                f"coefficients of {unit} frames"
            )
        if end < fields.coded_frames and end % unit:  # MRDWT-13
            raise FormatError(f"{NAME}: the segments end at frame {end}, within a coefficient")

    def read(self, request: Request, fetch: Fetch) -> Floats:
        levels = self.fields.levels
        n_bands = self.layout.n_resolutions - request.resolution  # MRDWT-04
        ranges = wavelets.needed_ranges(request.start, request.stop, levels, self.wavelet.n_taps)
        # Band 0 is the approximation, band b > 0 the details of level levels + 1 - b.
        band_ranges = [ranges[levels], *(ranges[levels + 1 - band] for band in range(1, n_bands))]
        bands = [np.zeros((stop - start, len(request.groups))) for start, stop in band_ranges]
        end = band_ranges[0][0]
        # Frames of the requested coefficients; the last segment has those beyond the end too.
        levels_of_bands = [self._level(band) for band in range(n_bands)]
        low = min(
            needed[0] << level for needed, level in zip(band_ranges, levels_of_bands, strict=True)
        )
        high = max(
            needed[1] << level for needed, level in zip(band_ranges, levels_of_bands, strict=True)
        )
        for index, span in enumerate(self.spans):
            if span.first >= high or (span.stop <= low and span.stop != self.lengths[0]):
                continue
            stored = [
                wavelets.own_range(span.first, span.stop, self._level(band), self.lengths)
                for band in range(n_bands)
            ]
            pairs = zip(stored, band_ranges, strict=True)
            if all(
                stored_range[1] <= needed[0] or needed[1] <= stored_range[0]
                for stored_range, needed in pairs
            ):
                continue
            if stored[0][0] > end:
                break
            end = stored[0][1]
            for column, group in enumerate(request.groups):
                self._fill(bands, column, stored, band_ranges, partial(fetch, index), group)
        if end < band_ranges[0][1]:  # MRDWT-18
            raise FormatError(
                f"{NAME}: frames {request.start}:{request.stop} need approximations up to "
                f"{band_ranges[0][1]}, but they end at {end}"
            )
        absent = np.zeros((0, len(request.groups)))
        bands += [absent] * (levels + 1 - n_bands)
        firsts = [start for start, _ in ranges[1:]]
        return wavelets.synthesize(
            bands, firsts, request.start, request.stop, self.wavelet
        )  # MRDWT-35

    def _level(self, band: int) -> int:
        return int(self.fields.levels + 1 - band if band else self.fields.levels)

    def _fill(
        self,
        bands: list[Floats],
        column: int,
        stored: list[tuple[int, int]],
        band_ranges: list[tuple[int, int]],
        fetch: Callable[[int, int], bytes],
        group: int,
    ) -> None:
        counts = [stop - start for start, stop in stored]
        prefix = [
            min(max(needed[1] - stored_range[0], 0), stored_range[1] - stored_range[0])
            for stored_range, needed in zip(stored, band_ranges, strict=True)
        ]
        indices, code = parse_streams(lambda band: fetch(band, group), counts, prefix, self.coding)
        for band, (stored_range, needed, source) in enumerate(
            zip(stored, band_ranges, indices, strict=True)
        ):
            start = max(stored_range[0], needed[0])
            values = self._values(source[start - stored_range[0] :], code, detail=band > 0)
            bands[band][start - needed[0] : start - needed[0] + len(values), column] = values

    def _values(self, indices: Ints, code: int, *, detail: bool) -> Floats:
        values = indices.astype(np.float64)
        if not self.coding.scaled:
            return np.asarray(values / 10.0**self.fields.decimals)  # MRDWT-32
        if detail:
            values = np.where(indices == 0, 0.0, values - np.copysign(INWARD, values))
        return np.asarray(values * ((self.fields.unit or 1.0) * ratio_of(code)))  # MRDWT-33


def cut(header: bytes, layout: Layout, first: int, stop: int, groups: Sequence[int]) -> bytes:
    """The header for stored frames first <= f < stop."""
    fields = parse(WaveletHeader, header, f"{NAME} header")
    fields.coded_frames -= first
    return build(fields, f"{NAME} header")


BITSTREAM = partial(
    Codec,
    id=16,
    version=0,
    domain="values",
    lossless=False,
    decode=decode,
    cut=cut,
    grouping="channel",
)


class Frames:
    """The signal for the transform, unwrapped and interpolated, a window at a time."""

    def __init__(self, name: str, source: SignalSource, wavelet: Wavelet, levels: int) -> None:
        self.reader, self.wavelet, self.levels = FrameReader(name, source), wavelet, levels
        layout = source.layout
        self.history = np.zeros((0, layout.n_channels))  # frames before the segment
        self.block = np.zeros((0, layout.n_channels))  # from the segment's first frame on
        self.lengths = wavelet.lengths(layout.n_frames, levels)

    def coefficients(self, first: int, stop: int) -> list[Floats]:
        """The bands of the segment first <= frame < stop, the coarsest first."""
        unit, mirrored = 1 << self.levels, self.wavelet.mirrored(self.levels)
        end = min(max(stop, -(-mirrored // unit) * unit), self.lengths[0])
        if end > self.reader.at:
            self.block = np.concatenate([self.block, self.reader.next(end)])
        window = np.concatenate([self.history, self.block[: end - first]])
        at = first - len(self.history)
        return wavelets.analyze(window, at, first, stop, self.lengths, self.wavelet)

    def keep(self, first: int, stop: int) -> None:
        """Advance to the segment that begins at ``stop``."""
        unit = 1 << self.levels
        n_kept = -(-self.wavelet.lead(self.levels) // unit) * unit
        frames = np.concatenate([self.history, self.block[: stop - first]])
        self.history = frames[max(0, len(frames) - n_kept) :]
        self.block = self.block[stop - first :]
