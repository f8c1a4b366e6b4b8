"""Compiled: which quantizer step a frame has, so that groups of frames have the bits they may have.

An encoder's alone: the step of a frame travels with it. Source: C.-H. Kwak, I. V. Bajic, Online
MoCap data coding with bit allocation, rate control, and motion-adaptive post-processing,
Algorithms 1 and 2; SPEC.md, "Choices of an encoder of online".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.jit import inner

Floats = NDArray[np.float64]

STR, LTR, INTRA = 0, 1, 2  # what a frame is predicted from: the last, the last LTR, nothing

# How the step is chosen: it is fixed; Algorithm 1; Algorithm 2; ours.
MOD, RC, RCA, STEADY = range(4)

# Places in ``plan``: what is asked for, steps as log2 in units of the signal's step ...
MODE, GROUP_BITS, GROUP_FRAMES, BASE, LTR_SHIFT, FLOOR, ALPHA, SLOPE, OFFSET, PERIOD = range(10)
BUFFER = 10  # frames
# ... and what is remembered: bits that the group may have and has had, its frames so far, variances
# of decoded coefficients: of the reference, the last LTR, a group's STR frames on average ...
DUE, SPENT, AT, VARIANCE, LTR_VARIANCE, STR_VARIANCE, STR_SUM, LTR_BITS = range(11, 19)
# ... bits beyond the rate, what an intra coded LTR took beyond another, bits at a step of 1.
AHEAD, EXTRA, STR_COST, LTR_COST, PLAN_SIZE = range(19, 24)

UNKNOWN = -1.0
MOST_ALPHA = 200.0
NEVER = 1e3  # log2 of a step with which all coefficients are 0
FALL = 0.9  # of STEADY: log2 of the bits falls by so much where log2 of the step rises by 1
FOLLOW = 2.0  # costs follow what frames cost by this share in a buffer's time
LEAST_SHARE, LEAST_BITS = 0.1, 0.3  # of the bits of a group; of a frame
FIRST_COST = 8.0  # of an LTR, where none is known, in costs of an STR

# Rates are tabled by log2 of the step over the deviation: from -LOW on, PER_OCTAVE a doubling.
LOW, PER_OCTAVE, N_RATES = 16.0, 16.0, 384


@inner
def log_step(rates: Floats, bits: float, variance: float) -> float:
    """log2 of the step at which a coefficient of that variance takes so many bits.

    ``rates`` (N_RATES,) falls; what is beyond its ends gets them.
    """
    low, high = 0, len(rates) - 1
    if bits <= rates[high]:
        return NEVER
    while high - low > 1:
        middle = (low + high) // 2
        if rates[middle] > bits:
            low = middle
        else:
            high = middle
    part = min(max((rates[low] - bits) / max(rates[low] - rates[high], 1e-12), 0.0), 1.0)
    return float((low + part) / PER_OCTAVE - LOW + 0.5 * np.log2(variance))


@inner
def begin_group(plan: Floats, n_frames: int) -> None:
    """What the group that begins may have: its share, and what the last one left or overdrew."""
    carry = plan[DUE] - plan[SPENT] if plan[AT] > 0 else 0.0
    if plan[AT] > 1:
        plan[STR_VARIANCE] = plan[STR_SUM] / (plan[AT] - 1)
    plan[DUE] = plan[GROUP_BITS] * (n_frames / plan[GROUP_FRAMES]) + carry
    plan[SPENT] = plan[AT] = plan[STR_SUM] = 0.0


@inner
def _alpha(plan: Floats, n_frames: int, n_coefficients: int) -> float:
    """The bits of an LTR coefficient for each of an STR one, eq. 17; from 1 to MOST_ALPHA."""
    if plan[MODE] == RC or plan[LTR_VARIANCE] < 0 or plan[STR_VARIANCE] < 0:
        return float(plan[ALPHA])
    above = max(plan[LTR_VARIANCE], plan[FLOOR])
    ratio = np.log2(above / max(plan[STR_VARIANCE], plan[FLOOR] / 100))
    more = (0.5 + plan[SLOPE]) * ratio + plan[OFFSET]
    rest = plan[DUE] / n_coefficients - more
    if rest <= 1e-6:
        return MOST_ALPHA
    return float(min(max(1.0 + n_frames * more / rest, 1.0), MOST_ALPHA))


@inner
def _steady_step(plan: Floats) -> float:
    """log2 of the step with which a group, costing what the last ones did, has its bits."""
    if plan[STR_COST] <= 0:
        return float(plan[BASE])
    n_frames = plan[GROUP_FRAMES]
    of_ltr = plan[LTR_COST] if plan[LTR_COST] > 0 else FIRST_COST * plan[STR_COST]
    cost = of_ltr * 2.0 ** (-FALL * plan[LTR_SHIFT]) + plan[STR_COST] * (n_frames - 1)
    due = plan[GROUP_BITS] - plan[AHEAD] * n_frames / plan[BUFFER]
    if plan[PERIOD] > 0:
        due -= plan[EXTRA] / plan[PERIOD]
    return float(np.log2(cost / max(due, LEAST_SHARE * plan[GROUP_BITS])) / FALL)


@inner
def ltr_step(
    plan: Floats, coefficients: Floats, intra: bool, n_frames: int, laplace: Floats
) -> float:
    """log2 of the step of an LTR frame, of a group of ``n_frames``."""
    if plan[MODE] == STEADY:
        plan[BASE] = _steady_step(plan)
    if plan[MODE] == MOD or plan[MODE] == STEADY or (intra and plan[LTR_VARIANCE] >= 0):
        return float(plan[BASE] + plan[LTR_SHIFT])
    alpha = _alpha(plan, n_frames, len(coefficients))
    bits = alpha * plan[DUE] / (len(coefficients) * (alpha + n_frames - 1))
    variance = plan[LTR_VARIANCE]
    if variance < 0:  # no reference yet: the frame itself is at hand
        variance = float(np.mean(coefficients * coefficients))
    return log_step(laplace, bits, max(variance, plan[FLOOR]))


@inner
def str_step(plan: Floats, n_coefficients: int, n_frames: int, gauss: Floats) -> float:
    """log2 of the step of an STR frame, of a group of ``n_frames``."""
    if plan[MODE] == STEADY:
        plan[BASE] = _steady_step(plan)
    if plan[MODE] == MOD or plan[MODE] == STEADY:
        return float(plan[BASE])
    left = n_frames - plan[AT]
    bits = (plan[DUE] - plan[SPENT]) / (n_coefficients * left)
    return log_step(gauss, bits, max(plan[VARIANCE], plan[FLOOR]))


@inner
def settle(plan: Floats, kind: int, used: float, bits: float, variance: float) -> None:
    """Take in a frame: log2 of its step, its bits, the variance of its decoded coefficients."""
    plan[SPENT] += bits
    plan[AT] += 1
    plan[VARIANCE] = variance
    if plan[MODE] == STEADY:
        _settle_steady(plan, kind, used, bits)
    if kind == STR:
        plan[STR_SUM] += variance
    elif kind == LTR:
        plan[LTR_VARIANCE], plan[LTR_BITS] = variance, bits
        if plan[MODE] != MOD:
            plan[BASE] = min(used, 64.0) - plan[LTR_SHIFT]


@inner
def _settle_steady(plan: Floats, kind: int, used: float, bits: float) -> None:
    """What lies beyond the rate, and what frames cost now.

    What an intra coded LTR takes beyond another is shared out among all frames up to the next.
    """
    plan[AHEAD] += bits - plan[GROUP_BITS] / plan[GROUP_FRAMES]
    cost = max(bits, LEAST_BITS) * 2.0 ** (FALL * used)
    if kind == STR:
        plan[STR_COST] = _followed(plan[STR_COST], cost, FOLLOW / plan[BUFFER])
    elif kind == LTR:
        share = FOLLOW * plan[GROUP_FRAMES] / plan[BUFFER]
        plan[LTR_COST] = _followed(plan[LTR_COST], cost, share)
    elif plan[PERIOD] > 0:
        usual = plan[LTR_BITS] if plan[LTR_BITS] >= 0 else bits / 4
        plan[EXTRA] = max(bits - usual, 0.0)
        plan[AHEAD] -= plan[EXTRA]
    if plan[PERIOD] > 0:
        plan[AHEAD] += plan[EXTRA] / (plan[PERIOD] * plan[GROUP_FRAMES])


@inner
def _followed(before: float, now: float, share: float) -> float:
    return now if before <= 0 else before + (now - before) * min(share, 1.0)
