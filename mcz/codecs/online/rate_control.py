"""Step targets of an ``online`` encoder, and their changes.

mcz/codecs/online/README.md describes it; a decoder needs none of it.
Source: C.-H. Kwak, I. V. Bajic, Online MoCap data coding with bit allocation, rate control, and
motion-adaptive post-processing, eqs. 2, 3 and 17.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.contract import Layout
from mcz.codecs.online.units import MODES
from mcz.errors import OptionError
from mcz.hints import Hint
from mcz.model.types import Params

Floats = NDArray[np.float64]

# a and b of eq. 14 for markers and for points of a skeleton, by tools/fit_bit_allocation.py; the
# published -0.4121 and 3.2745, 0.05 and 2.0492 are those of the authors' own coder.
FITS = {"c3d": (-0.1311, 1.2641), "bvh": (-0.0937, 1.2619)}
LEAST_FLOOR = 2.0**-100  # steps
FLOOR_CM, FLOOR_STEPS = 2.0, 4.0  # no deviation is taken to be smaller; steps: unit unknown
MOST_TERMS = 40_000  # of an entropy


@dataclass
class Plan:
    """``numbers`` as the kernels have them, and the tables of rates."""

    numbers: Floats
    laplace: Floats
    gauss: Floats

    def round_up(self, n_bytes: int) -> None:
        """Account for a group of this many bytes."""
        kernels = _kernels()
        more = 8 * n_bytes - self.numbers[kernels.SPENT]
        self.numbers[kernels.SPENT] += more
        self.numbers[kernels.AHEAD] += more

    def charge(self, n_bytes: int, *, intra: bool) -> None:
        """Account for the last frame of a live stream: its bytes with framing."""
        kernels, numbers = _kernels(), self.numbers
        framing = 8.0 * n_bytes - numbers[kernels.LAST]
        numbers[kernels.SPENT] += framing - numbers[kernels.RESERVED]
        usual = numbers[kernels.FRAMING]
        if intra:  # it has a clip header before it, which all frames up to the next one pay for
            more = framing - usual
            if numbers[kernels.PERIOD] > 0:
                numbers[kernels.EXTRA] += more
                numbers[kernels.OWED] += more
                framing = usual
        else:
            share = kernels.FOLLOW / numbers[kernels.BUFFER] if usual else 1.0
            numbers[kernels.FRAMING] += (framing - usual) * min(share, 1.0)
        rate = numbers[kernels.GROUP_BITS] / numbers[kernels.GROUP_FRAMES]
        ahead = numbers[kernels.AHEAD] + framing
        numbers[kernels.AHEAD] = min(ahead, rate * numbers[kernels.BUFFER])


def plan_of(chosen: Params, layout: Layout, step: float) -> Plan:
    """Plan at the start of a signal; ``step`` as in its header.

    Raises OptionError where a rate is asked for and the frame rate is not known.
    """
    kernels = _kernels()
    laplace, gauss = rates()
    plan = Plan(np.zeros(kernels.PLAN_SIZE), laplace, gauss)
    for number in (kernels.LTR_VARIANCE, kernels.STR_VARIANCE, kernels.LTR_BITS):
        plan.numbers[number] = kernels.UNKNOWN
    set_plan(plan, chosen, layout, step)
    return plan


def set_plan(plan: Plan, chosen: Params, layout: Layout, step: float) -> None:
    """Apply changed parameters from the next group on."""
    kernels, numbers = _kernels(), plan.numbers
    mode = chosen["rate_control"]
    if mode != "mod":
        if layout.frame_rate is None or not layout.frame_rate:
            raise OptionError(
                "online: a bitrate needs a frame rate, this motion says none", hint=Hint.RATE
            )
        per_frame = float(Fraction(1000) / layout.frame_rate)
        numbers[kernels.BUFFER] = max(1.0, chosen["buffer"] * float(layout.frame_rate))
        numbers[kernels.GROUP_BITS] = chosen["bitrate"] * per_frame * chosen["gof"]
    unit = layout.skeleton.unit_cm if layout.skeleton is not None else None
    is_derived = layout.skeleton is not None and layout.skeleton.base is not None
    slope, offset = FITS["bvh" if is_derived else "c3d"]
    numbers[kernels.AHEAD] += numbers[kernels.OWED]
    numbers[kernels.OWED] = numbers[kernels.EXTRA] = 0.0
    numbers[kernels.MODE] = MODES.index(mode)
    numbers[kernels.GROUP_FRAMES] = chosen["gof"]
    numbers[kernels.PERIOD] = chosen["intra_period"]
    numbers[kernels.LTR_SHIFT] = math.log2(chosen["ltr_step"])
    floor = FLOOR_STEPS if unit is None else FLOOR_CM / unit / step
    numbers[kernels.FLOOR] = min(max(floor, LEAST_FLOOR), 1 / LEAST_FLOOR) ** 2
    numbers[kernels.ALPHA] = chosen["alpha"]
    numbers[kernels.SLOPE] = slope if chosen["a"] is None else chosen["a"]
    numbers[kernels.OFFSET] = offset if chosen["b"] is None else chosen["b"]
    if mode == "mod":
        numbers[kernels.BASE] = math.log2((chosen["step"] or step) / step)


@cache
def rates() -> tuple[Floats, Floats]:
    """Bits of a quantized Laplacian and Gaussian, by log2 of the step over the deviation."""
    kernels = _kernels()
    at = 2.0 ** (np.arange(kernels.N_RATES) / kernels.PER_OCTAVE - kernels.LOW)
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

    Eq. 3 is the sum of the three terms in the middle of this, which is no entropy at fine steps.
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


@cache
def _kernels() -> ModuleType:
    from mcz.codecs.online import rate_kernels

    return rate_kernels
