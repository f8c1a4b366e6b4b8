"""The setting of a codec's dial at which a figure is met, between two that are measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from mcz.bench.cases import Case, Variant
from mcz.bench.measure import MOST_TRIALS, DialRange, Record, dial_of, measure
from mcz.errors import MotionError, OptionError

NEAR, CLOSE = 0.002, 1.0005  # of a figure, and of settings: near enough
INTERPOLATED = (
    *("coded_bytes", "cr_source", "cr_float32", "cr_40B", "mse", "rms_coordinate_error"),
    *("mean_position_error", "max_position_error", "sqnr_db"),
    *("mean_position_error_cm", "max_position_error_cm"),
)


def at_figure(case: Case, variant: Variant, key: str, wanted: float, hint: float = 1.0) -> Record:
    """A point at which the figure ``key`` is ``wanted``, between two that were measured.

    What is between them is read off straight lines in logarithms. ``bracket`` has the two. Raises
    OptionError where the dial does not reach it.
    """
    dial, settings = dial_of(variant)
    points: dict[float, Record] = {}

    def figure(setting: float) -> float:
        found = measure(
            case, variant, {dial.parameter: settings.to_parameter(setting)}, markers=False
        )
        points[setting] = found
        if found[key] is None:
            raise OptionError(f"{variant.label}: this clip has no {key}")
        return float(found[key])

    pair = _bracket(figure, settings, settings.snap(hint), wanted)
    if pair is None:
        ends = sorted(float(p[key]) for p in points.values())
        raise OptionError(
            f"{variant.label}: {key} {wanted:g} is not reached, {ends[0]:.4g} to {ends[-1]:.4g} is"
        )
    low, high = pair
    for _ in range(MOST_TRIALS):
        apart = abs(points[low][key] - points[high][key]) / wanted
        middle = settings.snap(_between(low, high, points, key, wanted))
        close = max(low, high) / min(low, high) < CLOSE
        if apart < NEAR or close or middle in (low, high):
            break
        value = figure(middle)
        low, high = (middle, high) if _same_side(value, points[low][key], wanted) else (low, middle)
    return _interpolate(points[low], points[high], key, wanted)


def _same_side(a: float, b: float, wanted: float) -> bool:
    return (a <= wanted) == (b <= wanted)


def _bracket(
    figure: Callable[[float], float], settings: DialRange, start: float, wanted: float
) -> tuple[float, float] | None:
    """Two settings with the figure between theirs, the nearer side of the dial first."""
    first = figure(start)
    heads = {2.0: (start, first), 0.5: (start, first)}
    while heads:
        for factor, (setting, value) in list(heads.items()):
            moved = settings.snap(setting * factor)
            if moved == setting:
                del heads[factor]
                continue
            try:
                found = figure(moved)
            except MotionError:
                del heads[factor]
                continue
            if not _same_side(found, value, wanted):
                return setting, moved
            heads[factor] = moved, found
            if abs(math.log2(moved / start)) > MOST_TRIALS:
                del heads[factor]
    return None


def _between(low: float, high: float, points: Mapping[float, Record], key: str, y: float) -> float:
    a, b = points[low][key], points[high][key]
    share = 0.5
    if a > 0 and b > 0 and a != b:
        share = math.log(y / a) / math.log(b / a)
    share = min(max(share, 0.1), 0.9)
    return math.exp(math.log(low) + share * math.log(high / low))


def _interpolate(a: Record, b: Record, key: str, wanted: float) -> Record:
    """The point where ``key`` is ``wanted``; sizes, ratios and errors between those of two."""
    share = 0.0
    if a[key] > 0 and b[key] > 0 and a[key] != b[key]:
        share = math.log(wanted / a[key]) / math.log(b[key] / a[key])
    found: dict[str, Any] = {}
    for name in INTERPOLATED:
        left, right = a[name], b[name]
        if left is None or right is None:
            found[name] = None
        elif left > 0 and right > 0:
            found[name] = math.exp((1 - share) * math.log(left) + share * math.log(right))
        else:
            found[name] = left + share * (right - left)
    settings = [next(iter(point["params"].values())) for point in (a, b)]
    return found | {"bracket": settings, "figure": key, "wanted": wanted}
