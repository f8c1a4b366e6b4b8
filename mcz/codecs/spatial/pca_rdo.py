"""Codec 20, preset ``pca-rdo``: principal components of poses, and of their courses in windows.

SPEC.md, "Codec 20: lsdt-clip", is normative; ``windows.py`` has the decoder, this file the
encoder's choices. Source: L. Vasa, G. Brunnett, Rate-distortion optimized compression of motion
capture data, 2014, as Hou 2016 describes it in sections 2.1 and 5.4.2.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). Mean, components and courses are in the file, as a model.
"""

from __future__ import annotations

from mcz.codecs.contract import Encoded, SignalSource
from mcz.codecs.parameters import preset_values
from mcz.codecs.space_choices import default_step, sample_of
from mcz.codecs.spatial import windows
from mcz.codecs.spatial.window_choices import THRESHOLD, parameters_of, plan_of, window_options
from mcz.model.types import Params, Settings

NAME = "pca-rdo"
WINDOW = 120

PRESETS: dict[str, Settings] = {
    "default": {"window": WINDOW, "threshold": THRESHOLD, "coder": "mixed"},
    "hou2016": {"window": WINDOW, "threshold": 0.5, "coder": "prefix"},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source``; invalid values are interpolated.

    Raises MotionError for a value that is not finite, or is too large.
    """
    sample = sample_of(NAME, source)
    step = params["step"] or default_step(sample)
    asked = window_options(params, preset_values(PRESETS, params), step)
    plan = plan_of(NAME, source, sample, asked, apart=False, mean=True, courses=True)
    return windows.encode(NAME, source, plan)


CODEC = windows.BITSTREAM(
    preset=3, name=NAME, encode=encode, parameters=parameters_of(PRESETS, WINDOW)
)
