"""Codec 16: the presets ``mrdwt`` and ``dwt``, wavelet transforms in time with thresholds.

SPEC.md, "Codec 16: wavelet", is normative; ``wavelet.py`` has the decoder, this file the encoders'
choices. The defaults improve upon the presets that follow a published implementation exactly:

- ``mrdwt``: thresholds by joint, ``khan2016``. M. A. Khan, Multiresolution coding of motion capture
  data for real-time multimedia applications, 2016.
- ``dwt``: one threshold for all channels, ``khan2014``. M. A. Khan, An efficient algorithm for
  compression of motion capture signal using multidimensional quadratic Bezier curve break-and-fit
  method, 2014, section 5.

Exactness: lossy; decoding is bit-exact (integers, then binary64 products and sums in the order that
SPEC.md states). A stream holds one channel at one resolution of one segment.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.channel_weights import RULES, SAMPLED_FRAMES, weights_of
from mcz.codecs.contract import Encoded, Layout, SignalSource
from mcz.codecs.parameters import Dial, Parameter, choice, number, preset_parameter, preset_values
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER, sample, segment_frames_of, skeleton_of
from mcz.codecs.wavelet import wavelet
from mcz.codecs.wavelet.reencode import recoder
from mcz.codecs.wavelet.streams import make_quantizer
from mcz.codecs.wavelet.wavelet import BITSTREAM, WAVELET, N, Plan, Q, transform_of
from mcz.model.types import Floats, Params, Settings

# As published: thresholds in the units of the source for positions too, the whole clip at once, and
# the requested levels for any length.
MRDWT_PRESETS: dict[str, Settings] = {
    "khan2016": {"T_g": 12.0, "Q": 1, "N": 4, "wavelet": "db3", "threshold_rule": "depth"},
    "default": {
        "T_g": 0.2,
        "Q": None,
        "N": 4,
        "wavelet": "bior4.4",
        "threshold_rule": "sensitivity",
    },
}
DWT_PRESETS: dict[str, Settings] = {
    "khan2014": {"t_w": 3.0, "Q": 2, "N": 4, "wavelet": "db2"},
    "default": {"t_w": 0.2, "Q": None, "N": 4, "wavelet": "bior4.4"},
}


def encode_mrdwt(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    chosen, published = preset_values(MRDWT_PRESETS, params), params["preset"] == "khan2016"
    weights = _mrdwt_weights(source, chosen["threshold_rule"], unit_aware=not published)
    return _encode("mrdwt", source, params, chosen, weights, "T_g", published=published)


def encode_dwt(source: SignalSource, params: Params) -> Encoded:
    """Encode as ``encode_mrdwt``, with the threshold ``t_w``."""
    chosen, published = preset_values(DWT_PRESETS, params), params["preset"] == "khan2014"
    weights = _dwt_weights(source.layout, unit_aware=not published)
    return _encode("dwt", source, params, chosen, weights, "t_w", published=published)


def _encode(
    name: str,
    source: SignalSource,
    params: Params,
    chosen: Params,
    weights: Floats,
    threshold: str,
    *,
    published: bool,
) -> Encoded:
    """Encode with the parameter ``threshold`` times ``weights`` as thresholds of channels."""
    layout = source.layout
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    quantizer = make_quantizer(weights, chosen[threshold], chosen["Q"], threshold)
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    return wavelet.encode(source, Plan(name, transform, quantizer, frames))


def _mrdwt_weights(source: SignalSource, rule: str, *, unit_aware: bool) -> Floats:
    """The threshold of each channel at T_g = 1, (n_channels,), in source units."""
    skeleton = skeleton_of("mrdwt", source.layout)
    return weights_of(skeleton, sample(source, SAMPLED_FRAMES), rule, unit_aware=unit_aware)


def _dwt_weights(layout: Layout, *, unit_aware: bool) -> Floats:
    """The threshold of each channel at t_w = 1, (n_channels,), in source units."""
    no_sample = np.zeros((0, layout.n_channels))
    return weights_of(skeleton_of("dwt", layout), no_sample, "flat", unit_aware=unit_aware)


def _weigh_mrdwt(source: SignalSource, options: Params) -> tuple[Floats, float | None]:
    """Weights and T_g of a clip that was coded with these options."""
    preset, published = MRDWT_PRESETS[options["preset"]], options["preset"] == "khan2016"
    rule = options["threshold_rule"] or preset["threshold_rule"]
    T_g = options["T_g"]
    if T_g is None and published:
        T_g = preset["T_g"]
    return _mrdwt_weights(source, rule, unit_aware=not published), T_g


def _weigh_dwt(source: SignalSource, options: Params) -> tuple[Floats, float | None]:
    """Weights and t_w of a clip that was coded with these options."""
    weights = _dwt_weights(source.layout, unit_aware=options["preset"] != "khan2014")
    return weights, options["t_w"]


MRDWT = BITSTREAM(
    preset=1,
    name="mrdwt",
    encode=encode_mrdwt,
    recode=recoder(_weigh_mrdwt),
    dial=Dial("T_g", 2.0**-20, 2.0**20),
    parameters=(
        preset_parameter(MRDWT_PRESETS),
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
DWT = BITSTREAM(
    preset=2,
    name="dwt",
    encode=encode_dwt,
    recode=recoder(_weigh_dwt),
    dial=Dial("t_w", 2.0**-20, 2.0**20),
    parameters=(
        preset_parameter(DWT_PRESETS),
        Parameter("t_w", None, "threshold in degrees; default 0.2", number("t_w", 0, 2.0**20)),
        Q,
        N,
        WAVELET,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
