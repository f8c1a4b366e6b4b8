"""Compiled: which quantizer step a frame has, so that groups of frames have the bits they may have.

An encoder's alone: the step of a frame travels with it. Source: C.-H. Kwak, I. V. Bajic, Online
MoCap data coding with bit allocation, rate control, and motion-adaptive post-processing,
Algorithms 1 and 2; mcz/codecs/online/README.md describes it.
"""

from __future__ import annotations

import numpy as np

from mcz.codecs.online.units import LTR, MODES, STR
from mcz.kernels.types import Floats

# How the step is chosen: it is fixed; Algorithm 1; Algorithm 2; ours.
MOD, RC, RCA, STEADY = range(len(MODES))

# Places in ``plan``: what is asked for, steps as log2 in units of the signal's step ...
MODE, GROUP_BITS, GROUP_FRAMES, BASE, LTR_SHIFT, FLOOR, ALPHA, SLOPE, OFFSET, PERIOD = range(10)
BUFFER = 10  # frames
# ... and what is remembered: bits that the group may have and has had, its frames so far, variances
# of decoded coefficients: of the reference, the last LTR, a group's STR frames on average ...
DUE, SPENT, AT, VARIANCE, LTR_VARIANCE, STR_VARIANCE, STR_SUM, LTR_BITS = range(11, 19)
# ... bits beyond the rate, what an intra coded LTR took beyond another and what of that is still to
# be paid, bits at a step of 1.
AHEAD, EXTRA, OWED, STR_COST, LTR_COST = range(19, 24)
# ... of a live stream: bits of the last frame, of the framing of one on average, and what of that
# the group set aside for each of its frames.
LAST, FRAMING, RESERVED, PLAN_SIZE = range(24, 28)

UNKNOWN = -1.0
MOST_ALPHA = 200.0
MOST_CARRY = 8.0  # groups' bits that may be left: what still frames do not need is not owed to all
NEVER = 1e3  # log2 of a step with which all coefficients are 0
FINEST, COARSEST = -8.0, 24.0  # log2 of other steps if a rate is held
INTRA_LEVELS = 3.0  # log2 of the steps that the largest coefficient of an intra coded LTR has
FALL = 0.9  # STEADY: fall of log2(bits) for a rise of log2(step) by 1
FOLLOW = 2.0  # costs follow what frames cost by this share in a buffer's time
LEAST_SHARE, LEAST_BITS = 0.1, 0.3  # share of the bits of a group, and of a frame
FIRST_COST = 8.0  # of an LTR, if none is known, in costs of an STR

# Rates are tabled by log2 of the step over the deviation: from -LOW on, PER_OCTAVE a doubling.
LOW, PER_OCTAVE, N_RATES = 16.0, 16.0, 384


def largest_of(values: Floats) -> float:
    """The greatest magnitude; NaN if one is NaN."""
    largest = 0.0
    for value in values:
        size = abs(value)
        if size > largest or size != size:
            largest = size
    return largest


def log_step(rates: Floats, bits: float, variance: float) -> float:
    """Return log2 of the step at which a coefficient of that variance takes that many bits.

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


def begin_group(plan: Floats, n_frames: int) -> None:
    """Set the budget of a new group: its share, plus or minus the balance of the last one."""
    carry = plan[DUE] - plan[SPENT] if plan[AT] > 0 else 0.0
    carry = min(carry, MOST_CARRY * plan[GROUP_BITS])
    if plan[AT] > 1:
        plan[STR_VARIANCE] = plan[STR_SUM] / (plan[AT] - 1)
    plan[DUE] = plan[GROUP_BITS] * (n_frames / plan[GROUP_FRAMES]) + carry
    plan[RESERVED] = plan[FRAMING]
    plan[DUE] -= plan[RESERVED] * n_frames
    plan[SPENT] = plan[AT] = plan[STR_SUM] = 0.0


def _alpha(plan: Floats, n_frames: int, n_coefficients: int) -> float:
    """The bits of an LTR coefficient for each of an STR one: given, or eq. 17, 1 to MOST_ALPHA."""
    if plan[MODE] == RC or plan[LTR_VARIANCE] < 0 or plan[STR_VARIANCE] < 0:
        return float(plan[ALPHA])
    above = max(plan[LTR_VARIANCE], plan[FLOOR])
    ratio = np.log2(above / max(plan[STR_VARIANCE], plan[FLOOR] / 100))
    more = (0.5 + plan[SLOPE]) * ratio + plan[OFFSET]
    rest = plan[DUE] / n_coefficients - more
    if rest <= 1e-6:
        return MOST_ALPHA
    return float(min(max(1.0 + n_frames * more / rest, 1.0), MOST_ALPHA))


def _steady_step(plan: Floats) -> float:
    """Return log2 of the step that spends a group's bits if it costs as much as the last ones."""
    if plan[STR_COST] <= 0:
        return float(plan[BASE])
    n_frames = plan[GROUP_FRAMES]
    of_ltr = plan[LTR_COST] if plan[LTR_COST] > 0 else FIRST_COST * plan[STR_COST]
    cost = of_ltr * 2.0 ** (-FALL * plan[LTR_SHIFT]) + plan[STR_COST] * (n_frames - 1)
    due = plan[GROUP_BITS] - (plan[FRAMING] + plan[AHEAD] / plan[BUFFER]) * n_frames
    if plan[OWED] > 0:
        due -= plan[EXTRA] / plan[PERIOD]
    change = np.log2(cost / max(due, LEAST_SHARE * plan[GROUP_BITS])) / FALL
    return float(min(max(change, FINEST), COARSEST))


def ltr_step(
    plan: Floats, coefficients: Floats, intra: bool, n_frames: int, laplace: Floats
) -> float:
    """log2 of the step of the LTR frame in a group of ``n_frames``.

    Under a rate, an intra coded frame, which has no prediction, is never all 0.
    """
    step = _ltr_step(plan, coefficients, intra, n_frames, laplace)
    if plan[MODE] == MOD:
        return step
    largest = largest_of(coefficients)
    if intra and largest > 0:
        step = min(step, np.log2(largest) - INTRA_LEVELS)
    return float(max(step, FINEST))


def _ltr_step(
    plan: Floats, coefficients: Floats, intra: bool, n_frames: int, laplace: Floats
) -> float:
    if plan[MODE] == STEADY:
        plan[BASE] = _steady_step(plan)
    if plan[MODE] == MOD or plan[MODE] == STEADY or (intra and plan[LTR_VARIANCE] >= 0):
        return float(plan[BASE] + plan[LTR_SHIFT])
    alpha = _alpha(plan, n_frames, len(coefficients))
    bits = alpha * plan[DUE] / (len(coefficients) * (alpha + n_frames - 1))
    variance = plan[LTR_VARIANCE]
    if variance < 0:  # no reference yet: the frame itself is at hand
        variance = 0.0
        for coefficient in coefficients:
            variance += coefficient * coefficient
        variance /= len(coefficients)
    return log_step(laplace, bits, max(variance, plan[FLOOR]))


def str_step(plan: Floats, n_coefficients: int, n_frames: int, gauss: Floats) -> float:
    """log2 of the step of the STR frames in a group of ``n_frames``."""
    if plan[MODE] == STEADY:
        plan[BASE] = _steady_step(plan)
    if plan[MODE] == MOD or plan[MODE] == STEADY:
        return float(plan[BASE])
    left = n_frames - plan[AT]
    bits = (plan[DUE] - plan[SPENT]) / (n_coefficients * left)
    return max(log_step(gauss, bits, max(plan[VARIANCE], plan[FLOOR])), FINEST)


def settle(plan: Floats, kind: int, used: float, bits: float, variance: float) -> None:
    """Take in a frame: log2 of its step, its bits, the variance of its decoded coefficients."""
    plan[LAST] = bits
    plan[SPENT] += bits
    plan[AT] += 1
    plan[VARIANCE] = variance
    if plan[MODE] == STEADY:
        _settle_steady(plan, kind, used, bits, variance == 0.0)
    if kind == STR:
        plan[STR_SUM] += variance
    elif kind == LTR:
        plan[LTR_VARIANCE], plan[LTR_BITS] = variance, bits
        if plan[MODE] != MOD and used < NEVER:
            plan[BASE] = used - plan[LTR_SHIFT]


def _settle_steady(plan: Floats, kind: int, used: float, bits: float, empty: bool) -> None:
    """Update the excess over the rate and the current cost of frames.

    An ``empty`` frame, in which nothing was coded, gives only an upper bound of the cost. The extra
    bits of an intra coded LTR are spread over all frames up to the next one.
    """
    share = plan[GROUP_BITS] / plan[GROUP_FRAMES]
    plan[AHEAD] = max(plan[AHEAD] + bits - share, -share * plan[BUFFER])
    cost = max(bits, LEAST_BITS) * 2.0 ** (FALL * used)
    before = plan[STR_COST] if kind == STR else plan[LTR_COST]
    if empty and before > 0:
        cost = min(cost, before)
    if kind == STR:
        plan[STR_COST] = _follow_rate(plan[STR_COST], cost, FOLLOW / plan[BUFFER])
    elif kind == LTR:
        part = FOLLOW * plan[GROUP_FRAMES] / plan[BUFFER]
        plan[LTR_COST] = _follow_rate(plan[LTR_COST], cost, part)
    elif plan[PERIOD] > 0:
        usual = plan[LTR_BITS] if plan[LTR_BITS] >= 0 else bits / 4
        plan[EXTRA] = max(bits - usual, 0.0)
        plan[AHEAD] += plan[OWED] - plan[EXTRA]
        plan[OWED] = plan[EXTRA]
    if plan[OWED] > 0:
        paid = min(plan[EXTRA] / (plan[PERIOD] * plan[GROUP_FRAMES]), plan[OWED])
        plan[AHEAD] += paid
        plan[OWED] -= paid


def _follow_rate(before: float, now: float, share: float) -> float:
    return now if before <= 0 else before + (now - before) * min(share, 1.0)
