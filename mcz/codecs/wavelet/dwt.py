"""Codec 16, preset ``dwt``: a wavelet transform in time, one threshold for all channels.

SPEC.md, "Codec 16: wavelet", is normative; ``wavelet.py`` has the decoder, this file the encoder's
choices. Source: M. A. Khan, An efficient algorithm for compression of motion capture signal using
multidimensional quadratic Bezier curve break-and-fit method, 2014, section 5; the preset
``khan2014`` follows the published implementation, the defaults improve upon it.

Exactness: lossy; decoding is bit-exact (integers, then binary64 products and sums in the order that
SPEC.md states). A stream holds one channel at one resolution of one segment.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.channel_weights import weights_of
from mcz.codecs.contract import Encoded, Layout, SignalSource
from mcz.codecs.parameters import Dial, Parameter, number, preset_parameter, preset_values
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER, segment_frames_of, skeleton_of
from mcz.codecs.wavelet import wavelet
from mcz.codecs.wavelet.reencode import recoder
from mcz.codecs.wavelet.streams import make_quantizer
from mcz.codecs.wavelet.wavelet import BITSTREAM, WAVELET, N, Plan, Q, transform_of
from mcz.model.types import Floats, Params, Settings

PRESETS: dict[str, Settings] = {
    # As published: t_w in the units of the source for positions too, the whole clip at once, and
    # the requested levels for any length.
    "khan2014": {"t_w": 3.0, "Q": 2, "N": 4, "wavelet": "db2"},
    "default": {"t_w": 0.2, "Q": None, "N": 4, "wavelet": "bior4.4"},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    layout, published = source.layout, params["preset"] == "khan2014"
    chosen = preset_values(PRESETS, params)
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    weights = _weights(layout, unit_aware=not published)
    quantizer = make_quantizer(weights, chosen["t_w"], chosen["Q"], "t_w")
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    return wavelet.encode(source, Plan("dwt", transform, quantizer, frames))


def _weights(layout: Layout, *, unit_aware: bool) -> Floats:
    """The threshold of each channel at t_w = 1, (n_channels,), in source units."""
    no_sample = np.zeros((0, layout.n_channels))
    return weights_of(skeleton_of("dwt", layout), no_sample, "flat", unit_aware=unit_aware)


def _weigh(source: SignalSource, options: Params) -> tuple[Floats, float | None]:
    """Weights and t_w of a clip that was coded with these options."""
    return _weights(source.layout, unit_aware=options["preset"] != "khan2014"), options["t_w"]


CODEC = BITSTREAM(
    preset=2,
    name="dwt",
    encode=encode,
    recode=recoder(_weigh),
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
