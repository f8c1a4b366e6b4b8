"""Codec 5, ``dwt``: a wavelet transform in time, one threshold for all channels.

SPEC.md, "Codec 5: dwt", is normative; ``_wavelet_codec.py`` has what a decoder needs, this file
what an encoder chooses.
Source: M. A. Khan, An efficient algorithm for compression of motion capture signal using
multidimensional quadratic Bezier curve break-and-fit method, 2014, section 5; the preset
``khan2014`` follows the published implementation, the defaults improve upon it.

Exactness: lossy; decoding is bit-exact, as that of codec 2. A stream holds one channel at one
resolution of one segment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs import _wavelet_codec, _wavelet_recode
from mcz.codecs._lossy import (
    SEGMENT_FRAMES_PARAMETER,
    chosen_of,
    preset_parameter,
    segment_frames_of,
    skeleton_of,
)
from mcz.codecs._wavelet_codec import (
    WAVELET,
    N,
    Plan,
    Q,
    transform_of,
)
from mcz.codecs._wavelet_quantizer import make_quantizer, weights_of
from mcz.codecs.base import (
    Codec,
    Dial,
    Encoded,
    Fetch,
    Layout,
    Parameter,
    SignalSource,
    Span,
    number,
)

Floats = NDArray[np.float64]

PRESETS: dict[str, dict[str, Any]] = {
    # As published: t_w in the units of the source for positions too, the whole clip at once, and
    # the levels that were asked for however short it is.
    "khan2014": {"t_w": 3.0, "Q": 2, "N": 4, "wavelet": "db2"},
    "default": {"t_w": 0.2, "Q": None, "N": 4, "wavelet": "bior4.4"},
}


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the values of ``source``, rotations unwrapped; what is invalid is filled.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    layout, published = source.layout, params["preset"] == "khan2014"
    chosen = chosen_of(PRESETS, params)
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    weights = _weights(layout, unit_aware=not published)
    quantizer = make_quantizer(weights, chosen["t_w"], chosen["Q"], "t_w")
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    return _wavelet_codec.encode(source, Plan("dwt", transform, quantizer, frames))


def _weights(layout: Layout, *, unit_aware: bool) -> Floats:
    """The threshold of each channel at t_w = 1, (n_channels,), in source units."""
    no_sample = np.zeros((0, layout.n_channels))
    return weights_of(skeleton_of("dwt", layout), no_sample, "flat", unit_aware=unit_aware)


def recode(
    header: bytes,
    source: SignalSource,
    groups: tuple[int, ...],
    spans: Sequence[Span],
    options: Mapping[str, Any],
    fetch: Fetch,
) -> Iterator[tuple[bytes, ...]]:
    """The streams of some channels with new values, with the steps of the header."""
    weights = _weights(source.layout, unit_aware=options["preset"] != "khan2014")
    return _wavelet_recode.recode(
        "dwt", weights, options["t_w"], header, source, groups, spans, fetch
    )


CODEC = Codec(
    id=5,
    name="dwt",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=partial(_wavelet_codec.decode, "dwt"),
    cut=partial(_wavelet_codec.cut, "dwt"),
    recode=recode,
    grouping="channel",
    dial=Dial("t_w", 2.0**-20, 2.0**20),
    parameters=(
        preset_parameter(PRESETS),
        Parameter("t_w", None, "threshold in degrees; default 0.2", number("t_w", 0, 2.0**20)),
        Q,
        N,
        WAVELET,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
