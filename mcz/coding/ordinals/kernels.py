"""Compiled: the rows of one group, coded by ``lossless``.

SPEC.md, "Codec 128: lossless", is normative and has the steps below in the same order. One
function serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

import numpy as np

from mcz.coding import residuals
from mcz.coding.mixing import mixed, number
from mcz.coding.residuals import FAULT, bits, clamp, code_residual
from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints, Ints2

# Columns of ``plan``, one row a coded channel.
BASE, DIGITS, DROP, TOP, SCALE, FROM_LAST, N_TAPS, TAPS = range(8)
MAX_TAPS = 8

# Columns of ``track``, what is remembered of a channel.
LAST, FAST, SLOW, SIDE_1, SIDE_2, DIFFERENCES = range(6)
TRACK_SIZE = DIFFERENCES + MAX_TAPS
NEAR, OTHER, BAD = range(3)  # of ``flow``: surprise so far in the row, side of the channel
# before, whether there is no such code

# First context of each kind of bit, and its mixer; residuals come last.
C_SAME, C_UP, C_ZERO, C_FAR, C_MINUS, C_RESIDUAL = 0, 384, 432, 464, 768, 808
M_SAME, M_UP, M_ZERO, M_FAR, M_ZERO_SIGN, M_MINUS, M_RESIDUAL = range(7)
RESIDUALS = C_RESIDUAL, M_RESIDUAL
N_CONTEXTS, N_MIXERS = C_RESIDUAL + residuals.N_CONTEXTS, M_RESIDUAL + residuals.N_MIXERS

DECIMAL_WIDTH, BINARY_WIDTH = 13, 44  # digits of the greatest class in fixed point
MAX_PLAIN = 1 << 44
MAX_DIFFERENCE = 1 << 40
MAX_SCALE = 1 << 52
LAST_POWER = 63
MAX_STEPS_LENGTH = 12
ZERO_CLASS = 1 << 62


def beside(value: int, scale: int) -> int:
    """How large ``value`` is beside ``scale``, in octaves, 0 to 7."""
    return clamp(bits(value) - bits(scale) + 3, 0, 7)


def predict(plan: Ints, track: Ints) -> int:
    total = 16  # LOSS-24
    for tap in range(plan[N_TAPS]):
        total += plan[TAPS + tap] * track[DIFFERENCES + tap]
    return (track[LAST] if plan[FROM_LAST] else 0) + (total >> 5)


def remember(track: Ints, flow: Ints, value: int, predicted: int) -> None:
    """Take in a coded value."""
    difference = clamp(value - track[LAST], -MAX_DIFFERENCE, MAX_DIFFERENCE)  # LOSS-24
    for tap in range(MAX_TAPS - 1, 0, -1):  # LOSS-24
        track[DIFFERENCES + tap] = track[DIFFERENCES + tap - 1]
    track[DIFFERENCES] = difference
    track[LAST] = value
    error = value - predicted
    size = min(abs(error), MAX_PLAIN) << 4
    flow[NEAR] = (flow[NEAR] + bits(size) - bits(track[SLOW])) >> 1
    track[FAST] += (size - track[FAST]) >> 1
    track[SLOW] += (size - track[SLOW]) >> 5
    track[SIDE_2] = track[SIDE_1]
    track[SIDE_1] = 0 if error == 0 else 1 if error > 0 else 2


def code_error(
    state: Ints,
    data: Bytes,
    error: int,
    negative: int,
    scales: tuple[int, int],
    track: Ints,
    flow: Ints,
) -> int:
    """Code what the prediction of a channel missed, or return FAULT."""
    near = clamp(flow[NEAR] + 3, 0, 7)
    sides = track[SIDE_1], track[SIDE_2], flow[OTHER]
    return code_residual(state, data, error, negative, scales, near, sides, RESIDUALS)


def code_class(
    state: Ints, data: Bytes, own: int, zero: int, size: int, fast: int, slow: int, base: Ints
) -> int:
    """Code the class ``own`` of a number whose size is predicted, or that it is zero.

    ``base`` are the powers of the base. Returns the class, ZERO_CLASS, or FAULT for one too far.
    """
    guess = 0
    while base[guess] <= size:
        guess += 1
    under = size - (base[guess - 1] if guess > 0 else 0)
    over = base[guess] - size
    upper = 0 if under < over else 1  # LOSS-27
    rf, rs = beside(min(under, over), fast), beside(min(under, over), slow)
    a = C_SAME + 2 * (8 * rf + rs) + upper
    b = C_SAME + 128 + 8 * clamp(bits(size) - bits(slow) + 3, 0, 11) + rs
    c = C_SAME + 224 + 8 * min(guess, 15) + rf
    same = 1 if zero == 0 and own == guess else 0
    if mixed(state, data, same, M_SAME, a, b, c):
        return guess
    greater = 1 if zero == 0 and own > guess else 0
    greater = mixed(state, data, greater, M_UP, C_UP + upper, C_UP + 2 + rf, C_UP + 10 + rs)
    if greater == 0 and mixed(
        state, data, zero, M_ZERO, C_ZERO + upper, C_ZERO + 2 + rf, C_ZERO + 10 + rs
    ):
        return ZERO_CLASS
    steps = code_steps(state, data, abs(own - guess) - 1, greater, rf, rs)
    if steps < 0:
        return FAULT
    return guess + 1 + steps if greater else guess - 1 - steps


def code_steps(state: Ints, data: Bytes, steps: int, greater: int, rf: int, rs: int) -> int:
    """Code how far beyond its neighbor a class is; -1 where that is too far."""
    length = bits(max(steps, 0))
    at = 0
    while at <= MAX_STEPS_LENGTH:  # LOSS-28
        a, b = C_FAR + 2 * at + greater, C_FAR + 32 + 8 * at + rf
        c = C_FAR + 160 + 8 * at + rs
        if not mixed(state, data, 1 if length > at else 0, M_FAR, a, b, c):
            break
        at += 1
    if at > MAX_STEPS_LENGTH:
        return -1
    return at if at < 2 else 1 << (at - 1) | number(state, data, steps, at - 1)


def code_plain(
    state: Ints, data: Bytes, ordinal: int, predicted: int, plan: Ints, track: Ints, flow: Ints
) -> int:
    """Code an ordinal as an integer and return it; set BAD where there is no such code."""
    predicted = clamp(predicted, -MAX_PLAIN, MAX_PLAIN)  # LOSS-25
    value = ordinal >> plan[DROP]
    scales = track[FAST], track[SLOW]
    residual = code_error(state, data, value - predicted, 0, scales, track, flow)
    if residual == FAULT or not -MAX_PLAIN <= predicted + residual < MAX_PLAIN:  # LOSS-26
        flow[BAD] = 1
        return 0
    value = predicted + residual
    remember(track, flow, value, predicted)
    return int(value << plan[DROP]) | number(state, data, ordinal, plan[DROP])  # LOSS-25


def code_scaled(
    state: Ints,
    data: Bytes,
    ordinal: int,
    predicted: int,
    plan: Ints,
    track: Ints,
    flow: Ints,
    powers: Ints,
) -> int:
    """Code an ordinal as class, sign and mantissa; return it, or set BAD."""
    width = DECIMAL_WIDTH if plan[BASE] == 10 else BINARY_WIDTH
    low = powers[plan[DIGITS] - 1]
    per_class = low * (plan[BASE] - 1)
    first = 1 if plan[BASE] == 10 else 0  # the magnitude of the least mantissa of class 0
    negative = 1 if ordinal < 0 else 0
    magnitude = (ordinal ^ (ordinal >> 63)) >> plan[DROP]
    shift = width - plan[TOP]
    own = (magnitude - first) // per_class + shift
    predicted = clamp(predicted, 1 - powers[width], powers[width] - 1)
    zero = 1 if magnitude == 0 else 0
    found = code_class(state, data, own, zero, abs(predicted), track[FAST], track[SLOW], powers)
    if found == FAULT or (found != ZERO_CLASS and not 0 <= found - shift <= plan[TOP]):  # LOSS-29
        flow[BAD] = 1
        return 0
    if found == ZERO_CLASS:
        negative = mixed(
            state, data, negative, M_ZERO_SIGN, C_MINUS + 32, C_MINUS + 33, C_MINUS + 34
        )
        remember(track, flow, 0, predicted)
        return -1 if negative else 0  # LOSS-27
    negative = code_sign(state, data, negative, predicted, found, track, powers)
    digits_off = max(found - plan[DIGITS], -LAST_POWER)
    guess = low
    if (predicted < 0) == (negative == 1):
        guess = to_mantissa(abs(predicted), digits_off, low, low * plan[BASE] - 1, powers)
    scales = to_scale(track, digits_off, powers)
    mantissa = (magnitude - first) % per_class + low
    residual = code_error(state, data, mantissa - guess, negative, scales, track, flow)
    if residual == FAULT or not low <= guess + residual < low * plan[BASE]:  # LOSS-30
        flow[BAD] = 1
        return 0
    mantissa = guess + residual
    value = from_mantissa(mantissa, digits_off, powers)
    remember(track, flow, -value if negative else value, predicted)
    magnitude = int((found - shift) * per_class + first + mantissa - low << plan[DROP])
    return -1 - magnitude if negative else magnitude


def code_ordinal(
    state: Ints,
    data: Bytes,
    ordinal: int,
    predicted: int,
    plan: Ints,
    track: Ints,
    flow: Ints,
    powers: Ints2,
) -> int:
    """Code an ordinal against what is ``predicted``; return it, or set BAD."""
    if plan[BASE] == 0:
        found = code_plain(state, data, ordinal, predicted, plan, track, flow)
    else:
        base = powers[1 if plan[BASE] == 10 else 0]
        found = code_scaled(state, data, ordinal, predicted, plan, track, flow, base)
    flow[OTHER] = track[SIDE_1]  # LOSS-24
    return found


def code_sign(
    state: Ints, data: Bytes, negative: int, predicted: int, own: int, track: Ints, powers: Ints
) -> int:
    """Code the sign of a number that is not zero, against that of its prediction."""
    size = abs(predicted)
    f, s = beside(size, track[FAST]), beside(size, track[SLOW])
    inside = size < powers[own] and (own == 0 or size >= powers[own - 1]) if own >= 0 else False
    c = C_MINUS + 16 + (f if inside else 8 + s)  # LOSS-27
    other = 1 if (predicted < 0) != (negative == 1) else 0
    other = mixed(state, data, other, M_MINUS, C_MINUS + f, C_MINUS + 8 + s, c)
    return 1 if (predicted < 0) != (other == 1) else 0


def to_mantissa(size: int, shift: int, low: int, high: int, powers: Ints) -> int:
    """A predicted size in fixed point as a mantissa: size / base^shift within low to high."""
    if shift >= 0:
        return clamp((size + powers[shift] // 2) // powers[shift], low, high)
    if size == 0:
        return low
    if powers[-shift] > high // size:
        return high
    return clamp(size * powers[-shift], low, high)


def from_mantissa(mantissa: int, shift: int, powers: Ints) -> int:
    """A mantissa in fixed point: mantissa * base^shift, halves up."""
    if shift >= 0:
        return int(mantissa * powers[shift])
    if powers[-shift] > 2 * mantissa:
        return 0
    return int((mantissa + powers[-shift] // 2) // powers[-shift])  # LOSS-27


def to_scale(track: Ints, shift: int, powers: Ints) -> tuple[int, int]:
    """The scales of a channel in units of its mantissa."""
    if shift >= 0:
        return track[FAST] // powers[shift], track[SLOW] // powers[shift]
    unit = min(powers[-shift], MAX_SCALE)
    most = MAX_SCALE // unit
    return min(track[FAST], most) * unit, min(track[SLOW], most) * unit


@kernel
def code_rows(state: Ints, data: Bytes, ordinals: Ints2, plans: Ints2, powers: Ints2) -> int:
    """Code all rows of (n_rows, n_channels) ordinals in place; return the row of a fault or -1.

    ``powers`` has the powers of 2 in row 0 and those of 10 in row 1.
    """
    n_channels = len(plans)
    tracks = np.zeros((n_channels, TRACK_SIZE), np.int64)
    tracks[:, FAST] = tracks[:, SLOW] = plans[:, SCALE]
    flow = np.zeros(3, np.int64)
    for row in range(len(ordinals)):
        flow[NEAR], flow[OTHER] = 0, 3
        for channel in range(n_channels):
            plan, track, given = plans[channel], tracks[channel], ordinals[row, channel]
            predicted = predict(plan, track)
            found = code_ordinal(state, data, given, predicted, plan, track, flow, powers)
            if flow[BAD]:
                return row
            ordinals[row, channel] = found
    return -1
