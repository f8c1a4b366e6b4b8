"""Valid: clips of places, as they are and through the post filter.

What is expected of the filter comes from ``plain_filter``, written out here from SPEC.md, "Post
filter", in whole numbers and one number at a time; the values are counted, so that they depend on
nobody's arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.motion import Motion, Signal
from mcz.numbers import Grid, GridKind
from tools.vectors.build.files import Vector, Whole, arrays, file_of, partial
from tools.vectors.build.spatial_clips import markers

SPEC = "Post filter; Kinematics"
LENGTHS = (1, 2, 3, 12, 13, 25, 26, 60)
MILLIMETER, INCH = 0.1, 2.54
HUNDREDTHS = Grid(GridKind.FIXED, 2)
Floats = NDArray[np.float64]


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/filtered")
    for n_frames in LENGTHS:
        frames = "frame" if n_frames == 1 else "frames"
        motion = clip(n_frames)
        _hold(shelf, f"frames-{n_frames}", f"Two markers over {n_frames} {frames}.", motion)
    _rates(shelf)
    _units(shelf)
    _gaps(shelf)
    _odd_values(shelf)
    _parts(shelf)
    return shelf.vectors


def _rates(shelf: Whole) -> None:
    rates = {
        "30": "at 30 Hz, where the filters differ",
        "30000/1001": "at a rate that is no whole number",
        "240": "at 240 Hz, where they hardly differ",
        "10": "at 10 Hz, where that of 5 Hz lets all through",
        "4": "at 4 Hz, where two let all through",
    }
    for text, purpose in rates.items():
        rate = Fraction(text)
        name = f"rate-{text.replace('/', '-')}"
        _hold(shelf, name, f"Filters {purpose}.", clip(40, frame_rate=rate))
    fast = clip(30)
    signal = Signal(_places(60), (HUNDREDTHS,) * 6, samples_per_frame=2)
    purpose = "Two rows a frame: the filters are those of 240 rows a second."
    _hold(shelf, "two-rows-a-frame", purpose, replace(fast, signals=(signal,)))


def _units(shelf: Whole) -> None:
    for name, unit in {"mm": MILLIMETER, "inches": INCH, "meters": 100.0}.items():
        motion = clip(60, unit_cm=unit)
        _hold(shelf, f"unit-{name}", f"Thresholds where the unit is {unit:g} cm.", motion)
    for name, threshold in {"low": 2.0, "high": 12.0}.items():
        purpose = (
            f"An error of prediction of exactly {10 * threshold:g} mm still has the filter below."
        )
        _hold(shelf, f"threshold-{name}", purpose, clip(13, unit_cm=_unit_at(threshold)))


def _unit_at(threshold: float) -> float:
    """The unit in which row 1 of a channel of ``clip(13)`` is off by ``threshold`` cm exactly.

    Row 0 goes through the first filter whatever the unit is, so this error does not depend on it.
    """
    first = plain_taps(1.0, 120.0)
    for p in _places(13).T.tolist()[1:]:
        v = plain_filter(p, [first] * 3, 1.0)[0] - p[0]
        error = abs(((p[0] + v) + v / 2.0) - p[1])
        unit = threshold / error
        if threshold / unit == error:
            return unit
    raise AssertionError("no channel has an error that a unit can name")


def _gaps(shelf: Whole) -> None:
    motion = clip(60)
    mask = np.ones((60, 6), np.bool_)
    mask[20:23, 0] = mask[0, 1] = mask[59, 2] = mask[::2, 3] = mask[:, 4] = False
    mask[5:7, 5] = mask[8:22, 5] = mask[47:, 5] = False
    signal = replace(motion.signals[0], mask=mask)
    purpose = "Each run of known rows is filtered by itself; what lies beneath a mask stays."
    _hold(shelf, "gaps", purpose, replace(motion, signals=(signal,)), (18, 25))


def _odd_values(shelf: Whole) -> None:
    values = _places(30)
    values[4, 0], values[9, 1], values[9, 2] = math.nan, math.inf, -math.inf
    values[12, 3], values[17, 4] = 2.0**40, -(2.0**40)
    values[20, 5] = 2.0**40 - 1.0
    values[::3, 0] = -0.0
    motion = replace(clip(30), signals=(Signal(values),))
    purpose = "A value that is valid, but not finite or not below 2^40, ends a run; -0 does not."
    _hold(shelf, "odd-values", purpose, motion)
    still = Signal(np.tile(np.array([[0.1, -1 / 3, 1e-300, -0.0, 7e11, 5.25]]), (40, 1)))
    purpose = "What does not move stays as it is, but for -0."
    _hold(shelf, "still", purpose, replace(clip(40), signals=(still,)))


def _parts(shelf: Whole) -> None:
    motion = clip(60, name="one")
    far = replace(clip(26, name="two"), frame_numbers=np.arange(26) * 3 - 7)
    parts = []
    for one in (motion, far):
        seen = filtered(one)
        parts += [(("--post-filter", "--clip", one.name), arrays(seen))]
        for frames, joints in (((7, 19), None), ((0, 5), (1,)), ((20, 26), (1, 0))):
            arguments, expected = partial(seen, frames, joints)
            parts += [(("--post-filter", *arguments), expected)]
    purpose = (
        "Some frames and joints, cut out of the whole clip, filtered; frame numbers do not count."
    )
    data = file_of(motion, far)
    shelf.hold("parts", SPEC, purpose, data, motion, far, parts=tuple(parts))


def _hold(
    shelf: Whole, name: str, purpose: str, motion: Motion, frames: tuple[int, int] | None = None
) -> None:
    """Add a file of one clip, to be decoded with the filter and without."""
    seen = filtered(motion)
    parts = [(("--post-filter",), arrays(seen))]
    if frames is not None:
        arguments, expected = partial(seen, frames)
        parts.append((("--post-filter", *arguments), expected))
    shelf.hold(name, SPEC, purpose, file_of(motion), motion, parts=tuple(parts))


def clip(n_frames: int, *, unit_cm: float = 1.0, **changes: Any) -> Motion:
    """Two markers on hundredths of a unit, at 120 frames a second."""
    signal = Signal(_places(n_frames), (HUNDREDTHS,) * 6)
    fields = {"name": "steps", "frame_rate": Fraction(120)} | changes
    return Motion(markers(2, unit_cm=unit_cm), (signal,), **fields)


def _places(n_rows: int) -> Floats:
    """Curves of six sizes, from still to wild, and steps as of a coarse quantizer."""
    values = np.empty((n_rows, 6))
    for c, step in enumerate((1, 40, 300, 900, 1700, 5000)):
        for n in range(n_rows):
            place = (n + 13 * c) % 64 - 32
            curve = place * (32 - abs(place)) * (c + 2) + 400 * c
            noise = (n * n * 37 + c * 101 + n * c * 59) % 97 - 48
            values[n, c] = ((curve + noise * step // 48) // step * step) / 100
    return values


def filtered(motion: Motion) -> Motion:
    """``motion`` as SPEC.md has it behind the filter."""
    signal, rate = motion.signals[0], motion.frame_rate
    assert rate is not None
    assert motion.skeleton.unit_cm is not None
    per_second = rate.numerator / rate.denominator * signal.samples_per_frame
    unknown = np.zeros(signal.values.shape, np.bool_) if signal.mask is None else ~signal.mask
    rows = np.where(unknown, np.nan, signal.values)
    values = plain_rows(rows, per_second, motion.skeleton.unit_cm)
    values = np.where(unknown, signal.values, values)
    return replace(
        motion,
        signals=(
            Signal(
                values,
                name=signal.name,
                samples_per_frame=signal.samples_per_frame,
                mask=signal.mask,
            ),
        ),
    )


# The filter, written out


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
