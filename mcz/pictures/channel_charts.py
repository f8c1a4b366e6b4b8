"""Charts of one joint: its channels over time, and what frequencies they and its speed have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from mcz.angles import Unwrapper
from mcz.brief import printable
from mcz.errors import MczError, MotionError
from mcz.kinematics.chain import Floats
from mcz.motion import ANGLE_KINDS, POSITION_KINDS, Channel, Motion
from mcz.pictures.chart_pages import Sheet
from mcz.pictures.charts import Chart, legend, line, rows_of, styled
from mcz.pictures.themes import Theme
from mcz.poses import velocities

WIDTH, PANEL = 1000, 280  # pixels of a chart and the height of a panel
LONGEST = 1024  # frames of a piece whose spectrum is taken
LEAST = 8  # frames that have one
DEEP = 1e-8  # of the greatest power: what is less is not shown
LEAST_POWER = 1e-290


def unit_name(motion: Motion, kind: str) -> str:
    """What the numbers of a channel of that kind are in."""
    if kind in ANGLE_KINDS:
        return {"deg": "degrees", "rad": "radians"}.get(motion.skeleton.angle_unit, "angle unit")
    if kind in POSITION_KINDS or kind == "length":
        return length_unit(motion)
    return "of its own"


def length_unit(motion: Motion) -> str:
    unit_cm = motion.skeleton.unit_cm
    if unit_cm is None:
        return "length units"
    known = {0.1: "mm", 1.0: "cm", 100.0: "m"}.get(unit_cm)
    return known or f"units of {unit_cm:.4g} cm"


def joint_of(motion: Motion, joint: int | str | None) -> tuple[int, str, tuple[Channel, ...]]:
    """Index, name and channels of a joint, None: the first that has any; raises MotionError.

    Tables begin with a column of times, which nobody wants to see: the next one is taken there.
    """
    skeleton = motion.skeleton
    if motion.signals[0].channels is not None:
        raise MotionError(f"{motion.name!r}: its channels are not those of its skeleton")
    having = [index for index, each in enumerate(skeleton.joints) if each.channels]
    if not having:
        raise MotionError(f"{motion.name!r}: no joint has channels")
    if len(having) > 1 and skeleton.joints[having[0]].name.lower() == "time":
        having = having[1:]
    index = having[0] if joint is None else skeleton.find(joint)
    name, channels = skeleton.addresses()[index], skeleton.joints[index].channels
    if not channels:
        raise MotionError(f"{motion.name!r}: joint {name!r} has no channels")
    return index, name, channels


def times_of(motion: Motion, first: int) -> tuple[Floats, str]:
    """When every row is, in seconds from the start of the clip, or in frames where that is unknown;
    what to write beside it."""
    per_frame = motion.signals[0].samples_per_frame
    frames = first + np.arange(motion.signals[0].n_rows) / per_frame
    if motion.frame_rate is None:
        return frames, "frame"
    return frames / float(motion.frame_rate), "seconds"


@dataclass(frozen=True, slots=True, eq=False)
class _Series:
    """Numbers over ``at``, what they are and what they are in; a panel for each unit."""

    label: str
    unit: str
    at: Floats
    numbers: Floats


def channel_chart(motion: Motion, joint: int | str | None, first: int = 0) -> Chart:
    """The channels of a joint; ``first`` is the frame of the clip where the motion begins."""
    index, name, _ = joint_of(motion, joint)
    values = np.asarray(motion.signals[0].masked(), np.float64)
    times, when = times_of(motion, first)
    series = _series_of(motion, index, times, values)
    rows: list[list[Any]] = [["channel", "in", "least", "mean", "greatest", "unknown"]]
    for each in series:
        known = each.numbers[np.isfinite(each.numbers)]
        figures = (known.min(), known.mean(), known.max()) if len(known) else (None,) * 3
        rows.append([each.label, each.unit, *figures, len(values) - len(known)])
    table = Sheet("Channels", rows_of(rows), "llrrrr")
    units = list(dict.fromkeys(each.unit for each in series))
    size = WIDTH, 60 + PANEL * len(units)
    draw = partial(_draw_channels, series=series, when=when)
    return Chart(f"{motion.name}: {name}, channels", size, draw, (table,))


def _series_of(motion: Motion, joint: int, at: Floats, values: Floats) -> list[_Series]:
    columns, channels = motion.skeleton.columns(joint), motion.skeleton.joints[joint].channels
    return [
        _Series(c.label, c.unit or unit_name(motion, c.kind), at, values[:, column])
        for c, column in zip(channels, columns, strict=True)
    ]


def _panels(
    figure: Any, theme: Theme, series: Sequence[_Series], x: str, y: str
) -> Iterator[tuple[Any, list[_Series]]]:
    """Axes for each unit, one below the other, and what is drawn there."""
    units = list(dict.fromkeys(each.unit for each in series))
    every = np.atleast_1d(figure.subplots(len(units), 1, sharex=True))
    for axes, unit in zip(every, units, strict=True):
        styled(axes, theme, y=y.format(unit=unit), x=x if unit == units[-1] else "")
        own = [each for each in series if each.unit == unit]
        yield axes, own
        legend(axes, theme, loc="upper right", ncols=len(own))


def _draw_channels(figure: Any, theme: Theme, *, series: Sequence[_Series], when: str) -> None:
    for axes, own in _panels(figure, theme, series, when, "{unit}"):
        for place, each in enumerate(own):
            line(axes, each.at, each.numbers, _color(theme, place), each.label)


def _color(theme: Theme, place: int) -> str:
    return theme.series[place % len(theme.series)]


def spectrum_chart(motion: Motion, joint: int | str | None) -> Chart:
    """The power spectral densities of a joint's channels, and of its speed where it is known.

    By Welch's method; unknown values are bridged straight, whole turns taken out. Raises
    MotionError where there are too few frames.
    """
    index, name, _ = joint_of(motion, joint)
    if motion.n_frames < LEAST:
        what = f"a spectrum of {motion.n_frames} frames"
        raise MotionError(f"{motion.name!r}: {what}; {LEAST} are needed")
    rate = float(motion.frame_rate or 1) * motion.signals[0].samples_per_frame
    values = Unwrapper(motion.skeleton)(np.asarray(motion.signals[0].masked(), np.float64))
    given = [*_series_of(motion, index, np.empty(0), values), *_speed(motion, index)]
    series = [found for each in given if (found := _spectrum(each, rate)) is not None]
    if not series:
        raise MotionError(f"{motion.name!r}: joint {name!r} has no known value")
    per = "cycles a frame" if motion.frame_rate is None else "Hz"
    heads = [f"{what}, {per}" for what in ("strongest", "half below", "99 % below")]
    rows: list[list[Any]] = [["of", "in", *heads]]
    rows += [[each.label, each.unit, *_marks(each.at, each.numbers)] for each in series]
    table = Sheet("Frequencies", rows_of(rows), "llrrr", "Half, and 99 %, of the power is below.")
    size = WIDTH, 60 + PANEL * len({each.unit for each in series})
    draw = partial(_draw_spectra, series=series, per=per)
    return Chart(f"{motion.name}: {name}, spectrum", size, draw, (table,))


def _spectrum(series: _Series, rate: float) -> _Series | None:
    bridged = _bridged(series.numbers)
    if bridged is None:
        return None
    at, power = density(bridged, rate)
    return replace(series, at=at[1:], numbers=power[1:])


def density(column: Floats, rate: float) -> tuple[Floats, Floats]:
    """Frequencies and power spectral density of a channel, by Welch's method: the mean of pieces
    that overlap by half, each without its straight line, under a Hann window.

    SciPy has it, too, but takes seconds to import.
    """
    size = min(len(column), LONGEST)
    starts = range(0, len(column) - size + 1, max(1, size // 2))
    pieces = np.stack([column[start : start + size] for start in starts])
    time = np.arange(size) - (size - 1) / 2
    slopes = (pieces @ time) / (time @ time)
    pieces = pieces - pieces.mean(axis=1, keepdims=True) - slopes[:, None] * time
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size)
    spectra = np.abs(np.fft.rfft(pieces * window, axis=1)) ** 2
    power = spectra.mean(axis=0) / (rate * (window @ window))
    power[1 : (size + 1) // 2] *= 2  # what is at negative frequencies
    return np.arange(size // 2 + 1, dtype=np.float64) * (rate / size), np.asarray(power)


def _draw_spectra(figure: Any, theme: Theme, *, series: Sequence[_Series], per: str) -> None:
    for axes, own in _panels(figure, theme, series, per, f"({{unit}})² / {per}"):
        for place, each in enumerate(own):
            power = np.maximum(each.numbers, LEAST_POWER)
            color = _color(theme, place)
            axes.loglog(each.at, power, color=color, label=printable(each.label), linewidth=1.1)
        highest = max(float(each.numbers.max()) for each in own)
        if highest > LEAST_POWER / DEEP:
            axes.set_ylim(highest * DEEP, highest * 3)


def _speed(motion: Motion, index: int) -> list[_Series]:
    """The speed of a joint's point, where there are kinematics and a rate."""
    if motion.frame_rate is None or motion.signals[0].samples_per_frame > 1:
        return []
    try:
        with np.errstate(all="ignore"):
            speed = np.sqrt((velocities(motion, [index])[:, 0] ** 2).sum(axis=1))
    except MczError:
        return []
    return [_Series("speed", f"{length_unit(motion)} a second", np.empty(0), speed)]


def _bridged(column: Floats) -> Floats | None:
    """A channel without gaps; None where nothing of it is known, or it is beyond all measure."""
    known = np.isfinite(column) & (np.abs(column) < 1e100)
    if not known.any():
        return None
    at = np.arange(len(column))
    found: Floats = np.interp(at, at[known], column[known])
    return found


def _marks(at: Floats, power: Floats) -> tuple[float | None, ...]:
    """The strongest frequency, and those below which half and 99 % of the power are."""
    total = power.sum()
    if not total > 0:
        return (None,) * 3
    below = np.cumsum(power) / total
    return (
        float(at[power.argmax()]),
        *(float(at[min(int(np.searchsorted(below, share)), len(at) - 1)]) for share in (0.5, 0.99)),
    )
