"""Codec 16, preset ``mrdwt``: a multiresolution wavelet transform in time, thresholds by joint.

SPEC.md, "Codec 16: wavelet", is normative; ``wavelet.py`` has the decoder, this file the encoder's
choices. Source: M. A. Khan, Multiresolution coding of motion capture data for real-time multimedia
applications, 2016; the preset ``khan2016`` follows the published implementation exactly, the
defaults improve upon it.

Exactness: lossy; decoding is bit-exact (integers, then binary64 products and sums in the order that
SPEC.md states). A stream holds one channel at one resolution of one segment.
"""

from __future__ import annotations

from mcz.codecs.channel_weights import RULES, SAMPLED_FRAMES, weights_of
from mcz.codecs.contract import Encoded, SignalSource
from mcz.codecs.parameters import Dial, Parameter, choice, number, preset_parameter, preset_values
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER, sample, segment_frames_of, skeleton_of
from mcz.codecs.wavelet import wavelet
from mcz.codecs.wavelet.reencode import recoder
from mcz.codecs.wavelet.streams import make_quantizer
from mcz.codecs.wavelet.wavelet import BITSTREAM, WAVELET, N, Plan, Q, transform_of
from mcz.model.types import Floats, Params, Settings

PRESETS: dict[str, Settings] = {
    # Exactly as published: T_g in the units of the source for positions too, the whole clip at
    # once, and the requested levels for any length.
    "khan2016": {"T_g": 12.0, "Q": 1, "N": 4, "wavelet": "db3", "threshold_rule": "depth"},
    "default": {
        "T_g": 0.2,
        "Q": None,
        "N": 4,
        "wavelet": "bior4.4",
        "threshold_rule": "sensitivity",
    },
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    layout, preset = source.layout, params["preset"]
    skeleton = skeleton_of("mrdwt", layout)
    chosen, published = preset_values(PRESETS, params), preset == "khan2016"
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    weights = weights_of(
        skeleton, sample(source, SAMPLED_FRAMES), chosen["threshold_rule"], unit_aware=not published
    )
    quantizer = make_quantizer(weights, chosen["T_g"], chosen["Q"])
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    plan = Plan("mrdwt", transform, quantizer, frames)
    return wavelet.encode(source, plan)


def _weigh(source: SignalSource, options: Params) -> tuple[Floats, float | None]:
    """Weights and T_g of a clip that was coded with these options."""
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
    return weights, T_g


CODEC = BITSTREAM(
    preset=1,
    name="mrdwt",
    encode=encode,
    recode=recoder(_weigh),
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
