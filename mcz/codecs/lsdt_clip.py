"""Codec 8, ``lsdt-clip``: windows of frames, cosines in time, a learned basis in space.

SPEC.md, "Codec 8: lsdt-clip", is normative; the names below are its field names.
Source: J. Hou, L.-P. Chau, N. Magnenat-Thalmann, Y. He, Low-latency compression of mocap data using
learned spatial decorrelation transform, 2016, section 3.2.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). A window decodes by itself; its length is the delay.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from mcz.codecs import _windows
from mcz.codecs._lossy import (
    SEGMENT_FRAMES_PARAMETER,
    chosen_of,
    preset_parameter,
)
from mcz.codecs._space_choice import (
    BASIS,
    CODER,
    DOMAIN,
    STEP,
    THRESHOLD,
    THRESHOLD_PARAMETER,
    VIRTUAL_MARKERS,
    WINDOW,
    choose_space,
    cosines,
    default_step,
    sample_of,
)
from mcz.codecs._windows import Plan
from mcz.codecs.base import Codec, Dial, Encoded, SignalSource

NAME = "lsdt-clip"

PRESETS: dict[str, dict[str, Any]] = {
    "default": {"window": 240, "threshold": THRESHOLD, "coder": "adaptive"},
    "hou2016": {"window": 240, "threshold": 0.5, "coder": "prefix"},
}


def encode(source: SignalSource, params: Mapping[str, Any]) -> Encoded:
    """Code the values of ``source``; what is invalid is filled.

    Raises MotionError for a value that is not finite, or is too large.
    """
    chosen = chosen_of(PRESETS, params)
    sample = sample_of(NAME, source)
    step = params["step"] or default_step(sample)
    space = choose_space(NAME, sample, step, params["basis"], cosines)
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
    return _windows.encode(NAME, source, plan)


CODEC = Codec(
    id=8,
    name=NAME,
    version=0,
    domain="values",
    lossless=False,
    encode=encode,
    decode=partial(_windows.decode, NAME),
    grouping="all",
    places=True,
    uses=partial(_windows.uses, NAME),
    dial=Dial("step", 2.0**-60, 2.0**60),
    parameters=(
        preset_parameter(PRESETS),
        STEP,
        WINDOW,
        THRESHOLD_PARAMETER,
        BASIS,
        CODER,
        DOMAIN,
        VIRTUAL_MARKERS,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
