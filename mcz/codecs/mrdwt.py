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

from collections.abc import Mapping
from functools import partial
from typing import Any

from mcz.codecs import _wavelet_codec
from mcz.codecs._wavelet_codec import MAX_DECIMALS, Plan
from mcz.codecs._wavelet_frames import sample
from mcz.codecs._wavelet_quantizer import RULES, SAMPLED_FRAMES, make_quantizer, weights_of
from mcz.codecs.base import (
    Codec,
    Dial,
    Encoded,
    Parameter,
    SignalSource,
    choice,
    integer,
    number,
)
from mcz.errors import MotionError
from mcz.transforms.wavelets import MAX_LEVELS, by_name

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
    if layout.samples_per_frame != 1 or layout.skeleton is None:
        raise MotionError("mrdwt: only signals of one sample a frame")
    chosen = {
        name: value if params[name] is None else params[name]
        for name, value in PRESETS[preset].items()
    }
    published = preset == "khan2016"
    wavelet_id, wavelet = by_name(chosen["wavelet"])
    levels = chosen["N"] if layout.n_frames else 0
    while levels and not published and layout.n_frames < (wavelet.n_taps - 1) << levels:
        levels -= 1
    weights = weights_of(
        layout.skeleton,
        sample(source, SAMPLED_FRAMES),
        chosen["threshold_rule"],
        unit_aware=not published,
    )
    quantizer = make_quantizer(weights, chosen["T_g"], chosen["Q"])
    frames = params["segment_frames"]
    if frames is None:
        frames = layout.n_frames if published else 0
    plan = Plan("mrdwt", wavelet_id, wavelet, levels, quantizer, frames)
    return _wavelet_codec.encode(source, plan)


CODEC = Codec(
    id=2,
    name="mrdwt",
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=partial(_wavelet_codec.decode, "mrdwt"),
    cut=partial(_wavelet_codec.cut, "mrdwt"),
    grouping="channel",
    dial=Dial("T_g", 2.0**-20, 2.0**20),
    parameters=(
        Parameter(
            "preset",
            "default",
            "default, or khan2016 for the published method",
            choice("preset", tuple(PRESETS)),
        ),
        Parameter(
            "T_g",
            None,
            "global threshold, degrees for a rotation of average effect; default 0.2",
            number("T_g", 0, 2.0**20),
        ),
        Parameter(
            "Q",
            None,
            "decimals of coefficients; default: steps follow the thresholds",
            integer("Q", 0, MAX_DECIMALS),
        ),
        Parameter("N", None, "levels; default 4", integer("N", 0, MAX_LEVELS)),
        Parameter("wavelet", None, "name as in PyWavelets; default bior4.4", str),
        Parameter(
            "threshold_rule",
            None,
            f"{', '.join(RULES)}; default sensitivity",
            choice("threshold_rule", RULES),
        ),
        Parameter(
            "segment_frames",
            None,
            "frames a segment; default: as many as make 64 KiB, at most 4096",
            integer("segment_frames", 1, 2**40),
        ),
    ),
)
