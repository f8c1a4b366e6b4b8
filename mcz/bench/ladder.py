"""Settings of a codec's dial with evenly spaced sizes."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from mcz.bench.cases import Case, Variant, load
from mcz.bench.measure import Record, coded_bytes, measure
from mcz.codecs import codec_by_name
from mcz.codecs.parameters import Dial
from mcz.errors import MczError, MotionError, OptionError

FINEST, COARSEST = 6, 150  # cr_float32 at the ends of a ladder, within the range of the codec
N_POINTS = 10
GROWTH = 4.0  # from one setting to the next in the search for the ends
# smallest relative change of size, and steps below it until the dial counts as ended
FLAT, MOST_FLAT = 0.004, 6
CLEAR = 0.1  # a step that shows the direction of sizes
MOST_TRIALS = 24

Known = dict[float, float]  # setting -> figure


class Settings:
    """The range of a dial: whole numbers only for a parameter of integers."""

    def __init__(self, dial: Dial) -> None:
        self.low, self.high, self.whole = dial.low, dial.high, dial.whole

    def snap(self, setting: float) -> float:
        rounded = round(setting) if self.whole else float(f"{setting:.6g}")
        return float(min(max(rounded, self.low), self.high))

    def to_parameter(self, setting: float) -> float | int:
        return int(setting) if self.whole else setting


def dial_of(variant: Variant) -> tuple[Dial, Settings]:
    """Raises OptionError where the codec has no dial."""
    codec = codec_by_name(variant.codec)
    if codec.dial is None:
        raise OptionError(f"codec {variant.codec} has no parameter that varies its rate")
    return codec.dial, Settings(codec.dial)


def sweep(case: Case, variant: Variant, n_points: int = N_POINTS) -> list[Record]:
    """Points of about evenly spaced sizes from fine to coarse; one point without a dial."""
    if codec_by_name(variant.codec).dial is None:
        return [measure(case, variant, {})]
    dial, settings = dial_of(variant)
    signal = load(case).motion.signals[0]
    plain = 4.0 * max(1, signal.values.size)

    def size(setting: float) -> float:
        return coded_bytes(case, variant, {dial.parameter: settings.to_parameter(setting)})

    points = ladder(size, settings, (plain / FINEST, plain / COARSEST), n_points)
    return [measure(case, variant, {dial.parameter: settings.to_parameter(s)}) for s in points]


def ladder(
    size: Callable[[float], float], settings: Settings, window: tuple[float, float], n_points: int
) -> list[float]:
    """About ``n_points`` settings whose sizes are evenly spaced in logarithms, fine to coarse.

    Sizes lie in ``window``, the greatest first, within the range of the dial. The direction of the
    dial is measured.
    """
    big, small = window
    known = _explore(size, settings, big, small)
    for _ in range(MOST_TRIALS):
        gap, middle = _widest(known, settings, big, small)
        if gap <= math.log(big / small) / n_points or middle is None:
            break
        try:
            known[middle] = size(middle)
        except MotionError:  # too fine for this clip
            break
    high, low = min(big, max(known.values())), max(small, min(known.values()))
    if high <= low:
        return sorted(known)[:1]
    steps = [(high / low) ** (i / max(1, n_points - 1)) for i in range(n_points)]
    order = sorted({settings.snap(_setting_at(known, low * step)) for step in steps})
    return order if _falls(known) else order[::-1]


def _explore(size: Callable[[float], float], settings: Settings, big: float, small: float) -> Known:
    """Sizes from a setting in the middle outwards, until they are beyond ``small`` and ``big``."""
    start = settings.snap(1.0)
    known = {start: size(start)}
    for factor in (GROWTH, 1 / GROWTH):
        setting, flat = start, 0
        for _ in range(MOST_TRIALS):
            before, moved = known[setting], settings.snap(setting * factor)
            if moved in known or flat == MOST_FLAT:
                break
            try:
                known[moved] = size(moved)
            except MczError:  # beyond the range of the codec
                break
            change = math.log(known[moved] / before)
            flat = flat + 1 if abs(change) < FLAT else 0
            beyond = known[moved] > big if change > 0 else known[moved] < small
            setting = moved
            if beyond and abs(change) > CLEAR:  # less may be a whim of the encoder
                break
    return known


def _falls(known: Known) -> bool:
    order = sorted(known)
    return known[order[0]] >= known[order[-1]]


def _widest(
    known: Known, settings: Settings, big: float, small: float
) -> tuple[float, float | None]:
    """The widest step of sizes between neighboring settings, in logarithms, and its middle."""
    best: tuple[float, float | None] = (0.0, None)
    for a, b in pairwise(sorted(known)):
        middle = settings.snap(math.sqrt(a * b))
        if middle in known:
            continue
        logs = [math.log(min(max(known[s], small), big)) for s in (a, b)]
        if (step := abs(logs[0] - logs[1])) > best[0]:
            best = step, middle
    return best


def _setting_at(known: Known, figure: float) -> float:
    for a, b in pairwise(sorted(known)):
        left, right = known[a], known[b]
        if min(left, right) <= figure <= max(left, right):
            if left == right:
                return a
            share = math.log(figure / left) / math.log(right / left)
            return math.exp(math.log(a) + share * math.log(b / a))
    return min(known, key=lambda s: abs(known[s] - figure))
