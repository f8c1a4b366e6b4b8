"""Tables of the logistic mixer: ``squash``, its inverse ``stretch``, and the learning rates.

Made from 33 stored numbers by integer arithmetic alone, so that every machine has the same.
SPEC.md, "Entropy coding", is normative.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from mcz.model.types import Ints

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
