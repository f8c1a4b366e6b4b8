"""Curves of Kwak and Bajic's tables against each other."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mcz.bench.measure import Record
from mcz.bench.sweep import bd_rate, bd_sqnr
from tools.papers.kwak.clips import POINTS, VIRTUAL, Clip
from tools.papers.kwak.tasks import MARKER_RATES, Found, Method, marker_task


def bd(
    found: Found, clip: Clip, reference: Method, other: Method
) -> tuple[float | None, float | None]:
    """BD SQNR in dB and BD rate in percent, models and all; None where nothing is shared."""
    a, b = (
        [(p["kbps"] + p["model_kbps"], p["sqnr"]) for p in found.rates(clip, method)]
        for method in (reference, other)
    )
    if not a or not b:
        return None, None
    return bd_sqnr(a, b), bd_rate(a, b)


def virtual_ratios(
    found: Found, clip: Clip, method: Method, wanted: Sequence[float]
) -> list[float | None]:
    """kbps with virtual markers to kbps without, at the errors of so many kbps without."""
    key = "cm_filtered" if method.filtered else "cm"
    plain, marked = (found.get(marker_task(clip, method, form)) for form in (POINTS, VIRTUAL))
    if not plain or not marked:
        return []
    ratios: list[float | None] = []
    for kbps in wanted:
        point = plain[MARKER_RATES.index(kbps)]
        needed = kbps_at(marked, key, point[key])
        ratios.append(needed / point["kbps"] if needed else None)
    return ratios


def kbps_at(points: Sequence[Record], key: str, error: float) -> float | None:
    """On straight lines in logarithms, along the rates; None beyond their ends."""
    x = np.minimum.accumulate([math.log(p[key]) for p in points])[::-1]
    y = [math.log(p["kbps"]) for p in points][::-1]
    if not x[0] <= math.log(error) <= x[-1]:
        return None
    return float(math.exp(np.interp(math.log(error), x, y)))
