"""Codec 2, ``mrdwt``: a multiresolution wavelet transform in time, thresholds by joint.

SPEC.md, "Codec 2: mrdwt", is normative; ``_wavelet_codec.py`` has what a decoder needs, this file
what an encoder chooses.
Source: M. A. Khan, Multiresolution coding of motion capture data for real-time multimedia
applications, 2016; the preset ``khan2016`` follows the published implementation exactly, the
defaults improve upon it.

Exactness: lossy; decoding is bit-exact (integers, then binary64 products and sums in the order
that SPEC.md states). A stream holds one channel at one resolution of one segment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

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
from mcz.codecs._wavelet_frames import sample
from mcz.codecs._wavelet_quantizer import RULES, SAMPLED_FRAMES, make_quantizer, weights_of
from mcz.codecs.base import (
    Codec,
    Dial,
    Encoded,
    Fetch,
    Parameter,
    SignalSource,
    Span,
    choice,
    number,
)

PRESETS: dict[str, dict[str, Any]] = {
    # Exactly as published: T_g in the units of the source for positions too, the whole clip at
    # once, and the levels that were asked for however short it is.
    "khan2016": {"T_g": 12.0, "Q": 1, "N": 4, "wavelet": "db3", "threshold_rule": "depth"},
    "default": {
        "T_g": 0.2,
        "Q": None,
        "N": 4,
        "wavelet": "bior4.4",
        "threshold_rule": "sensitivity",
    },
}


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the values of ``source``, rotations unwrapped; what is invalid is filled.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    layout, preset = source.layout, params["preset"]
    skeleton = skeleton_of("mrdwt", layout)
    chosen, published = chosen_of(PRESETS, params), preset == "khan2016"
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    weights = weights_of(
        skeleton,
        sample(source, SAMPLED_FRAMES),
        chosen["threshold_rule"],
        unit_aware=not published,
    )
    quantizer = make_quantizer(weights, chosen["T_g"], chosen["Q"])
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    plan = Plan("mrdwt", transform, quantizer, frames)
    return _wavelet_codec.encode(source, plan)


def recode(
    header: bytes,
    source: SignalSource,
    groups: tuple[int, ...],
    spans: Sequence[Span],
    options: Mapping[str, Any],
    fetch: Fetch,
) -> Iterator[tuple[bytes, ...]]:
    """The streams of some channels with new values, with the steps of the header."""
    preset = PRESETS[options["preset"]]
    weights = weights_of(
        skeleton_of("mrdwt", source.layout),
        sample(source, SAMPLED_FRAMES),
        options["threshold_rule"] or preset["threshold_rule"],
        unit_aware=options["preset"] != "khan2016",
    )
    T_g = options["T_g"]
    if T_g is None and options["preset"] == "khan2016":
        T_g = preset["T_g"]
    return _wavelet_recode.recode("mrdwt", weights, T_g, header, source, groups, spans, fetch)


CODEC = Codec(
    id=2,
    name="mrdwt",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=partial(_wavelet_codec.decode, "mrdwt"),
    cut=partial(_wavelet_codec.cut, "mrdwt"),
    recode=recode,
    grouping="channel",
    dial=Dial("T_g", 2.0**-20, 2.0**20),
    parameters=(
        preset_parameter(PRESETS),
        Parameter(
            "T_g",
            None,
            "global threshold, degrees for a rotation of average effect; default 0.2",
            number("T_g", 0, 2.0**20),
        ),
        Q,
        N,
        WAVELET,
        Parameter(
            "threshold_rule",
            None,
            f"{', '.join(RULES)}; default sensitivity",
            choice("threshold_rule", RULES),
        ),
        SEGMENT_FRAMES_PARAMETER,
    ),
)
