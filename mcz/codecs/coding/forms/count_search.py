"""Encoder search for the law of a channel of counts; not normative.

mcz/codecs/lossless/README.md describes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from mcz.codecs.coding.forms import BINARY32
from mcz.codecs.coding.forms.counts import MOST_OFFSET, Law, bounds, spacing
from mcz.model.numbers import Grid, GridKind, values_of
from mcz.model.types import Floats, Ints

Line = tuple[float, float]  # unit of a count, and value of 0

LEAST_UNIT, MOST_COUNT = 2.0**-200, 2.0**40
FEWEST = 9  # distinct values that show a law
VANISHING = -(2.0**-200)  # an offset that makes -0 of the count 0, and changes no other value
MOST_REST = 2**31 - 1  # largest coded rest: if a law misses 0, a rest may be as large as an ordinal
COARSE = 8  # multiples of a unit at least so far apart may be counts of a greater unit
_QUANTILES = np.array([0, 0.05, 0.1, 0.2, 0.35, 0.5])  # of differences: one may be the unit
_SOME = 128  # differences of a first sample
_NEAR = 8  # units of a difference that can confirm a unit
_REACHES = 8 * 4.0 ** np.arange(24)  # units on both sides of the middle, in steps
_PARTS = 1, 2, 3  # of the least of few differences
_OFF = 0.15  # of a unit, on average: more means no law
_SHARP = 0.02  # of a unit, the median: less decides for the greatest unit
_TRIMS, _FAR = 3, 4.0  # rounds, and the multiple of the median error beyond which they drop values
_ROUNDS = 25  # to lower the greatest distance from a line
_HALVINGS = 40  # of an interval that the unit is in
_HOPELESS = 4.0  # times the slack, at first
_BIT_OF_A_REST = 1.3  # bits that the entropy coder needs for one
_MARGIN = 64  # bits that a law must save


@dataclass(frozen=True, slots=True)
class Counted:
    """A law, the counts of a column, and the errors of its ordinals."""

    law: Law
    counts: Ints
    rests: Ints

    def cost(self) -> float:
        """Estimate the bits of the rests and of the law's fields."""
        sizes = np.log2(1 + 2.0 * np.abs(self.rests[self.rests != 0]))
        return 8 * len(self.law.fields(rests=True)) + _BIT_OF_A_REST * float(sizes.sum())


def find_counts(
    ordinals: Ints, grid: Grid, multiples: tuple[float, Ints] | None = None
) -> Counted | None:
    """The law that saves bits for a column of a grid, its counts and rests, or None.

    ``grid``: BINARY32 or GENERAL. ``multiples``: a common unit and the multiples of it, if known.
    """
    if multiples is not None and not _lie_apart(multiples[1]):
        return None
    if ordinals.max() > grid.limit or ordinals.min() < grid.lowest:
        return None
    different = np.unique(ordinals)
    numbers = np.ravel(values_of(different[:, None], (grid,)))
    if not np.isfinite(numbers).all():
        return None
    if grid.kind == GridKind.GENERAL and np.abs(numbers[[0, -1]]).max() > MOST_OFFSET:
        return None
    distinct = np.unique(numbers)
    line = find_line(distinct, grid)
    if line is None:
        return None
    values = numbers[np.searchsorted(different, ordinals)]
    best = _cheapest(_laws(values, distinct, grid, line), ordinals, grid)
    if best is None:
        return None
    fine = spacing(values, grid, best.law.unit) if multiples is None else multiples[0]
    return best if _saves(best, values, fine) else None


def _lie_apart(multiples: Ints) -> bool:
    gaps = np.diff(np.unique(multiples))
    return len(gaps) >= FEWEST - 1 and bool(gaps.min() >= COARSE)


def _saves(counted: Counted, values: Floats, fine: Floats | float) -> bool:
    """Return True if steps of a unit in place of ``fine`` ones save more than they cost."""
    changed = np.diff(values, prepend=0) != 0
    saved = np.log2(np.maximum(counted.law.unit / fine, 1)) * changed
    return bool(saved.sum() > counted.cost() + _MARGIN)


def _cheapest(laws: Iterable[tuple[Law, Ints]], ordinals: Ints, grid: Grid) -> Counted | None:
    """The cheapest law, or the first without rests; None if no rests have codes."""
    best, least = None, np.inf
    for law, counts in laws:
        counted = Counted(law, counts, ordinals - law.ordinals(counts, grid))
        if np.abs(counted.rests).max() > MOST_REST:
            continue
        cost = counted.cost()
        if cost < least:
            best, least = counted, cost
        if not counted.rests.any():
            break
    return best


def find_line(distinct: Floats, grid: Grid) -> Line | None:
    """The line near sorted numbers as whole numbers of a unit, or None."""
    gaps = np.diff(distinct)
    if len(distinct) < FEWEST:
        return _line_of_few(distinct, gaps) if grid.kind == GridKind.GENERAL else None
    gaps = gaps[gaps > 4 * spacing(distinct[[0, -1]], grid).max()]
    if len(gaps) < FEWEST - 1:
        return None
    lines = (_grow_line(distinct, unit) for unit in _guesses(gaps))
    candidates = [line for line in lines if line is not None]
    sharp = [line for line in candidates if np.median(_distances(distinct, line)) < _SHARP]
    return (
        max(sharp)
        if sharp
        else min(candidates, key=lambda line: _mean_distance(distinct, line), default=None)
    )


def _line_of_few(distinct: Floats, gaps: Floats) -> Line | None:
    """The line from the first of a few numbers on, by a part of the least gap between them."""
    for parts in _PARTS if len(gaps) else ():
        line = float(gaps.min()) / parts, float(distinct[0])
        if line[0] >= LEAST_UNIT and gaps.max() < MOST_COUNT * line[0]:
            fitted = _fit(np.rint((distinct - line[1]) / line[0]), distinct)
            if fitted is not None and _distances(distinct, fitted).max() < _SHARP:
                return fitted
    return None


def _guesses(gaps: Floats) -> list[float]:
    """Differences that most of the others are near multiples of: the cheap test."""
    ordered = np.sort(gaps)
    guesses = np.unique(ordered[(_QUANTILES * (len(gaps) - 1)).astype(np.int64)])
    ratios = gaps[:: max(1, len(gaps) // _SOME)] / guesses[:, None]
    near = ratios < _NEAR
    off = (np.abs(ratios - np.rint(ratios)) * near).sum(axis=1)
    fits = (near.sum(axis=1) >= FEWEST - 1) & (off < _OFF * near.sum(axis=1))
    return [float(guess) for guess in guesses[fits]]


def _mean_distance(values: Floats, line: Line) -> float:
    return float(np.mean(_distances(values, line)))


def _distances(values: Floats, line: Line) -> Floats:
    counts = (values - line[1]) / line[0]
    return np.abs(counts - np.rint(counts))


def _grow_line(distinct: Floats, unit: float) -> Line | None:
    """A line fitted to ever more of the values around the middle one, or None."""
    middle = float(distinct[len(distinct) // 2])
    line = unit, middle
    span = max(middle - float(distinct[0]), float(distinct[-1]) - middle)
    if unit < LEAST_UNIT or span > unit * MOST_COUNT:
        return None
    for reach in _REACHES:
        around = [middle - reach * line[0], middle + reach * line[0]]
        first, stop = np.searchsorted(distinct, around)
        part = distinct[first:stop]
        fitted = _fit(np.rint((part - line[1]) / line[0]), part)
        line = fitted or line
        if line[0] < LEAST_UNIT or (len(part) >= 2 * FEWEST and _mean_distance(part, line) > _OFF):
            return None
        if len(part) == len(distinct):
            return line if _mean_distance(distinct, line) < _OFF else None
    return None


def _fit(counts: Floats, values: Floats, weights: Floats | None = None) -> Line | None:
    if weights is None:
        weights = np.ones(len(counts))
    total = weights.sum()
    if not total > 0:
        return None
    middle, level = (weights @ counts) / total, (weights @ values) / total
    away = weights * (counts - middle)
    square = away @ (counts - middle)
    if not square > 0:
        return None
    unit = float(away @ (values - level) / square)
    return unit, float(level - unit * middle)


def _closest(counts: Floats, values: Floats, slack: Floats) -> Line | None:
    """A line that is within ``slack`` of all values, or nearly so (Lawson)."""
    weights, least, best = 1 / slack, _HOPELESS, None
    for _ in range(_ROUNDS):
        line = _fit(counts, values, weights / slack)
        if line is None:
            break
        off = np.abs(values - line[0] * counts - line[1]) / slack
        farthest = float(off.max())
        if farthest < least:
            least, best = farthest, line
        if best is None or least <= 1:
            break
        weights = weights * (off / farthest)
    return best


def _rounding_line(distinct: Floats, few: Floats, grid: Grid, line: Line) -> Line:
    """A line that rounds to all values at counts, or nearly so if there is none.

    The range of possible offsets of a unit is concave in the unit.
    """
    some = distinct != 0  # equal sums only by chance
    sizes, (low, high) = distinct[some], bounds(np.abs(distinct[some]), grid)
    low, high = np.where(sizes < 0, (-high, -low), (low, high))
    middle = float(np.rint(few.mean()))
    counts = few[some] - middle
    if len(sizes) < 2 or np.ptp(counts) == 0:
        return line
    reach = _HOPELESS * float((high - low).max()) / float(np.ptp(counts))
    least, most = line[0] - reach, line[0] + reach
    for _ in range(_HALVINGS):
        unit = (least + most) / 2
        above, below = high - unit * counts, low - unit * counts
        first, last = int(np.argmin(above)), int(np.argmax(below))
        if above[first] >= below[last]:
            break
        if counts[first] < counts[last]:
            least = unit
        else:
            most = unit
    return unit, float(above[first] + below[last]) / 2 - unit * middle


def _laws(values: Floats, distinct: Floats, grid: Grid, line: Line) -> Iterator[tuple[Law, Ints]]:
    zeros = values == 0
    zero_offset = VANISHING if 2 * np.signbit(values[zeros]).sum() > zeros.sum() else None
    distinct, few, line = _trim_law(distinct, grid, line)
    unit, offset = line
    counts = np.rint((values - offset) / unit).astype(np.int64)
    moved = _zero_of(line)
    if moved is not None:
        for alone in _units_alone(distinct, few + moved, grid):
            yield Law(alone, zero_offset), counts + moved
    if grid.kind == GridKind.GENERAL:
        for fitted in (_rounding_line(distinct, few, grid, line), line):
            if _usable(*fitted):
                yield Law(*fitted), counts
        return
    closest = _closest(few, distinct, spacing(distinct, grid) / 2)
    for fitted in (line, closest) if closest else (line,):
        if _usable(*fitted):
            yield Law(*fitted), counts
    off = np.abs(distinct - unit * few - offset)
    sizes = float(off.max()), float(np.quantile(off, 0.9))
    steps = {int(np.ceil(np.log2(2 * size))) for size in sizes if size > 0}
    for power in sorted({power - down for power in steps for down in (0, 1)}):
        law = _rounded_law(distinct, few, unit, 2.0**power)
        if law is not None:
            yield law, counts


def _trim_law(distinct: Floats, grid: Grid, line: Line) -> tuple[Floats, Floats, Line]:
    """The values near the line, their counts, and the line through them."""
    few = np.rint((distinct - line[1]) / line[0])
    kept, kept_few = distinct, few
    for _ in range(_TRIMS):
        off = np.abs(distinct - line[0] * few - line[1])
        far = np.full(len(off), _FAR * np.median(off))
        if grid.kind == GridKind.GENERAL:
            far = np.maximum(far, spacing(distinct, grid))  # rounding that differs by size
        near = off <= far
        kept, kept_few = distinct[near], few[near]
        line = _fit(kept_few, kept) or line
    return kept, kept_few, line


def _usable(unit: float, *terms: float) -> bool:
    return LEAST_UNIT <= unit <= MOST_OFFSET and all(abs(term) <= MOST_OFFSET for term in terms)


def _zero_of(line: Line) -> int | None:
    unit, offset = line
    zero = np.rint(offset / unit)
    if abs(offset / unit - zero) > _OFF or abs(zero) > MOST_COUNT:
        return None
    return int(zero)


def _units_alone(distinct: Floats, few: Floats, grid: Grid) -> Iterator[float]:
    """Units of laws without an offset, for counts of distinct values."""
    if grid.kind == GridKind.GENERAL:
        some = few != 0
        low, high = bounds(np.abs(distinct[some]), grid)
        sizes = np.abs(few[some])
        least, most = (
            float((low / sizes).max(initial=0)),
            float((high / sizes).min(initial=MOST_OFFSET)),
        )
        if LEAST_UNIT <= least <= most <= MOST_OFFSET:
            yield (least + most) / 2
            return
    for weights in (few, few / spacing(distinct, grid) ** 2):  # errors of one size; of last places
        square = float(weights @ few)
        unit = float(weights @ distinct) / square if square > 0 else 0.0
        if _usable(unit):
            yield unit


def _rounded_law(distinct: Floats, few: Floats, unit: float, step: float) -> Law | None:
    """A law whose first sum was rounded to ``step``: all values are whole steps apart."""
    span = float(distinct[-1] - distinct[0])
    if not 0 < step < unit / 2 or span > step * 2.0**21:
        return None
    finest = float(distinct[np.argmin(spacing(distinct, BINARY32))])
    steps = np.rint((distinct - finest) / step)
    if np.median(np.abs(distinct - finest - steps * step)) > step / 8:
        return None
    line = _closest(few, steps * step, np.full(len(few), step / 2))
    if line is None:
        return None
    middle = float(np.rint((steps[0] + steps[-1]) / 2))
    top = (3 * 2.0**22 - middle) * step  # binary32 numbers are steps apart there
    law = Law(line[0], line[1] + top, finest - top)
    return law if _usable(law.unit, line[1] + top, finest - top) else None
