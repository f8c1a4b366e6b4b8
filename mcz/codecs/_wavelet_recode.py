"""Some channels of a clip of wavelets coded anew, under the header that the others have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.codecs._lossy import SCALED
from mcz.codecs._parts import Part
from mcz.codecs._wavelet_codec import WAVELET_HEADER, Plan, Transform, segment_streams
from mcz.codecs._wavelet_frames import Frames
from mcz.codecs._wavelet_quantizer import DEAD_ZONE, Quantizer, code_of
from mcz.codecs.base import Fetch, SignalSource, Span
from mcz.schema import parse
from mcz.transforms.wavelets import INLINE, Wavelet, by_id

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Held(Quantizer):
    """A quantizer whose least magnitude of a detail is that of the header."""

    held: int = 1

    @property
    def least(self) -> int:
        return self.held

    def indices(self, coefficients: Floats, channel: int, *, detail: bool) -> NDArray[np.int64]:
        found = Quantizer.indices(self, coefficients, channel, detail=detail)
        return np.where(np.abs(found) < self.held, 0, found) if detail else found


def recode(
    name: str,
    weights: Floats,
    threshold: float | None,
    header: bytes,
    source: SignalSource,
    groups: tuple[int, ...],
    spans: Sequence[Span],
    fetch: Fetch,
) -> Iterator[tuple[bytes, ...]]:
    """The streams of some channels with new values.

    Where steps follow the thresholds each channel keeps its step. Otherwise ``threshold`` times the
    ``weights`` (n_channels,) of the signal are the thresholds; None: as large as the header says
    that the least is.
    """
    fields = parse(WAVELET_HEADER, header, f"{name} header")
    wavelet = (
        by_id(fields.wavelet)
        if fields.wavelet != INLINE
        else Wavelet(tuple(fields.lo), tuple(fields.hi))
    )
    columns = [column for group in groups for column in source.layout.groups[group]]
    own = weights[columns]
    if fields.decimals == SCALED:
        codes = tuple(
            _step_code(group, spans, fetch, code_of(float(weight)))
            for group, weight in zip(groups, own, strict=True)
        )
        quantizer = _Held(DEAD_ZONE * fields.unit * own, None, fields.unit, codes, fields.least)
    else:
        if threshold is None:
            lowest = float(weights.min()) if weights.any() else 1.0
            threshold = fields.least / 10.0**fields.decimals / lowest
        quantizer = _Held(threshold * own, fields.decimals, 1.0, (0,) * len(own), fields.least)
    plan = Plan(name, Transform(fields.wavelet, wavelet, fields.levels), quantizer, 0)
    frames = Frames(name, Part(source, groups, fields.coded_frames), wavelet, fields.levels)
    for span in spans:
        streams = segment_streams(frames, plan, span.first, span.stop)
        frames.keep(span.first, span.stop)
        yield streams[: source.layout.n_resolutions * len(groups)]


def _step_code(group: int, spans: Sequence[Span], fetch: Fetch, default: int) -> int:
    """The step code that a channel has had, ``default`` where it was 0 all along."""
    for segment in range(len(spans)):
        stream = fetch(segment, 0, group)
        if len(stream) > 1:
            return stream[1]
    return default
