"""Compiled: one number of ``best``, coded against what is predicted.

SPEC.md, "Codec 2: best", is normative. A number of digits is counted in units of its class or of
the one above, so that its class need not be coded; digits below the unit come after it.
"""

from __future__ import annotations

from mcz.coding import residuals
from mcz.coding.mixing import adaptive, code, number
from mcz.coding.ordinals.kernels import (
    BAD,
    BASE,
    BINARY_WIDTH,
    DECIMAL_WIDTH,
    DIGITS,
    DROP,
    FAST,
    LAST,
    LAST_POWER,
    MAX_PLAIN,
    NEAR,
    OTHER,
    SIDE_1,
    SIDE_2,
    SLOW,
    TOP,
    from_mantissa,
    remember,
)
from mcz.coding.residuals import FAULT, bits, clamp, code_residual
from mcz.kernels.types import Bytes, Ints, Ints2

# First context of each kind of bit; residuals come last.
C_ZERO, C_MINUS, C_DOWN, C_RESIDUAL = 0, 2, 4, 17
RESIDUALS = C_RESIDUAL, 0
N_CONTEXTS, N_MIXERS = C_RESIDUAL + residuals.N_CONTEXTS, residuals.N_MIXERS

MAX_DOWN_LENGTH = 12
EIGHT_OR_NINE = 13107  # of 65536: a fifth of the decimal digits


def code_number(
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
        return code_plain(state, data, ordinal, predicted, plan, track, flow)
    base = powers[1 if plan[BASE] == 10 else 0]
    return code_digits(state, data, ordinal, predicted, plan, track, flow, base)


def code_plain(
    state: Ints, data: Bytes, ordinal: int, predicted: int, plan: Ints, track: Ints, flow: Ints
) -> int:
    """Code an integer and return it; set BAD where there is no such code."""
    value = ordinal >> plan[DROP]
    residual = code_error(state, data, value - predicted, 1, track, flow)
    if residual == FAULT or not -MAX_PLAIN <= predicted + residual < MAX_PLAIN:  # BEST-13
        flow[BAD] = 1
        return 0
    value = predicted + residual
    remember(track, flow, value, predicted)
    return int(value << plan[DROP]) | number(state, data, ordinal, plan[DROP])


def code_error(state: Ints, data: Bytes, error: int, unit: int, track: Ints, flow: Ints) -> int:
    """Code what the prediction missed, counted in ``unit``, or return FAULT."""
    scales = track[FAST] // unit, track[SLOW] // unit
    near = clamp(flow[NEAR] + 3, 0, 7)
    sides = track[SIDE_1], track[SIDE_2], flow[OTHER]
    return code_residual(state, data, error, 0, scales, near, sides, RESIDUALS)


def code_digits(
    state: Ints,
    data: Bytes,
    ordinal: int,
    predicted: int,
    plan: Ints,
    track: Ints,
    flow: Ints,
    powers: Ints,
) -> int:
    """Code a number of digits and a class; return its ordinal, or set BAD."""
    width = DECIMAL_WIDTH if plan[BASE] == 10 else BINARY_WIDTH
    n_digits, first = plan[DIGITS], 1 if plan[BASE] == 10 else 0
    low = powers[n_digits - 1]
    per_class = low * (plan[BASE] - 1)
    least = width - plan[TOP]
    limit = powers[width] - 1
    predicted = clamp(predicted, -limit, limit)
    bound = min(abs(predicted) + (track[SLOW] >> 1), limit)
    unit = max(class_of(bound, plan[BASE], powers) - n_digits, 0)  # BEST-12
    negative, magnitude = 1 if ordinal < 0 else 0, (ordinal ^ (ordinal >> 63)) >> plan[DROP]
    own = (magnitude - first) // per_class + least
    mantissa = (magnitude - first) % per_class + low if magnitude > 0 else 0
    count = in_units(mantissa, own - n_digits - unit, powers)
    guess = (abs(predicted) + (powers[unit] >> 1)) // powers[unit]
    guess = -guess if predicted < 0 else guess
    wanted = -count if negative else count
    residual = code_error(state, data, wanted - guess, powers[unit], track, flow)
    if residual == FAULT:
        flow[BAD] = 1
        return 0
    count = guess + residual
    if count == 0:
        negative, own, mantissa = code_small(
            state, data, negative, own, mantissa, predicted, unit, plan, track, powers
        )
    else:
        negative, own = 1 if count < 0 else 0, class_of(abs(count), plan[BASE], powers) + unit
        mantissa = code_rest(state, data, mantissa, abs(count), own - n_digits - unit, plan, powers)
    if own == ZERO:
        remember(track, flow, 0, predicted)
        return -1 if negative else 0
    if mantissa < low or not least <= own <= width:  # BEST-15, BEST-16, BEST-17
        flow[BAD] = 1
        return 0
    value = from_mantissa(mantissa, max(own - n_digits, -LAST_POWER), powers)
    remember(track, flow, -value if negative else value, predicted)
    magnitude = int((own - least) * per_class + first + mantissa - low << plan[DROP])
    return -1 - magnitude if negative else magnitude


ZERO = -(1 << 40)  # the class of zero


def class_of(size: int, base: int, powers: Ints) -> int:
    """How many digits ``size`` has."""
    if base == 2:
        return bits(size)
    found = 0
    while powers[found] <= size:
        found += 1
    return found


def in_units(mantissa: int, shift: int, powers: Ints) -> int:
    """mantissa * base^shift, rounded down."""
    if shift >= 0:
        return int(mantissa * powers[min(shift, LAST_POWER)])
    return int(mantissa // powers[min(-shift, LAST_POWER)])


def code_rest(
    state: Ints, data: Bytes, mantissa: int, count: int, shift: int, plan: Ints, powers: Ints
) -> int:
    """Code the digits below ``count`` units and return the mantissa; -1 where there is none."""
    if shift < 0:
        rest = code_below(state, data, mantissa, -shift, plan[BASE])
        return int(count * powers[-shift]) + rest
    unit = powers[min(shift, LAST_POWER)]
    return int(count // unit) if count % unit == 0 else -1


def code_small(
    state: Ints,
    data: Bytes,
    negative: int,
    own: int,
    mantissa: int,
    predicted: int,
    unit: int,
    plan: Ints,
    track: Ints,
    powers: Ints,
) -> tuple[int, int, int]:
    """Code a number below the unit: its sign, class and mantissa, which is 0 for a bad one."""
    zero = adaptive(state, data, 1 if mantissa == 0 else 0, C_ZERO + (1 if track[LAST] == 0 else 0))
    negative = adaptive(state, data, negative, C_MINUS + (1 if predicted < 0 else 0))
    if zero:
        return negative, ZERO, 0
    down = code_down(state, data, unit - own)
    if down < 0:
        return negative, 0, 0
    low = powers[plan[DIGITS] - 1]
    lead = 1 if plan[BASE] == 2 else code_digit(state, data, mantissa // low)
    rest = code_below(state, data, mantissa, plan[DIGITS] - 1, plan[BASE])
    return negative, unit - down, lead * low + rest


def code_down(state: Ints, data: Bytes, steps: int) -> int:
    """Code how many classes a number lies below the unit; -1 for too many."""
    length = bits(max(steps, 0))
    at = 0
    while at <= MAX_DOWN_LENGTH:
        if not adaptive(state, data, 1 if length > at else 0, C_DOWN + at):
            break
        at += 1
    if at > MAX_DOWN_LENGTH:  # BEST-14
        return -1
    return at if at < 2 else 1 << (at - 1) | number(state, data, steps, at - 1)


def code_below(state: Ints, data: Bytes, value: int, n_digits: int, base: int) -> int:
    """Code the last digits of ``value``, each as likely as any; the lowest first in base 10."""
    if base == 2:
        return number(state, data, value, n_digits)
    found, weight = 0, 1
    for _ in range(n_digits):
        found += weight * code_digit(state, data, value // weight % 10)
        weight *= 10
    return found


def code_digit(state: Ints, data: Bytes, digit: int) -> int:
    """Code a decimal digit."""
    if code(state, data, 1 if digit >= 8 else 0, EIGHT_OR_NINE):
        return 8 + number(state, data, digit, 1)
    return number(state, data, digit, 3)
