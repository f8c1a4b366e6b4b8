"""Bits of an LTR coefficient: a and b of Kwak and Bajic's eq. 14, fitted anew.

For each clip, length of groups and rate the fixed ratio of bits that errs least is looked for. With
it come the variances of decoded coefficients, as an encoder of ``rca`` sees them, and from them g
of eq. 13, through which a line is laid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.online.rate_control import FLOOR_CM
from mcz.model.motion import Motion
from tools.papers.kwak.measure import code, errors

Floats = NDArray[np.float64]

GOFS = (20, 30, 40, 50)
RATES = (3.0, 4.0, 5.0, 6.0, 7.0)  # kbps
ALPHAS = tuple(float(f"{alpha:.4g}") for alpha in np.geomspace(1, 140, 21))
OUTLIERS = 0.01  # of the points are left out, those that are farthest off a first line


@dataclass(frozen=True, slots=True)
class Point:
    """The best fixed ratio at one setting; ``ratio`` is that of variances, LTR to STR."""

    clip: str
    gof: int
    rate: float
    alpha: float
    ratio: float
    g: float


@dataclass(frozen=True, slots=True)
class Fit:
    """a and b, of how many points, and what is left: the root of the mean square, in bits."""

    a: float
    b: float
    n_points: int
    n_outliers: int
    residual: float


def points_of(
    motion: Motion,
    gofs: Iterable[int] = GOFS,
    rates: Iterable[float] = RATES,
    alphas: Sequence[float] = ALPHAS,
) -> list[Point]:
    """A point for each length of groups and rate; raises MotionError or OptionError."""
    found = []
    for gof in gofs:
        for rate in rates:
            base = {"preset": "rc", "gof": gof, "bitrate": rate}
            best: tuple[float, float, Floats] | None = None
            for alpha in alphas:
                values = code(motion, base | {"alpha": alpha}).values
                error = mean_square(motion, values)
                if best is None or error < best[0]:
                    best = error, alpha, values
            assert best is not None
            point = _point(motion, gof, rate, best[1], best[2])
            if point is not None:
                found.append(point)
    return found


def mean_square(motion: Motion, values: Floats) -> float:
    """Mean square of the valid places, in squared length units."""
    mask = motion.signals[0].mask
    apart = np.asarray(motion.values, np.float64) - values
    return float(np.mean(apart[mask] ** 2 if mask is not None else apart**2))


def _point(motion: Motion, gof: int, rate: float, alpha: float, values: Floats) -> Point | None:
    """None where nothing moves, so that there is no ratio."""
    ltr, str_ = variances(values, gof)
    floor = (FLOOR_CM / (motion.skeleton.unit_cm or 1.0)) ** 2
    ratio = max(ltr, floor) / max(str_, floor / 100)
    frame_rate = float(motion.frame_rate or 1)
    due = 1000 * rate * gof / frame_rate
    bits = due / (values.shape[1] * (alpha + gof - 1))  # eq. 5: of an STR coefficient
    if not ratio > 0:
        return None
    g = alpha * bits - bits - 0.5 * math.log2(ratio)
    return Point(motion.name, gof, rate, alpha, ratio, g)


def variances(values: Floats, gof: int) -> tuple[float, float]:
    """Mean squares of decoded coefficients of LTRs and of STR frames, over all groups.

    The transform is orthonormal: they are those of what a frame adds to its prediction. The first
    LTR, intra coded, does not count.
    """
    steps = np.diff(values, axis=0)
    firsts = np.arange(len(values)) % gof == 0
    ltrs = values[firsts]
    ltr = float(np.mean(np.diff(ltrs, axis=0) ** 2)) if len(ltrs) > 1 else 0.0
    return ltr, float(np.mean(steps[~firsts[1:]] ** 2)) if gof > 1 else 0.0


def fit(points: Sequence[Point]) -> Fit:
    """Least squares of g over log2 of the ratio of variances, without what lies farthest off."""
    x = np.log2([point.ratio for point in points])
    y = np.array([point.g for point in points])
    n_outliers = round(OUTLIERS * len(points))
    a, b = _line(x, y)
    kept = np.argsort(np.abs(y - a * x - b))[: len(points) - n_outliers]
    a, b = _line(x[kept], y[kept])
    residual = float(np.sqrt(np.mean((y[kept] - a * x[kept] - b) ** 2)))
    return Fit(a, b, len(kept), n_outliers, residual)


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    matrix = np.stack([x, np.ones_like(x)], axis=1)
    (a, b), *_ = np.linalg.lstsq(matrix, y, rcond=None)
    return float(a), float(b)


def curve_of(
    motion: Motion, options: Mapping[str, Any], rates: Iterable[float] = RATES
) -> list[tuple[float, float]]:
    """(kbps, SQNR) at each rate."""
    per_second = float(motion.frame_rate or 1) / motion.n_frames * 8 / 1000
    found = []
    for rate in rates:
        coded = code(motion, {**options, "bitrate": rate})
        payload = sum(len(unit.data) for unit in coded.units)
        found.append((payload * per_second, errors(motion, coded.values)[0]))
    return found
