"""Charts of one joint: its channels over time, and the spectra of channels and speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mcz.errors import MczError, MotionError, OptionError
from mcz.hints import Hint, Remark
from mcz.kinematics.angles import Unwrapper
from mcz.kinematics.chain import Floats
from mcz.kinematics.frames import signal_of
from mcz.kinematics.poses import velocities
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, Channel, Motion, Signal
from mcz.model.text_format import printable, suggest_names
from mcz.show.pictures.canvases import Theme
from mcz.show.pictures.charts import Chart, Sheet, legend, line, rows_of, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, PANEL = 1000, 280  # pixels of a chart and the height of a panel
LONGEST = 1024  # frames of a piece of a spectrum
MOST_SERIES = 8  # of a signal's channels, unless they are chosen
MOST_RUNS = 400  # lines between gaps; more are drawn as one
LEAST_FRAMES = 8  # frames for a spectrum
DEEP = 1e-8  # of the greatest power: less is not shown
LEAST_POWER = 1e-290


def unit_name(motion: Motion, kind: str) -> str:
    """Unit of a channel's numbers."""
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
    """Index, name and channels of a joint, None: the first with channels; raises MotionError."""
    skeleton = motion.skeleton
    if not motion.signals[0].has_poses:
        raise MotionError(
            "the channels of its motion signal differ from those of its skeleton", clip=motion.name
        )
    having = [index for index, each in enumerate(skeleton.joints) if each.channels]
    if not having:
        raise MotionError("no joint has channels", clip=motion.name)
    index = having[0] if joint is None else skeleton.find(joint)
    name, channels = skeleton.addresses()[index], skeleton.joints[index].channels
    if not channels:
        raise MotionError(f"joint {name!r} has no channels", clip=motion.name)
    return index, name, channels


def times_of(motion: Motion, first: int, signal: int = 0) -> tuple[Floats, str]:
    """The times of the rows of a signal in seconds, or in frames of the clip if unknown; label."""
    chosen, timeline = motion.signals[signal], motion.timeline
    if timeline is None:
        return first + np.arange(chosen.n_rows) / chosen.samples_per_frame, "frame"
    return timeline.samples(chosen.samples_per_frame), "seconds"


@dataclass(frozen=True, slots=True)
class Selection:
    """A ``joint``, or ``channels`` of a ``signal``, by name; None: the first."""

    joint: int | str | None = None
    signal: int | str | None = None
    channels: tuple[str, ...] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Series:
    """Numbers over ``at``, their name and unit; a panel for each unit."""

    label: str
    unit: str
    at: Floats
    numbers: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _ChartData:
    """The series of a chart; ``runs`` of rows have no break in time.

    ``joint`` is theirs, None for a signal's channels. ``when`` labels ``at``.
    """

    name: str
    joint: int | None
    series: list[_Series]
    when: str
    runs: list[tuple[int, int]]
    per_frame: int
    notes: tuple[str, ...] = ()


def _chart_data(motion: Motion, selection: Selection, first: int) -> _ChartData:
    """The series of the selected channels, with their times and names."""
    index = _signal_of(motion, selection)
    signal, timeline = motion.signals[index], motion.timeline
    at, when = times_of(motion, first, index)
    values = np.asarray(signal.masked(), np.float64)
    runs = [(0, motion.n_frames)] if timeline is None else timeline.runs
    joint: int | None = None
    notes: tuple[str, ...] = ()
    if signal.channels is None:
        joint, name, channels = joint_of(motion, selection.joint)
        columns: Sequence[int] = motion.skeleton.columns(joint)
    else:
        name, every = signal.name, signal.channels
        columns, notes = _columns(every, selection.channels, name)
        channels = tuple(every[k] for k in columns)
    series = [
        _Series(
            channel.label or f"channel-{k}",
            channel.unit or unit_name(motion, channel.kind),
            at,
            values[:, k],
        )
        for channel, k in zip(channels, columns, strict=True)
    ]
    per_frame = signal.samples_per_frame
    rows = [(start * per_frame, stop * per_frame) for start, stop in runs]
    return _ChartData(name, joint, series, when, rows or [(0, 0)], per_frame, notes)


def _signal_of(motion: Motion, selection: Selection) -> int:
    """The index of a signal: the one with the channels, or the requested one; else the motion.

    If the motion has no channels, the first other signal. Raises OptionError.
    """
    if selection.signal is None and selection.channels is None:
        is_empty = not motion.signals[0].n_channels and selection.joint is None
        return int(is_empty and len(motion.signals) > 1)
    if selection.joint is not None:
        raise OptionError("a chart shows either a joint or channels of a signal, not both")
    if selection.signal is not None:
        return motion.signals.index(signal_of(motion, selection.signal))
    names = set(selection.channels or ())
    having = [k for k, signal in enumerate(motion.signals) if names <= {*_labels(signal.channels)}]
    if not having:
        known = [label for signal in motion.signals for label in _labels(signal.channels)]
        shown = suggest_names(known, next(iter(names))) if known else "none"
        raise OptionError(f"no signal has the channels {', '.join(sorted(names))}; {shown}")
    return having[0]


def _labels(channels: Sequence[Channel] | None) -> list[str]:
    return [channel.label or f"channel-{k}" for k, channel in enumerate(channels or ())]


def _columns(
    channels: Sequence[Channel], names: Sequence[str] | None, signal: str
) -> tuple[list[int], tuple[str, ...]]:
    """The columns of these names, None: of the first; and a remark on the others."""
    labels = _labels(channels)
    if names is None:
        more = Remark(f"{MOST_SERIES} of {len(labels)} channels", Hint.SERIES)
        return list(range(len(labels)))[:MOST_SERIES], (more,) * (len(labels) > MOST_SERIES)
    for name in names:
        if name not in labels:
            labelled = suggest_names(labels, name)
            raise OptionError(f"signal {signal!r} has no channel {name!r}, but {labelled}")
    return [labels.index(name) for name in names], ()


def channel_chart(motion: Motion, selection: Selection, first: int = 0) -> Chart:
    """Channels over time; ``first`` is the frame of the clip where the motion begins."""
    data = _chart_data(motion, selection, first)
    rows: list[list[object]] = [["channel", "in", "least", "mean", "greatest", "unknown"]]
    for each in data.series:
        known = each.numbers[np.isfinite(each.numbers)]
        with np.errstate(over="ignore"):
            figures = (known.min(), known.mean(), known.max()) if len(known) else (None,) * 3
        rows.append([each.label, each.unit, *figures, len(each.numbers) - len(known)])
    table = Sheet("Channels", rows_of(rows), "llrrrr")
    size = WIDTH, 60 + PANEL * len({each.unit for each in data.series})
    draw = partial(_draw_channels, data=data)
    return Chart(f"{motion.name}: {data.name}, channels", size, draw, (table,), data.notes)


def _panels(
    figure: Figure, theme: Theme, series: Sequence[_Series], x: str, y: str
) -> Iterator[tuple[Axes, list[_Series]]]:
    """Axes for each unit, one below the other, and their series."""
    units = list(dict.fromkeys(each.unit for each in series))
    every = np.atleast_1d(figure.subplots(len(units), 1, sharex=True))
    for axes, unit in zip(every, units, strict=True):
        style(axes, theme, y=y.format(unit=unit), x=x if unit == units[-1] else "")
        own = [each for each in series if each.unit == unit]
        yield axes, own
        legend(axes, theme, loc="upper right", ncols=len(own))


def _draw_channels(figure: Figure, theme: Theme, *, data: _ChartData) -> None:
    for axes, own in _panels(figure, theme, data.series, data.when, "{unit}"):
        for place, each in enumerate(own):
            draw_runs(axes, (each.at, each.numbers), data.runs, _color(theme, place), each.label)


def draw_runs(
    axes: Axes,
    points: tuple[Floats, Floats],
    runs: Sequence[tuple[int, int]],
    color: str,
    label: str,
    **options: object,
) -> None:
    """A line through the points of each run of rows, broken between runs."""
    for start, stop in runs if len(runs) <= MOST_RUNS else [(0, len(points[0]))]:
        at, numbers = (each[start:stop] for each in points)
        line(axes, at, numbers, color, label if start == runs[0][0] else "", **options)


def _color(theme: Theme, place: int) -> str:
    return theme.series[place % len(theme.series)]


def spectrum_chart(motion: Motion, selection: Selection) -> Chart:
    """The power spectral densities of channels, and of a joint's speed if known.

    By Welch's method; unknown values are bridged straight, whole turns removed. If frames are
    missing, the longest part without a break in time counts. Raises MotionError for too few frames.
    """
    notes: tuple[str, ...] = ()
    runs = [(0, motion.n_frames)] if motion.timeline is None else motion.timeline.runs
    if len(runs) > 1:
        start, stop = max(runs, key=lambda run: run[1] - run[0])
        notes = (f"frames {start}:{stop} alone, the longest part without a gap",)
        motion = motion.cut(start, stop)
    if motion.n_frames < LEAST_FRAMES:
        label = f"a spectrum of {motion.n_frames} frames"
        raise MotionError(f"{label}; {LEAST_FRAMES} are needed", clip=motion.name)
    period = None if motion.timeline is None else motion.timeline.period
    turned = motion
    if motion.signals[0].has_poses and motion.skeleton.n_channels:
        first = motion.signals[0]
        values = Unwrapper(motion.skeleton)(np.asarray(first.masked(), np.float64))
        mended = Signal(values, name=first.name, samples_per_frame=first.samples_per_frame)
        turned = replace(motion, signals=(mended, *motion.signals[1:]), source=None)
    data = _chart_data(turned, selection, 0)
    rate = data.per_frame / (period or 1.0)
    sources = [*data.series, *([] if data.joint is None else _speed(motion, data.joint))]
    series = [spectrum for each in sources if (spectrum := _spectrum(each, rate)) is not None]
    if not series:
        raise MotionError(f"{data.name!r} has only invalid values", clip=motion.name)
    per = "cycles a frame" if period is None else "Hz"
    heads = [f"{label}, {per}" for label in ("strongest", "half below", "99 % below")]
    rows: list[list[object]] = [["of", "in", *heads]]
    rows += [[each.label, each.unit, *_marks(each.at, each.numbers)] for each in series]
    table = Sheet("Frequencies", rows_of(rows), "llrrr", "Half, and 99 %, of the power is below.")
    size = WIDTH, 60 + PANEL * len({each.unit for each in series})
    draw = partial(_draw_spectra, series=series, per=per)
    title = f"{motion.name}: {data.name}, spectrum"
    return Chart(title, size, draw, (table,), (*data.notes, *notes))


def _spectrum(series: _Series, rate: float) -> _Series | None:
    bridged = _bridge_gaps(series.numbers)
    if bridged is None:
        return None
    at, power = density(bridged, rate)
    return replace(series, at=at[1:], numbers=power[1:])


def density(column: Floats, rate: float) -> tuple[Floats, Floats]:
    """Frequencies and power spectral density of a channel, by Welch's method.

    The mean of pieces that overlap by half, each without its straight line, under a Hann window.
    SciPy has it too, but takes seconds to import.
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
    power[1 : (size + 1) // 2] *= 2  # power at negative frequencies
    return np.arange(size // 2 + 1, dtype=np.float64) * (rate / size), np.asarray(power)


def _draw_spectra(figure: Figure, theme: Theme, *, series: Sequence[_Series], per: str) -> None:
    for axes, own in _panels(figure, theme, series, per, f"({{unit}})² / {per}"):
        for place, each in enumerate(own):
            power = np.maximum(each.numbers, LEAST_POWER)
            color = _color(theme, place)
            axes.loglog(each.at, power, color=color, label=printable(each.label), linewidth=1.1)
        highest = max(float(each.numbers.max()) for each in own)
        if highest > LEAST_POWER / DEEP:
            axes.set_ylim(highest * DEEP, highest * 3)


def _speed(motion: Motion, index: int) -> list[_Series]:
    """The speed of a joint's point, if kinematics and rate are known."""
    if motion.timeline is None or motion.signals[0].samples_per_frame > 1:
        return []
    try:
        with np.errstate(all="ignore"):
            speed = np.sqrt((velocities(motion, [index])[:, 0] ** 2).sum(axis=1))
    except MczError:
        return []
    return [_Series("speed", f"{length_unit(motion)} a second", np.empty(0), speed)]


def _bridge_gaps(column: Floats) -> Floats | None:
    """A channel with unknown values bridged; None if none is known, or one is too large."""
    known = np.isfinite(column) & (np.abs(column) < 1e100)
    if not known.any():
        return None
    at = np.arange(len(column))
    filled: Floats = np.interp(at, at[known], column[known])
    return filled


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
