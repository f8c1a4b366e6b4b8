"""The parameters of ``online``, and the settings derived from them before the first frame.

mcz/codecs/online/README.md describes them; a decoder needs none of it.
"""

from __future__ import annotations

from dataclasses import replace

from mcz.codecs.contract import Layout
from mcz.codecs.online.coder import AS_IS, NAME, REORDERED
from mcz.codecs.online.rate_control import FLOOR_CM
from mcz.codecs.online.units import MODES
from mcz.codecs.parameters import Parameter, choice, integer, number
from mcz.codecs.space_choices import (
    BASIS,
    DOMAIN,
    LEAST,
    MOST,
    STEP,
    THRESHOLD,
    THRESHOLD_PARAMETER,
    VIRTUAL_MARKERS,
    Choice,
    Sample,
    basis_at_hand,
    choose_space,
    default_step,
    frame_differences,
    live_sample,
)
from mcz.errors import OptionError
from mcz.model.types import Params, Settings

MOST_GOF = 2**20

_PUBLISHED = {
    "threshold": 0.5,
    "coder": "golomb",
    "order": "reordered",
    "ltr_step": 1.0,
    "intra_period": 0,
}
PRESETS: dict[str, Settings] = {
    "default": {
        "threshold": THRESHOLD,
        "coder": "mixed",
        "order": "apart",
        "ltr_step": 0.5,
        "intra_period": 4,
        "rate_control": None,
    },
    "mod": _PUBLISHED | {"rate_control": "mod"},
    "rc": _PUBLISHED | {"rate_control": "rc"},
    "rca": _PUBLISHED | {"rate_control": "rca"},
}
PRESET_IDS = {"default": 0, "mod": 1, "rc": 2, "rca": 3}  # of CLIP
# May change while frames come, at the border of a group.
CHANGEABLE = {
    "step",
    "bitrate",
    "gof",
    "intra_period",
    "ltr_step",
    "alpha",
    "a",
    "b",
    "threshold",
    "buffer",
}


def settle_options(params: Params) -> Settings:
    """Fill in the values of the preset; raises OptionError for a contradiction."""
    values = PRESETS[params["preset"]].items()
    chosen = dict(params) | {n: v if params[n] is None else params[n] for n, v in values}
    if chosen["rate_control"] is None:
        chosen["rate_control"] = "mod" if chosen["bitrate"] is None else "steady"
    controlled = chosen["rate_control"] != "mod"
    if controlled and chosen["bitrate"] is None:
        raise OptionError(f"{NAME}: rate_control {chosen['rate_control']} needs a bitrate")
    if not controlled and chosen["bitrate"] is not None:
        raise OptionError(f"{NAME}: rate_control mod keeps its step, and has no bitrate")
    if controlled and chosen["step"] is not None:
        raise OptionError(f"{NAME}: with a bitrate the steps follow from it; leave out step")
    return chosen


def choose_options(sample: Sample, chosen: Params) -> tuple[Choice, int]:
    """Fields of SPACE and the order of points, chosen from a sample."""
    which, order = chosen["basis"], AS_IS
    step = chosen["step"] or default_step(sample)
    if chosen["order"] == "reordered" and sample.apart:
        # One matrix of all channels, as published.
        if which not in ("auto", "cosines"):
            raise OptionError(f"{NAME}: order reordered has cosines only, not basis {which}")
        sample, which, order = replace(sample, apart=False), "cosines", REORDERED
    elif which == "auto":
        which = basis_at_hand(sample)  # as live, so that a file is no better than its stream
    return choose_space(NAME, sample, step, which, frame_differences), order


def choose_live_options(layout: Layout, chosen: Params) -> tuple[Choice, int]:
    """The same before any frame is known."""
    sample, _ = live_sample(NAME, layout, chosen["basis"])
    step = chosen["step"]
    if step is None and chosen["bitrate"] is None:
        raise OptionError(f"{NAME}: step or bitrate has to be given, for no frame is known yet")
    if step is None:
        unit = layout.skeleton.unit_cm if layout.skeleton is not None else None
        step = min(max(FLOOR_CM / (unit or 1.0), LEAST), MOST)
    return choose_options(sample, {**chosen, "step": step})


PARAMETERS = (
    Parameter(
        "preset",
        "default",
        "default, or mod, rc, rca for the published methods",
        choice("preset", tuple(PRESETS)),
    ),
    STEP,
    Parameter(
        "bitrate",
        None,
        "kilobits a second, which steps follow, in place of step: of a live stream all its bytes, "
        "of a file the coded frames",
        number("bitrate", 1e-3, 1e9),
    ),
    Parameter(
        "rate_control",
        None,
        f"{', '.join(MODES)}; default: steady with a bitrate, mod without",
        choice("rate_control", MODES),
    ),
    Parameter(
        "buffer",
        1.0,
        "of steady: seconds over which the rate is held",
        number("buffer", 1e-3, 1e6),
    ),
    Parameter(
        "gof", 30, "frames a group, the first of which is an LTR", integer("gof", 1, MOST_GOF)
    ),
    Parameter(
        "intra_period",
        None,
        "every how many-th LTR is intra coded; 0: the first alone; default 4",
        integer("intra_period", 0, MOST_GOF),
    ),
    Parameter(
        "ltr_step",
        None,
        "the step of LTRs in units of that of others; default 0.5",
        number("ltr_step", 2.0**-10, 2.0**10),
    ),
    Parameter(
        "alpha",
        10.0,
        "of rc: bits of a coefficient of an LTR for each of others",
        number("alpha", 1e-3, 1e6),
    ),
    Parameter("a", None, "of rca: a of eq. 14; default: as fitted here", number("a", -100, 100)),
    Parameter("b", None, "of rca: b of eq. 14; default: as fitted here", number("b", -100, 100)),
    THRESHOLD_PARAMETER,
    Parameter(
        "order",
        None,
        "apart: x, y and z of positions apart; reordered: in one vector, as published",
        choice("order", ("apart", "reordered")),
    ),
    replace(BASIS, help=f"{BASIS.help}; auto: well-known ones of as many points, or cosines"),
    Parameter(
        "coder",
        None,
        "mixed, or golomb: adaptive Golomb-Rice codes whose bits are coded, as published",
        choice("coder", ("mixed", "golomb")),
    ),
    DOMAIN,
    VIRTUAL_MARKERS,
    Parameter(
        "segment_frames",
        None,
        "frames a segment has at least, up to where one may begin; default: 1,200, or 62,000 bytes",
        integer("segment_frames", 1, 2**40),
    ),
)
