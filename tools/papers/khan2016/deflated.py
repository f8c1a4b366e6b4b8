"""Size by the published entropy coding: the same integers, run lengths, plain deflate."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from mcz.bench.cases import Case, Variant, load
from mcz.codecs import codec_by_name
from mcz.codecs.transforms.wavelets import by_id, own_range
from mcz.codecs.wavelet import wavelet as wavelet_codec
from mcz.codecs.wavelet.streams import Coding, parse_streams
from mcz.files.writing.signal_source import MemorySource
from mcz.model.schema import parse, varint

LEAST_RUN = 6  # zeros; shorter runs are written one by one, as published
SEGMENT_BYTES = 2**40


def deflated_bytes(case: Case, variant: Variant, T_g: float) -> int:
    """Bytes of one deflated blob of all coefficients of a wavelet codec, and nothing else.

    Approximations as first differences, details with their runs of zeros, zigzag varints.
    """
    codec = codec_by_name(variant.codec)
    source = MemorySource(load(case).motion, 0, codec, SEGMENT_BYTES)
    encoded = codec.encode(source, codec.options(variant.options({"T_g": T_g})))
    (segment,) = encoded.segments
    fields = parse(wavelet_codec.WaveletHeader, encoded.header, "header")
    wavelet, levels = by_id(fields.wavelet), fields.levels
    lengths = wavelet.lengths(fields.coded_frames, levels)
    owns = [own_range(0, segment.n_frames, n, lengths) for n in (levels, *range(levels, 0, -1))]
    counts = [stop - start for start, stop in owns]
    coding = Coding(codec.name, False, fields.least, (wavelet.n_taps - 2) // 2)
    n_groups = len(source.layout.groups)
    out = []
    for group in range(n_groups):
        streams = segment.streams[group::n_groups]
        bands, _ = parse_streams(streams.__getitem__, counts, counts, coding)
        out.append(_numbers(np.diff(bands[0], prepend=0)))
        out.append(_numbers(np.concatenate([bands[0][:0], *bands[1:]])))
    return len(zlib.compress(b"".join(out), 9))


def _numbers(values: NDArray[np.int64]) -> bytes:
    """Zigzag varints; a run of ``LEAST_RUN`` zeros or more is a 0, then its length."""
    out, at, n = [], 0, len(values)
    changes = np.append(np.flatnonzero(values), n)
    while at < n:
        following = int(changes[np.searchsorted(changes, at)])
        if following - at >= LEAST_RUN:
            out.append(varint(0) + varint(following - at))
            at = following
            continue
        value = int(values[at])
        out.append(varint(2 * value if value >= 0 else -2 * value - 1))
        at += 1
    return b"".join(out)
