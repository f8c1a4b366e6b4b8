"""Parameters and step targets of an ``online`` encoder, and their changes.

mcz/codecs/online/README.md describes it; decoders do not need it. Source: C.-H. Kwak, I. V. Bajic,
Online MoCap data coding with bit allocation, rate control, and motion-adaptive post-processing,
eqs. 2, 3 and 17.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache

import numpy as np

from mcz.codecs import space_choices
from mcz.codecs.contract import Layout
from mcz.codecs.online import rate_kernels
from mcz.codecs.online.coder import AS_IS, NAME, REORDERED
from mcz.codecs.online.units import MODES
from mcz.codecs.parameters import Parameter, choice, integer, number
from mcz.codecs.space_choices import Choice, Sample
from mcz.errors import OptionError
from mcz.hints import Hint
from mcz.model.types import Floats, Params, Settings

# a and b of eq. 14 for markers and for points of a skeleton, by tools/fit_bit_allocation.py; the
# published -0.4121 and 3.2745, 0.05 and 2.0492 are those of the authors' own coder.
FITS = {"c3d": (-0.1311, 1.2641), "bvh": (-0.0937, 1.2619)}
LEAST_FLOOR = 2.0**-100  # steps
FLOOR_CM, FLOOR_STEPS = 2.0, 4.0  # least deviation; steps: unit unknown
MOST_TERMS = 40_000  # of an entropy


@dataclass
class Plan:
    """``numbers`` as the kernels have them, and the tables of rates."""

    numbers: Floats
    laplace: Floats
    gauss: Floats

    def round_up(self, n_bytes: int) -> None:
        """Account for a group of this many bytes."""
        more = 8 * n_bytes - self.numbers[rate_kernels.SPENT]
        self.numbers[rate_kernels.SPENT] += more
        self.numbers[rate_kernels.AHEAD] += more

    def charge(self, n_bytes: int, *, intra: bool) -> None:
        """Account for the last frame of a live stream: its bytes with framing."""
        numbers = self.numbers
        framing = 8.0 * n_bytes - numbers[rate_kernels.LAST]
        numbers[rate_kernels.SPENT] += framing - numbers[rate_kernels.RESERVED]
        usual = numbers[rate_kernels.FRAMING]
        if intra:  # it has a clip header before it, which all frames up to the next one pay for
            more = framing - usual
            if numbers[rate_kernels.PERIOD] > 0:
                numbers[rate_kernels.EXTRA] += more
                numbers[rate_kernels.OWED] += more
                framing = usual
        else:
            share = rate_kernels.FOLLOW / numbers[rate_kernels.BUFFER] if usual else 1.0
            numbers[rate_kernels.FRAMING] += (framing - usual) * min(share, 1.0)
        rate = numbers[rate_kernels.GROUP_BITS] / numbers[rate_kernels.GROUP_FRAMES]
        ahead = numbers[rate_kernels.AHEAD] + framing
        numbers[rate_kernels.AHEAD] = min(ahead, rate * numbers[rate_kernels.BUFFER])


def plan_of(chosen: Params, layout: Layout, step: float) -> Plan:
    """Plan at the start of a signal; ``step`` as in its header.

    Raises OptionError for a rate if the frame rate is unknown.
    """
    laplace, gauss = rates()
    plan = Plan(np.zeros(rate_kernels.PLAN_SIZE), laplace, gauss)
    plan.numbers[[rate_kernels.LTR_VARIANCE, rate_kernels.STR_VARIANCE, rate_kernels.LTR_BITS]] = (
        rate_kernels.UNKNOWN
    )
    set_plan(plan, chosen, layout, step)
    return plan


def set_plan(plan: Plan, chosen: Params, layout: Layout, step: float) -> None:
    """Apply changed parameters from the next group on."""
    numbers = plan.numbers
    mode = chosen["rate_control"]
    if mode != "mod":
        if layout.frame_rate is None or not layout.frame_rate:
            raise OptionError(
                "online: a bitrate needs a frame rate, which this motion does not state",
                hint=Hint.RATE,
            )
        per_frame = float(Fraction(1000) / layout.frame_rate)
        numbers[rate_kernels.BUFFER] = max(1.0, chosen["buffer"] * float(layout.frame_rate))
        numbers[rate_kernels.GROUP_BITS] = chosen["bitrate"] * per_frame * chosen["gof"]
    unit = layout.skeleton.unit_cm if layout.skeleton is not None else None
    is_derived = layout.skeleton is not None and layout.skeleton.base is not None
    slope, offset = FITS["bvh" if is_derived else "c3d"]
    numbers[rate_kernels.AHEAD] += numbers[rate_kernels.OWED]
    numbers[rate_kernels.OWED] = numbers[rate_kernels.EXTRA] = 0.0
    numbers[rate_kernels.MODE] = MODES.index(mode)
    numbers[rate_kernels.GROUP_FRAMES] = chosen["gof"]
    numbers[rate_kernels.PERIOD] = chosen["intra_period"]
    numbers[rate_kernels.LTR_SHIFT] = math.log2(chosen["ltr_step"])
    floor = FLOOR_STEPS if unit is None else FLOOR_CM / unit / step
    numbers[rate_kernels.FLOOR] = min(max(floor, LEAST_FLOOR), 1 / LEAST_FLOOR) ** 2
    numbers[rate_kernels.ALPHA] = chosen["alpha"]
    numbers[rate_kernels.SLOPE] = slope if chosen["a"] is None else chosen["a"]
    numbers[rate_kernels.OFFSET] = offset if chosen["b"] is None else chosen["b"]
    if mode == "mod":
        numbers[rate_kernels.BASE] = math.log2((chosen["step"] or step) / step)


@cache
def rates() -> tuple[Floats, Floats]:
    """Bits of a quantized Laplacian and Gaussian, by log2 of the step over the deviation."""
    at = 2.0 ** (np.arange(rate_kernels.N_RATES) / rate_kernels.PER_OCTAVE - rate_kernels.LOW)
    tables = tuple(np.array([bits(float(x)) for x in at]) for bits in (laplacian, gaussian))
    return tables[0], tables[1]


def laplacian(step: float) -> float:
    """Entropy of a Laplacian of deviation 1, quantized with ``step``, in bits; eq. 2.

    Its last factor is misprinted there: it is theta^(3/2), not theta^(1/3).
    """
    theta = math.exp(-math.sqrt(2) * step)
    root = math.sqrt(theta)
    if root <= 0.0:
        return 0.0
    away = -math.expm1(-math.sqrt(2) * step)  # 1 - theta
    log = -math.sqrt(2) * step / math.log(2)  # log2 of theta
    zero = -math.expm1(-step / math.sqrt(2))  # 1 - root
    entropy = -root * math.log2(root) - (zero * math.log2(zero) if zero > 0 else 0.0)
    return entropy + root * (1 - math.log2(away)) - root * theta * log / away


def gaussian(step: float) -> float:
    """Entropy of a Gaussian of deviation 1, quantized with ``step``, in bits.

    Eq. 3 is the sum of the three terms in the middle of this, which is not an entropy at fine
    steps.
    """
    if step < 1e-3:  # differential entropy: the sum has tens of thousands of terms
        return 0.5 * math.log2(2 * math.pi * math.e) - math.log2(step)
    scale, total = step / math.sqrt(2), 0.0
    for k in range(MOST_TERMS):
        if k:
            p = 0.5 * (math.erfc(scale * (k - 0.5)) - math.erfc(scale * (k + 0.5)))
        else:
            p = math.erf(scale / 2)
        if p <= 0.0 or (k and p < 1e-18):
            break
        total -= (2 if k else 1) * p * math.log2(p)
    return max(total, 0.0)


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
        "threshold": space_choices.THRESHOLD,
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
# May change between groups.
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
        raise OptionError(f"{NAME}: rate_control mod keeps its step; leave out bitrate")
    if controlled and chosen["step"] is not None:
        raise OptionError(f"{NAME}: a bitrate determines the steps; leave out step")
    return chosen


def choose_options(sample: Sample, chosen: Params) -> tuple[Choice, int]:
    """Fields of SPACE and the order of points, chosen from a sample."""
    basis, order = chosen["basis"], AS_IS
    step = chosen["step"] or space_choices.default_step(sample)
    if chosen["order"] == "reordered" and sample.apart:
        # One matrix of all channels, as published.
        if basis not in ("auto", "cosines"):
            raise OptionError(f"{NAME}: order reordered allows only basis cosines, not {basis}")
        sample, basis, order = replace(sample, apart=False), "cosines", REORDERED
    elif basis == "auto":
        basis = space_choices.basis_at_hand(sample)  # as live, so that a file equals its stream
    return space_choices.choose_space(
        NAME, sample, step, basis, space_choices.frame_differences
    ), order


def choose_live_options(layout: Layout, chosen: Params) -> tuple[Choice, int]:
    """Like ``choose_options``, before any frame is known."""
    sample, _ = space_choices.live_sample(NAME, layout, chosen["basis"])
    step = chosen["step"]
    if step is None and chosen["bitrate"] is None:
        raise OptionError(f"{NAME}: a live stream needs a step or a bitrate")
    if step is None:
        unit = layout.skeleton.unit_cm if layout.skeleton is not None else None
        step = min(max(FLOOR_CM / (unit or 1.0), space_choices.LEAST), space_choices.MOST)
    return choose_options(sample, {**chosen, "step": step})


PARAMETERS = (
    Parameter(
        "preset",
        "default",
        "default, or mod, rc, rca for the published methods",
        choice("preset", tuple(PRESETS)),
    ),
    space_choices.STEP,
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
        "buffer", 1.0, "of steady: seconds over which the rate is held", number("buffer", 1e-3, 1e6)
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
    space_choices.THRESHOLD_PARAMETER,
    Parameter(
        "order",
        None,
        "apart: x, y and z of positions apart; reordered: in one vector, as published",
        choice("order", ("apart", "reordered")),
    ),
    replace(
        space_choices.BASIS,
        help=f"{space_choices.BASIS.help}; auto: well-known ones of as many points, or cosines",
    ),
    Parameter(
        "coder",
        None,
        "mixed, or golomb: adaptive Golomb-Rice codes whose bits are coded, as published",
        choice("coder", ("mixed", "golomb")),
    ),
    space_choices.DOMAIN,
    space_choices.VIRTUAL_MARKERS,
    Parameter(
        "segment_frames",
        None,
        "frames a segment has at least, up to where one may begin; default: 1,200, or 62,000 bytes",
        integer("segment_frames", 1, 2**40),
    ),
)
