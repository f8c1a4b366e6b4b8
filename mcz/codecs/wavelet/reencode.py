"""Re-encode some channels of a wavelet clip under its existing header."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mcz.codecs.contract import Recode, RecodeRequest, SignalSource
from mcz.codecs.parameters import code_of
from mcz.codecs.source_readers import SubsetSource
from mcz.codecs.transforms.wavelets import INLINE, Wavelet, by_id
from mcz.codecs.wavelet.streams import DEAD_ZONE, Quantizer
from mcz.codecs.wavelet.wavelet import NAME, Frames, Plan, Transform, WaveletHeader, segment_streams
from mcz.model.schema import parse
from mcz.model.types import Floats, Ints, Params


@dataclass(frozen=True, slots=True)
class _FixedQuantizer(Quantizer):
    """A quantizer with the header's least magnitude of details."""

    fixed_least: int = 1

    @property
    def least(self) -> int:
        return self.fixed_least

    def indices(self, coefficients: Floats, channel: int, *, detail: bool) -> Ints:
        indices = Quantizer.indices(self, coefficients, channel, detail=detail)
        return np.where(np.abs(indices) < self.fixed_least, 0, indices) if detail else indices


# (source, options) -> the weights (n_channels,) of the signal, which times a threshold are the
# thresholds of its channels, and that threshold; None: as large as the header says the least is.
Weigh = Callable[[SignalSource, Params], tuple[Floats, float | None]]


def recoder(weigh: Weigh) -> Recode:
    """The ``recode`` of a preset; if steps follow the thresholds each channel keeps its own.

    Otherwise the ``weigh`` of its encoder decides which coefficients are small.
    """

    def recode(request: RecodeRequest) -> Iterator[tuple[bytes, ...]]:
        """The streams of some channels with new values, with the steps of the header."""
        fields = parse(WaveletHeader, request.header, f"{NAME} header")
        quantizer = _quantizer(fields, request, *weigh(request.source, request.options))
        plan = Plan(NAME, _transform(fields), quantizer, 0)
        part = SubsetSource(request.source, request.groups, fields.coded_frames)
        frames = Frames(NAME, part, plan.wavelet, plan.levels)
        for span in request.spans:
            streams = segment_streams(frames, plan, span.first, span.stop)
            frames.keep(span.first, span.stop)
            yield streams[: request.source.layout.n_resolutions * len(request.groups)]

    return recode


def _transform(fields: WaveletHeader) -> Transform:
    wavelet = (
        by_id(fields.wavelet)
        if fields.wavelet != INLINE
        else Wavelet(tuple(fields.lo or ()), tuple(fields.hi or ()))
    )
    return Transform(fields.wavelet, wavelet, fields.levels)


def _quantizer(
    fields: WaveletHeader, request: RecodeRequest, weights: Floats, threshold: float | None
) -> Quantizer:
    columns = [column for group in request.groups for column in request.source.layout.groups[group]]
    own = weights[columns]
    if fields.unit is not None:  # decimals are SCALED
        unit = fields.unit
        codes = tuple(
            _step_code(group, request, code_of(float(weight)))
            for group, weight in zip(request.groups, own, strict=True)
        )
        return _FixedQuantizer(DEAD_ZONE * unit * own, None, unit, codes, fields.least)
    if threshold is None:
        lowest = float(weights.min()) if weights.any() else 1.0
        threshold = fields.least / 10.0**fields.decimals / lowest
    return _FixedQuantizer(threshold * own, fields.decimals, 1.0, (0,) * len(own), fields.least)


def _step_code(group: int, request: RecodeRequest, default: int) -> int:
    """The step code of a channel, ``default`` if it was always 0."""
    for segment in range(len(request.spans)):
        stream = request.fetch(segment, 0, group)
        if len(stream) > 1:
            return stream[1]
    return default
