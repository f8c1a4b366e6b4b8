"""The orthonormal discrete cosine transform, its matrix by + - * / only.

SPEC.md, "Cosines", is normative and has the steps below in the same order: every machine computes
the same numbers, within 1e-15 of the true ones.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mcz.model.types import Floats

HALF_PI = 1.5707963267948966
NEWTON_STEPS = 40  # of a square root; half of them would do


@lru_cache(maxsize=16)
def dct_matrix(n: int) -> Floats:
    """The DCT-II of ``n`` points, (n, n), read-only: row k is the k-th basis vector."""
    if not n:
        return np.zeros((0, 0))
    cosine = _quarter(n)
    root = _root(2.0 / n)
    k, at = np.ogrid[:n, :n]
    turn = (2 * at + 1) * k % (4 * n)  # a full turn is 4 n
    turn = np.where(turn > 2 * n, 4 * n - turn, turn)
    matrix: Floats = np.where(
        turn > n, -cosine[np.minimum(2 * n - turn, n)], cosine[np.minimum(turn, n)]
    )
    matrix *= root
    matrix[:1] = _root(1.0 / n)
    matrix.setflags(write=False)
    return matrix


def _quarter(n: int) -> Floats:
    """cos(m pi / (2 n)) for m = 0 to n."""
    m = np.arange(n + 1)
    x = (np.minimum(m, n - m) * HALF_PI) / n  # COS-01
    square = x * x
    cosine, sine = np.ones(n + 1), np.ones(n + 1)
    for i in range(9, 0, -1):
        cosine = 1.0 - square * cosine / ((2 * i - 1) * (2 * i))
        sine = 1.0 - square * sine / ((2 * i) * (2 * i + 1))
    return np.where(2 * m <= n, cosine, x * sine)  # COS-01


def _root(value: float) -> float:
    """The square root of a number from 2^-20 to 2."""
    root = 1.0
    for _ in range(NEWTON_STEPS):
        root = (root + value / root) / 2.0
    return root  # COS-01
