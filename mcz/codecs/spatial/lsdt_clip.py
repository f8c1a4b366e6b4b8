"""Codec 20, preset ``lsdt-clip``: windows of frames, cosines in time, a learned basis in space.

SPEC.md, "Codec 20: lsdt-clip", is normative; ``windows.py`` has the decoder, this file the
encoder's choices. Source: J. Hou, L.-P. Chau, N. Magnenat-Thalmann, Y. He, Low-latency compression
of mocap data using learned spatial decorrelation transform, 2016, section 3.2.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). Windows decode independently; their length is the delay.
"""

from __future__ import annotations

from mcz.codecs import space_choices
from mcz.codecs.contract import Encoded, SignalSource
from mcz.codecs.parameters import preset_parameter, preset_values
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER
from mcz.codecs.spatial import windows
from mcz.codecs.spatial.windows import Plan
from mcz.model.types import Params, Settings

NAME = "lsdt-clip"

PRESETS: dict[str, Settings] = {
    "default": {"window": 240, "threshold": space_choices.THRESHOLD, "coder": "mixed"},
    "hou2016": {"window": 240, "threshold": 0.5, "coder": "prefix"},
}


def encode(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source``; invalid values are interpolated.

    Raises MotionError for a value that is not finite, or is too large.
    """
    chosen = preset_values(PRESETS, params)
    sample = space_choices.sample_of(NAME, source)
    step = params["step"] or space_choices.default_step(sample)
    space = space_choices.choose_space(NAME, sample, step, params["basis"], space_choices.cosines)
    plan = Plan(
        chosen["window"],
        chosen["window"],
        space.fields,
        space.models,
        space.known,
        chosen["threshold"],
        params["segment_frames"] or 0,
        chosen["coder"] == "prefix",
    )
    return windows.encode(NAME, source, plan)


CODEC = windows.BITSTREAM(
    preset=1,
    name=NAME,
    encode=encode,
    parameters=(
        preset_parameter(PRESETS),
        space_choices.STEP,
        space_choices.WINDOW,
        space_choices.THRESHOLD_PARAMETER,
        space_choices.BASIS,
        space_choices.CODER,
        space_choices.DOMAIN,
        space_choices.VIRTUAL_MARKERS,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
