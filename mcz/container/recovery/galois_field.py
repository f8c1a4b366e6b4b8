"""GF(2^16): its elements are 16-bit integers, and adding is exclusive or.

No library fits: galois has the field, at some million products a second in arrays of its own; the
quick ones (zfec, leopard) are of GF(2^8), under other licences, or not on PyPI.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

POLYNOMIAL = 0x1100B  # x^16 + x^12 + x^3 + x + 1, of which 2 is a generator
ORDER = (1 << 16) - 1  # of the elements but 0
BITS = 16


@cache
def logarithms() -> tuple[Ints, Ints]:
    """``exp[i] = 2^i`` for 0 <= i < 2 ORDER, and ``log``, whose entry for 0 is of no use."""
    exp = np.zeros(2 * ORDER, np.int64)
    value = 1
    for power in range(ORDER):
        exp[power] = exp[power + ORDER] = value
        value <<= 1
        if value > ORDER:
            value ^= POLYNOMIAL
    log = np.zeros(ORDER + 1, np.int64)
    log[exp[:ORDER]] = np.arange(ORDER)
    return exp, log


def times(a: int, b: int) -> int:
    """The product of two elements.

    >>> times(0x8000, 2) == 0x100B, times(7, 0)
    (True, 0)
    """
    if not a or not b:
        return 0
    exp, log = logarithms()
    return int(exp[log[a] + log[b]])


def over(a: int, b: int) -> int:
    """``a / b``, where ``b`` is not 0."""
    if not a:
        return 0
    exp, log = logarithms()
    return int(exp[(log[a] - log[b]) % ORDER])


def log_of_product(values: Ints, axis: int = 0) -> Ints:
    """Logarithms of the products of elements, none of which is 0, along an axis."""
    _, log = logarithms()
    return np.asarray(log[values].sum(axis) % ORDER)


@cache
def skews() -> Ints:
    """(16, 16): entry [i, b] is the i-th normalized subspace polynomial at 2^b.

    s_0(x) = x, s_(i+1)(x) = s_i(x) (s_i(x) + s_i(2^i)); what is given is s_i(x) / s_i(2^i). It is
    linear, so that its value anywhere is a sum of these. Source: Lin, Chung and Han, "Novel
    polynomial basis and its application to Reed-Solomon erasure codes", FOCS 2014.
    """
    rows = [[1 << b for b in range(BITS)]]
    for i in range(BITS - 1):
        own = rows[i][i]
        rows.append([times(value, value ^ own) for value in rows[i]])
    table = [[over(value, row[i]) for value in row] for i, row in enumerate(rows)]
    return np.array(table, np.int64)
