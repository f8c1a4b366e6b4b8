"""Compiled: a binary range coder, and logistic mixing of the predictions of three contexts.

One function serves encoder and decoder, so that the two cannot drift apart: an encoder codes the
bit that it is given and returns it; a decoder returns the bit that it finds. SPEC.md, "Entropy
coding", is normative. The tables of the logistic mixer are made from 33 stored numbers by integer
arithmetic alone, so that every machine has the same.

The whole state of a coder is one array of int64: compiling and calling with one array is several
times faster than with five.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from mcz.kernels import kernel
from mcz.kernels.types import Bytes, Ints

# 65536 / (1 + exp(-k / 2)) for k = -16 to 16, rounded: squash is linear between them.
NODES = (
    *(22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743),
    *(32768,),
    # RANGE-05
    *(40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374),
    *(65438, 65476, 65500, 65514),
)
LIMIT = 2047  # of a stretched probability
COUNT_LIMIT = 250  # from here on the learning rate of a probability stays constant (RANGE-05)


@cache
def squash_table() -> Ints:
    """squash(x) at index x + 2048: 65536 times the probability of a stretched x, int64 (4096,)."""
    x = np.arange(4096)
    node, weight = x >> 7, x & 127
    nodes = np.array(NODES, np.int64)
    table: Ints = (nodes[node] * (128 - weight) + nodes[node + 1] * weight + 64) >> 7
    return table


@cache
def stretch_table() -> Ints:
    """stretch at index p >> 4: the least x in -2047 to 2047 whose squash is >= 16 (p >> 4) + 8."""
    reachable = squash_table()[1:]  # x from -2047
    targets = 16 * np.arange(4096) + 8  # RANGE-05
    table: Ints = np.searchsorted(reachable, targets) - LIMIT
    return np.minimum(table, LIMIT)


@cache
def rate_table() -> Ints:
    """65536 / (n + 2), rounded down: the learning rate of a probability after n uses."""
    return 65536 // (np.arange(COUNT_LIMIT + 1, dtype=np.int64) + 2)


# Indices in ``state``: the ends of the interval, the 32 bits within it, the index in the data,
# whether it encodes; then the tables, the weights of 64 mixers, the models.
LOW, HIGH, CODE, POSITION, ENCODING = range(5)
SQUASH, STRETCH, RATES = 8, 8 + 4096, 8 + 8192
WEIGHTS = RATES + 256
MODELS = WEIGHTS + 3 * 64
TOP = 0xFFFFFFFF
MAX_WEIGHT = 1 << 24
LEAST_ONE = 32  # of 65536: the least probability of a bit that one context codes (RANGE-06)


@kernel
def start(state: Ints, data: Bytes, encoding: int) -> None:
    """Make ``state`` ready; a decoder takes in the first four bytes of ``data``."""
    state[LOW], state[HIGH], state[CODE], state[POSITION] = 0, TOP, 0, 0
    state[ENCODING] = encoding
    if encoding == 0:
        for _ in range(4):
            state[CODE] = state[CODE] << 8 | _next(state, data)


def _next(state: Ints, data: Bytes) -> int:
    """The next byte; zeros follow the end of the data."""
    at = state[POSITION]
    state[POSITION] = at + 1
    return int(data[at]) if at < len(data) else 0  # RANGE-02


def _put(state: Ints, data: Bytes, byte: int) -> None:
    """Add a byte; if ``data`` is full, only count it, and the caller tries a longer one."""
    at = state[POSITION]
    state[POSITION] = at + 1
    if at < len(data):
        data[at] = byte


def code_bit(state: Ints, data: Bytes, bit: int, one: int) -> int:
    """Code a bit that is 1 with probability ``one`` / 65536, 0 < one < 65536."""
    low, high = state[LOW], state[HIGH]
    width = high - low
    middle = low + (width >> 16) * one + ((width & 0xFFFF) * one >> 16)  # RANGE-01
    if state[ENCODING] == 0:
        bit = 1 if state[CODE] <= middle else 0  # RANGE-01
    if bit:
        high = middle
    else:
        low = middle + 1
    while (low ^ high) >> 24 == 0:
        if state[ENCODING]:
            _put(state, data, high >> 24)
        else:
            state[CODE] = (state[CODE] << 8 & TOP) | _next(state, data)
        low, high = low << 8 & TOP, (high << 8 & TOP) | 255
    state[LOW], state[HIGH] = low, high
    return bit


def last_bytes(state: Ints) -> int:
    """Number of bytes that, followed by zeros, determine the bits still in the interval."""
    for size in range(4):  # RANGE-04
        unit = 1 << (32 - 8 * size)
        if (state[LOW] + unit - 1) // unit * unit <= state[HIGH]:
            return size
    return 4


@kernel
def finish(state: Ints, data: Bytes) -> int:
    """Write the last bytes and return the size of the data."""
    size = last_bytes(state)
    unit = 1 << (32 - 8 * size)
    value = (state[LOW] + unit - 1) // unit * unit
    for index in range(size):
        _put(state, data, value >> (24 - 8 * index) & 255)
    return int(state[POSITION])


@kernel
def coded_size(state: Ints) -> int:
    """After the last bit was decoded: the bytes that an encoder has written."""
    return int(state[POSITION] - 4 + last_bytes(state))


def code_bits(state: Ints, data: Bytes, value: int, n_bits: int) -> int:
    """Code the low ``n_bits`` of ``value``, the highest first, each bit as likely 0 as 1."""
    out = 0
    for shift in range(n_bits - 1, -1, -1):
        out = out << 1 | code_bit(state, data, value >> shift & 1, 32768)  # RANGE-03
    return out


def code_mixed(state: Ints, data: Bytes, bit: int, mixer: int, a: int, b: int, c: int) -> int:
    """Code a bit with the mixed predictions of three contexts, then update them."""
    a, b, c, w = MODELS + 2 * a, MODELS + 2 * b, MODELS + 2 * c, WEIGHTS + 3 * mixer
    x = state[STRETCH + (state[a] >> 4)]
    y = state[STRETCH + (state[b] >> 4)]
    z = state[STRETCH + (state[c] >> 4)]
    dot = (state[w] * x + state[w + 1] * y + state[w + 2] * z) >> 16
    one = state[SQUASH + 2048 + min(max(dot, -LIMIT), LIMIT)]
    bit = code_bit(state, data, bit, one)
    error = (bit << 16) - one
    _weigh(state, w, x * error)
    _weigh(state, w + 1, y * error)
    _weigh(state, w + 2, z * error)
    target = 65535 if bit else 0
    _learn(state, a, target)
    _learn(state, b, target)
    _learn(state, c, target)
    return bit


def code_adaptive(state: Ints, data: Bytes, bit: int, context: int) -> int:
    """Code a bit with the prediction of one context, then update it."""
    at = MODELS + 2 * context
    bit = code_bit(state, data, bit, min(max(state[at], LEAST_ONE), 65536 - LEAST_ONE))
    _learn(state, at, 65535 if bit else 0)
    return bit


def _weigh(state: Ints, weight: int, change: int) -> None:
    # RANGE-05
    state[weight] = min(max(state[weight] + ((change + 8192) >> 14), -MAX_WEIGHT), MAX_WEIGHT)


def _learn(state: Ints, context: int, target: int) -> None:
    count = state[context + 1]
    state[context] += ((target - state[context]) * state[RATES + count]) >> 16
    if count < COUNT_LIMIT:
        state[context + 1] = count + 1
