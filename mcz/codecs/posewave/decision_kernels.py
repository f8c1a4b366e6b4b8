"""Compiled: integers as decisions, each coded by the mixed opinion of several contexts.

SPEC.md, "Rows in the metric", is normative and has the steps below in the same order. One
function serves encoder and decoder. Imported on first use only.
"""

from __future__ import annotations

from mcz.codecs.coding import mixing
from mcz.codecs.coding.mixing import LIMIT, code_adaptive, code_bit, code_bits, code_mixed
from mcz.codecs.coding.residuals import bits
from mcz.codecs.posewave.model_state import (
    C_ESCAPE,
    C_EXTRA,
    C_SIGN,
    COUNT_LIMIT,
    M_SIGN,
    N_INPUTS,
    N_OPINIONS,
    N_SLOTS,
    Model,
)
from mcz.kernels.types import Bytes, Ints

BIAS = 77
INSIDE = (1 << 24) - 1  # bound of slot indices; tells the compiler that none is negative
FIRST_ESCAPED = 49
MOST_LENGTH = 32
LEAST_CHANCE = 16
COST_UNIT = 4096  # of a bit


# Where an integer is coded: its level; sets of weights and second thoughts; contexts of its sign;
# whether the side away from its mean is the negative one; the mean, rounded.
Contexts = tuple[int, int, int, int, int, int, int, int, int]
LEVEL, ONE, OTHER, SECOND, SIGN_1, SIGN_2, SIGN_3, DOWN, ROUNDED = range(9)


def mix(model: Model, slot: int, one: Ints, other: Ints) -> int:
    """The mixed chance of a 1, stretched, from 1 to 4095."""
    slots, at, inputs = model.slots, model.at, model.inputs
    stretch, trust = model.stretch, model.trust
    dot = (one[N_OPINIONS] + other[N_OPINIONS]) * BIAS
    for k in range(N_OPINIONS):
        known = slots[(at[k] + slot) & INSIDE]
        trusted = (stretch[(known >> 12) & 4095] * trust[known & 255]) >> 16
        inputs[k] = trusted
        dot += (one[k] + other[k]) * trusted
    return int(min(max(dot >> 16, -LIMIT), LIMIT)) + 2048


def predict_bit(
    model: Model, slot: int, one: Ints, other: Ints, second: Ints
) -> tuple[int, int, int]:
    """The mixed chance of a 1, that after second thoughts, and the mixed one stretched."""
    x = mix(model, slot, one, other)
    chance = model.squash[x & 4095]
    node, share = (x >> 7) & 31, x & 127
    later = (second[node] * (128 - share) + second[node + 1] * share) >> 7
    final = (chance + later + 1) >> 1
    return chance, min(max(final, LEAST_CHANCE), 65536 - LEAST_CHANCE), x


def learn_bit(
    model: Model, slot: int, one: Ints, other: Ints, second: Ints, bit: int, chance: int, x: int
) -> None:
    """Update all models with a coded bit, after ``predict_bit``."""
    slots, at, inputs, rates = model.slots, model.at, model.inputs, model.rates
    error = (bit << 16) - chance
    inputs[N_OPINIONS] = BIAS
    for k in range(N_INPUTS):
        change = (inputs[k] * error + 32768) >> 16
        one[k] = min(max(one[k] + change, -mixing.MAX_WEIGHT), mixing.MAX_WEIGHT)
        other[k] = min(max(other[k] + change, -mixing.MAX_WEIGHT), mixing.MAX_WEIGHT)
    target = 65535 if bit else 0
    for k in range(N_OPINIONS):
        where = (at[k] + slot) & INSIDE
        known = slots[where]
        p, n = known >> 8, known & 255
        p += ((target - p) * rates[n]) >> 16
        slots[where] = p << 8 | min(n + 1, COUNT_LIMIT)
    node, share = (x >> 7) & 31, x & 127
    second[node] += ((target - second[node]) * (128 - share)) >> 14  # ROWS-05
    second[node + 1] += ((target - second[node + 1]) * share) >> 14


def code_decision(model: Model, data: Bytes, bit: int, slot: int, where: Contexts) -> int:
    """Code a decision, then let the model learn."""
    one, other = model.weights[where[ONE], slot], model.weights[where[OTHER], slot]
    second = model.second[where[SECOND], slot]
    chance, final, x = predict_bit(model, slot, one, other, second)
    bit = code_bit(model.coder, data, bit, final)
    learn_bit(model, slot, one, other, second, bit, chance, x)
    return bit


def code_error(model: Model, data: Bytes, error: int, where: Contexts) -> int:
    """Code by how far an integer misses its rounded mean, and return it."""
    if code_decision(model, data, 1 if error != 0 else 0, 0, where) == 0:
        return 0
    far = (1 if error < 0 else 0) ^ where[DOWN] ^ 1
    signs = C_SIGN + where[SIGN_1], C_SIGN + where[SIGN_2], C_SIGN + where[SIGN_3]
    far = code_mixed(model.coder, data, far, M_SIGN + where[LEVEL], signs[0], signs[1], signs[2])
    model.at[0] += far * N_SLOTS
    size = abs(error)
    bucket, coded_size = bucket_of(size), 1
    while coded_size < N_SLOTS:
        if code_decision(model, data, 1 if bucket > coded_size else 0, coded_size, where) == 0:
            break
        coded_size += 1
    size = code_rest(model.coder, data, size, coded_size, where[LEVEL])
    return -size if far ^ where[DOWN] ^ 1 else size


def bucket_of(size: int) -> int:
    """The buckets are 1, 2, 3, 4, 5-6, 7-8, 9-12, 13-16, 17-24, 25-32, 33-48 and all above."""
    if size < 5:
        return size
    n = bits(size - 1)
    return min(2 * n - 1 + ((size - 1) >> (n - 2) & 1), N_SLOTS)


def code_rest(coder: Ints, data: Bytes, size: int, bucket: int, level: int) -> int:
    """Code which of its bucket a size is."""
    if bucket < 5:
        return bucket
    if bucket < N_SLOTS:
        n = (bucket - 3) >> 1
        low = ((4 if bucket & 1 else 6) << (n - 1)) + 1
        rest = size - low
        top = code_adaptive(coder, data, rest >> (n - 1) & 1, C_EXTRA + bucket)
        return low + (top << (n - 1)) + code_bits(coder, data, rest, n - 1)
    rest = size - FIRST_ESCAPED + 1
    length, coded_rest = bits(max(rest, 0)), 1
    while coded_rest < MOST_LENGTH:
        context = C_ESCAPE + level * MOST_LENGTH + coded_rest
        if code_adaptive(coder, data, 1 if length > coded_rest else 0, context) == 0:
            break
        coded_rest += 1
    rest = 1 << (coded_rest - 1) | code_bits(coder, data, rest, coded_rest - 1)
    return FIRST_ESCAPED - 1 + rest


def costs_of(model: Model, slot: int, where: Contexts) -> tuple[int, int]:
    """Estimate the costs of a 0 and of a 1, in units of ``COST_UNIT``, without side effects."""
    one, other = model.weights[where[ONE], slot], model.weights[where[OTHER], slot]
    chance = model.squash[mix(model, slot, one, other) & 4095]
    return model.costs[(65536 - chance) >> 4], model.costs[chance >> 4]


def cost_of_size(model: Model, error: int, where: Contexts) -> int:
    """Estimate the cost of the rest of ``code_error`` for an error that is not 0."""
    far = (1 if error < 0 else 0) ^ where[DOWN] ^ 1
    signs = C_SIGN + where[SIGN_1], C_SIGN + where[SIGN_2], C_SIGN + where[SIGN_3]
    chance = mixed_chance(model.coder, M_SIGN + where[LEVEL], signs)
    total = model.costs[(chance if far else 65536 - chance) >> 4]
    model.at[0] += far * N_SLOTS
    bucket, slot = bucket_of(abs(error)), 1
    while slot < N_SLOTS:
        last, more = costs_of(model, slot, where)
        if bucket <= slot:
            total += last
            break
        total += more
        slot += 1
    model.at[0] -= far * N_SLOTS
    if bucket >= 5:
        plain = (bucket - 3) >> 1 if bucket < N_SLOTS else 2 * bits(abs(error))
        total += COST_UNIT * plain
    return int(total)


def mixed_chance(coder: Ints, mixer: int, contexts: tuple[int, int, int]) -> int:
    """The probability with which ``mixing.code_mixed`` would code a 1."""
    dot, at = 0, mixing.WEIGHTS + 3 * mixer
    for context in contexts:
        dot += coder[at] * coder[mixing.STRETCH + (coder[mixing.MODELS + 2 * context] >> 4)]
        at += 1
    return int(coder[mixing.SQUASH + 2048 + min(max(dot >> 16, -LIMIT), LIMIT)])
