"""The post filter written out from SPEC.md, "Post filter", one number at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def plain_rows(rows: Floats, rate: float, unit: float) -> Floats:
    """``rows``, one channel a column, NaN where nothing is known, filtered."""
    filters = [plain_taps(cutoff, rate) for cutoff in (1.0, 3.0, 5.0)]
    made = rows.copy()
    for c in range(rows.shape[1]):
        column = rows[:, c].tolist()
        for start, stop in runs([abs(value) < 2.0**40 for value in column]):
            made[start:stop, c] = plain_filter(column[start:stop], filters, unit)
    return made


def runs(known: Sequence[bool]) -> Iterable[tuple[int, int]]:
    """Start and stop of each run of what is known."""
    start = None
    for n, is_known in enumerate([*known, False]):
        if is_known and start is None:
            start = n
        if not is_known and start is not None:
            yield start, n
            start = None


def plain_filter(
    p: Sequence[float], filters: Sequence[Sequence[float]], unit: float
) -> list[float]:
    """A run of known values, filtered; ``unit`` in cm."""
    y: list[float] = []

    def raw(n: int) -> float:
        return p[max(0, min(n, len(p) - 1))]

    def past(n: int) -> float:
        return y[n] if n >= 0 else p[0]

    low, high = 2.0 / unit, 12.0 / unit
    for n, value in enumerate(p):
        v = past(n - 1) - past(n - 2)
        a = v - (past(n - 2) - past(n - 3))
        e = abs(((raw(n - 1) + v) + a / 2.0) - value)
        h = filters[0] if e <= low else filters[1] if e <= high else filters[2]
        s = 0.0
        for k in range(1, 13):
            s = s + h[k] * ((raw(n - k) - value) + (raw(n + k) - value))
        y.append(value + s)
    return y


def plain_taps(cutoff: float, rate: float) -> list[float]:
    """h[0] to h[12] of one cutoff at ``rate`` rows a second."""
    f = min(cutoff / rate, 0.5)
    g = [2.0 * f]
    for k in range(1, 13):
        w = 0.54 + 0.46 * _sine(0.25 + k / 25)
        g.append((_sine(f * k) / (3.141592653589793 * k)) * w)
    total = g[0]
    for k in range(1, 13):
        total = total + 2.0 * g[k]
    taps = [math.floor((g[k] / total) * 1073741824.0 + 0.5) for k in range(1, 13)]
    return [tap / 1073741824 for tap in (1073741824 - 2 * sum(taps), *taps)]


def _sine(t: float) -> float:
    u = t - math.floor(t)
    h = min(u, 1.0 - u)
    x = 6.283185307179586 * min(h, 0.5 - h)
    q, s = x * x, 1.0
    for i in range(9, 0, -1):
        s = 1.0 - (q * s) / ((2 * i) * (2 * i + 1))
    s = x * s
    return s if u <= 0.5 else -s
