"""Codec 16, preset ``awt``: wavelets in time, coefficients shared out among the channels.

SPEC.md, "Codec 16: wavelet", is normative; ``wavelet.py`` has what a decoder needs, this file
what an encoder chooses.
Source: P. Beaudoin, P. Poulin, M. van de Panne, Adapting wavelet compression to human motion
capture clips, 2007, as M. A. Khan, An efficient algorithm for compression of motion capture signal
using multidimensional quadratic Bezier curve break-and-fit method, 2014, section 5, describes it;
the preset ``khan2014`` is the method of the latter, the defaults improve upon it.

Exactness: lossy; decoding is bit-exact (integers, then binary64 products and sums in the order
that SPEC.md states). A stream holds one channel at one
resolution of one segment. An encoder needs the whole clip in memory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.channel_weights import SAMPLED_FRAMES, weights_of
from mcz.codecs.contract import Encoded, SignalSource
from mcz.codecs.parameters import (
    Dial,
    Parameter,
    choice,
    integer,
    number,
    preset_parameter,
    preset_values,
)
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER, sample, segment_frames_of, skeleton_of
from mcz.codecs.wavelet import wavelet
from mcz.codecs.wavelet.awt_choices import choose, coefficients_of, quantizer_of
from mcz.codecs.wavelet.reencode import recoder
from mcz.codecs.wavelet.wavelet import (
    BITSTREAM,
    WAVELET,
    N,
    Plan,
    Q,
    transform_of,
)
from mcz.model.types import Params, Settings

Floats = NDArray[np.float64]

FRAMES_A_COEFFICIENT = 8  # where a_w is not given
DISTORTIONS = ("positions", "channels")
PRESETS: dict[str, Settings] = {
    # As published: any coefficient may be dropped, the whole clip at once, and the levels that
    # were asked for however short it is.
    "khan2014": {"a_w": 40.0, "Q": 2, "N": 4, "wavelet": "db2", "distortion": "channels"},
    "default": {"a_w": None, "Q": None, "N": 4, "wavelet": "bior4.4", "distortion": "positions"},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source`` with unwrapped rotations; invalid values are interpolated.

    Raises MotionError for a value that is not finite, OptionError for parameters that do not fit.
    """
    layout, published = source.layout, params["preset"] == "khan2014"
    chosen = preset_values(PRESETS, params)
    average = chosen["a_w"]
    if average is None:
        average = -(-layout.n_frames // FRAMES_A_COEFFICIENT)
    transform = transform_of(layout, chosen["wavelet"], chosen["N"], as_published=published)
    weights = _weights(source, chosen["distortion"])
    choice = choose(
        coefficients_of("awt", source, transform),
        weights,
        average,
        whole_approximation=not published,
        iterations=params["iterations"],
        seed=params["seed"],
    )
    quantizer = quantizer_of(choice, weights, chosen["Q"])
    frames = segment_frames_of(layout, params["segment_frames"], as_published=published)
    return wavelet.encode(source, Plan("awt", transform, quantizer, frames, choice.kept))


def _weights(source: SignalSource, distortion: str) -> Floats:
    """The threshold of each channel that goes with one of 1, (n_channels,)."""
    layout = source.layout
    skeleton = skeleton_of("awt", layout)
    if distortion == "channels":
        return np.ones(layout.n_channels)
    frames = sample(source, SAMPLED_FRAMES)
    return weights_of(skeleton, frames, "sensitivity", unit_aware=True)


def _weigh(source: SignalSource, options: Params) -> tuple[Floats, None]:
    """Weights of a clip that was coded with these options; its thresholds are not known."""
    return _weights(source, preset_values(PRESETS, options)["distortion"]), None


CODEC = BITSTREAM(
    preset=3,
    name="awt",
    encode=encode,
    recode=recoder(_weigh),
    dial=Dial("a_w", 2.0**-20, 2.0**40, rises=True),
    parameters=(
        preset_parameter(PRESETS),
        Parameter(
            "a_w",
            None,
            "coefficients a channel, on average; default: one for 8 frames",
            number("a_w", 0, 2.0**40),
        ),
        Parameter(
            "distortion",
            None,
            "what is lowered: positions (default), or the squared error of channels",
            choice("distortion", DISTORTIONS),
        ),
        Parameter(
            "iterations",
            None,
            "moves of the annealing; default 4000 a channel",
            integer("iterations", 0, 2**40),
        ),
        Parameter("seed", 0, "of the annealing", integer("seed", 0, 2**31 - 1)),
        Q,
        N,
        WAVELET,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
