"""``mcz.plot``: numbers of a motion as a chart, in a picture or on a page with its tables.

The charts of bytes, of parts of a clip and against errors, are here as well.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mcz.codecs import codec_by_name
from mcz.codecs.contract import Codec
from mcz.codecs.parameters import Dial
from mcz.container.limits import BASE
from mcz.errors import MczError, OptionError
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import open
from mcz.files.reading.sizes import by_group, byte_shares, clip_sizes
from mcz.files.reading.source_files import SourceOptions
from mcz.files.writing.clip_writer import write_trial
from mcz.files.writing.planning import prepare
from mcz.kinematics.frames import MOTION_OR_CLIP, Frames, MotionLike, frame_range
from mcz.kinematics.metrics import Comparison, compare
from mcz.kinematics.metrics.sums import scale_figure
from mcz.model.checks import FRAMES, PATH, check_arguments
from mcz.model.motion import Motion
from mcz.show.pictures.canvases import Theme, import_library, rgb
from mcz.show.pictures.channel_charts import Selection, channel_chart, spectrum_chart
from mcz.show.pictures.charts import Chart, Sheet, legend, name_ticks, rows_of, save, style
from mcz.show.pictures.error_charts import error_chart
from mcz.show.pictures.rendering import Progress, check_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


OTHER = "exceptions, masks"  # bytes outside of the codec
LONGEST = 44  # letters of the joints of a group
MOST_BARS = 32  # groups that have a bar of their own
WIDTH = 1000
STEPS = (1 / 16, 1 / 4, 1.0, 2.0, 4.0, 16.0)  # of a middling setting of the dial
MIDDLING_CM = 0.1  # mean error for the first setting of a dial
FIGURES = ("mean_position_error", "max_position_error")


Sort = int | None  # a resolution; None: outside of the codec
Parts = dict[Sort, int]  # bytes


def bytes_chart(clip: Clip) -> Chart:
    """The payload of a clip by group of channels and resolution; figures of ``mcz info``."""
    groups = by_group(byte_shares(clip))
    present_sorts = {sort for own in groups.values() for sort in own}
    sorts = sorted(present_sorts, key=lambda sort: (sort is None, sort))
    total = sum(sum(own.values()) for own in groups.values())
    ordered = sorted(groups.items(), key=lambda each: -sum(each[1].values()))
    if len(groups) == 1 and len(sorts) > 1:  # of a single group the resolutions are shown
        ((_, own),) = ordered
        bars: list[tuple[str, Parts]] = [(part_name(sort), {sort: own[sort]}) for sort in sorts]
    else:
        bars = _with_rest(ordered)
    rows: list[list[object]] = [["joints", *map(part_name, sorts), "bytes", "share"]]
    for name, own in ordered:
        size = sum(own.values())
        share = f"{100 * size / total:.1f} %"
        rows.append([name, *(own.get(sort, 0) for sort in sorts), size, share])
    table = Sheet(
        "Payload by joint and resolution",
        rows_of(rows),
        "l" + "r" * (len(sorts) + 2),
        f"{total:,} bytes of payload; resolution 0 is the coarsest.",
    )
    title = f"{clip.name}: {total:,} bytes of payload, codec {clip.codec}"
    draw = partial(_draw_bars, bars=bars, sorts=sorts)
    return Chart(title, (WIDTH, 110 + 24 * max(3, len(bars))), draw, (table,))


def part_name(sort: Sort) -> str:
    return OTHER if sort is None else f"resolution {sort}"


def _draw_bars(
    figure: Figure, theme: Theme, *, bars: Sequence[tuple[str, Parts]], sorts: Sequence[Sort]
) -> None:
    axes = style(figure.subplots(), theme, x="bytes")
    places, left = np.arange(len(bars))[::-1], np.zeros(len(bars))
    ramp = _colors_of_parts(theme, sorts)
    for sort in sorts:
        sizes = np.array([own.get(sort, 0) for _, own in bars], float)
        axes.barh(places, sizes, left=left, color=ramp[sort], label=part_name(sort), height=0.72)
        left += sizes
    name_ticks(axes, places, [name for name, _ in bars], LONGEST)
    axes.margins(y=0.02)
    axes.xaxis.set_major_formatter("{x:,.0f}")
    if len(sorts) > 1 and any(len(own) > 1 for _, own in bars):
        legend(axes, theme, loc="lower right")


def _with_rest(ordered: Sequence[tuple[str, Parts]]) -> list[tuple[str, Parts]]:
    bars, rest = list(ordered[:MOST_BARS]), ordered[MOST_BARS:]
    if rest:
        sums: Parts = {}
        for _, own in rest:
            for sort, size in own.items():
                sums[sort] = sums.get(sort, 0) + size
        bars.append((f"{len(rest)} others", sums))
    return bars


def _colors_of_parts(theme: Theme, sorts: Sequence[Sort]) -> dict[Sort, Any]:
    """Colors: resolutions from strong to pale, other parts in another color."""
    strong, pale = np.array(rgb(theme.series[0])), np.array(rgb(theme.grid))
    levels = [sort for sort in sorts if sort is not None]
    colors: dict[Sort, Any] = dict.fromkeys(sorts, theme.series[1])
    for number, sort in enumerate(levels):
        share = 0.8 * number / max(1, len(levels) - 1)
        colors[sort] = tuple(strong * (1 - share) + pale * share)
    return colors


@dataclass(frozen=True, slots=True)
class _Point:
    """Result of a codec at a setting of its dial."""

    codec: str
    setting: str
    n_bytes: int
    figures: Comparison


def rate_chart(
    motion: Motion, codecs: Sequence[str], progress: Callable[[int, int, str], None]
) -> Chart:
    """Bytes and errors of ``motion`` at a few settings of lossy codecs.

    Raises OptionError for a codec without a dial, and if no setting worked.
    """
    points: list[_Point] = []
    for place, name in enumerate(codecs):
        report = partial(_report_setting, progress, place, len(codecs))
        points += _points(motion, name, report)
    known = motion.skeleton.unit_cm
    factor, unit = (10.0 * known, "mm") if known is not None else (1.0, "units")
    rows: list[list[object]] = [["codec", "setting", "bytes", f"mean {unit}", f"greatest {unit}"]]
    for point in points:
        errors = [scale_figure(getattr(point.figures, key), factor) for key in FIGURES]
        rows.append([point.codec, point.setting, point.n_bytes, *errors])
    table = Sheet(
        "Bytes and errors",
        rows_of(rows),
        "llrrr",
        "Bytes of payload, overhead and models; errors as mcz diff has them.",
    )
    title = f"{motion.name}: {motion.n_frames:,} frames, bytes against error"
    draw = partial(_draw_rates, points=points, factor=factor, unit=unit)
    return Chart(title, (WIDTH, 460), draw, (table,))


def _report_setting(
    progress: Callable[[int, int, str], None], place: int, count: int, step: int, name: str
) -> None:
    progress(place * len(STEPS) + step, count * len(STEPS), name)


def _draw_rates(
    figure: Figure, theme: Theme, *, points: Sequence[_Point], factor: float, unit: str
) -> None:
    for axes, key in zip(figure.subplots(1, 2), FIGURES, strict=True):
        word = "mean" if key.startswith("mean") else "greatest"
        style(axes, theme, x="bytes", y=f"{word} position error, {unit}")
        for place, name in enumerate(dict.fromkeys(point.codec for point in points)):
            own = [(p.n_bytes, getattr(p.figures, key)) for p in points if p.codec == name]
            pairs = [(n_bytes, error * factor) for n_bytes, error in own if error]
            if pairs:
                color = theme.series[place % len(theme.series)]
                axes.loglog(*zip(*pairs, strict=True), "o-", color=color, label=name, ms=4)
        legend(axes, theme, loc="upper right")
        _plain_ticks(axes)


def _plain_ticks(axes: Axes) -> None:
    ticker = import_library("matplotlib.ticker")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(ticker.LogLocator(subs=(1.0, 3.0), numticks=12))
        axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:,.6g}"))
        axis.set_minor_formatter(ticker.NullFormatter())


def _points(motion: Motion, name: str, report: Callable[[int, str], None]) -> list[_Point]:
    """A point for each setting that works; raises OptionError if none does."""
    codec = codec_by_name(name)
    if codec.dial is None:
        raise OptionError(f"codec {name} has no parameter that varies its rate")
    points, why = [], ""
    for step, setting in enumerate(_settings(codec.dial)):
        text = f"{codec.dial.parameter}={setting:.4g}"
        report(step, f"{name} {text}")
        try:
            points.append(_Point(name, text, *_try_setting(motion, codec, setting)))
        except MczError as error:
            why = str(error)
    if not points:
        raise OptionError(f"codec {name}: no setting works for this motion: {why}")
    return points


def _settings(dial: Dial) -> list[float]:
    middle = (dial.guess and dial.guess("mean_error_cm", MIDDLING_CM)) or 1.0
    settings = [min(max(middle * step, dial.low), dial.high) for step in STEPS]
    return list(dict.fromkeys(max(1, round(s)) if dial.is_integer else s for s in settings))


def _try_setting(motion: Motion, codec: Codec, setting: float) -> tuple[int, Comparison]:
    assert codec.dial is not None
    alone = replace(motion, signals=motion.signals[:1], source=None, metadata={})
    params = {codec.dial.parameter: setting}
    data = write_trial(prepare(alone, codec, params), codec, params, BASE).data
    with open(data, max_decoded=2**53) as file:
        clip = file.only_clip()
        sizes = clip_sizes(file.container, clip)
        figures = compare(alone, clip.motion(), virtual_markers=False, shell_cm=None)
    return sizes.payload + sizes.overhead + sizes.models, figures


KINDS = ("channels", "spectrum", "error", "bytes", "rate-distortion")
CODECS = ("posewave", "mrdwt")  # of a chart of rate and distortion, by default


@dataclass(frozen=True, slots=True)
class Plotted:
    """A written plot: ``tables`` are the numbers of the chart, headings first, as text."""

    path: str
    what: str
    title: str
    tables: tuple[tuple[tuple[str, ...], ...], ...]
    notes: tuple[str, ...] = ()


@check_arguments(motion=MOTION_OR_CLIP, path=PATH, other=MOTION_OR_CLIP, frames=FRAMES)
def plot(
    motion: MotionLike,
    path: str | os.PathLike[str],
    what: str | None = None,
    *,
    other: MotionLike | None = None,
    joint: int | str | None = None,
    signal: int | str | None = None,
    channels: str | Sequence[str] | None = None,
    frames: Frames = None,
    codecs: Sequence[str] = CODECS,
    theme: str = "light",
    size: tuple[int, int] | None = None,
    rate: float | Fraction | None = None,
    unit: str | None = None,
    up: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Plotted:
    """Draw numbers of a Motion or a Clip into ``path``: a .png, a .svg, or a .html with its tables.

    ``what``: "channels" of ``joint`` over time (None: of the first that has any), or of another
    ``signal``, such as "analog", by their names in ``channels``; their "spectrum", the "error" of
    ``other`` against ``motion`` (the default if it is given), the "bytes" of a clip by joint and
    resolution, or "rate-distortion" at a few settings of lossy ``codecs``. Only ``frames`` (a, b)
    are drawn; ``rate``, ``unit`` and ``up`` are for motions that state none. A page has both
    themes. Raises OptionError, MotionError, ExistsError.
    """
    what = what or ("channels" if other is None else "error")
    if what not in KINDS:
        raise OptionError(f"unknown plot {what!r}; it must be one of {', '.join(KINDS)}")
    if (other is None) == (what == "error"):
        text = "takes the two that are compared" if what == "error" else "is of one motion"
        raise OptionError(f"a plot of {what} {text}")
    names = (channels,) if isinstance(channels, str) else channels
    selection = Selection(joint, signal, None if names is None else tuple(names))
    if selection != Selection() and what not in ("channels", "spectrum"):
        one = next(each for each in (joint, signal, names) if each is not None)
        raise OptionError(f"a plot of {what} shows all joints, so {one!r} cannot be chosen")
    size = check_size(size)
    cut = frame_range(motion, frames)
    facts = SourceOptions(rate=rate, unit=unit, up=up)
    chart = _chart(
        motion, what, other, selection, cut, codecs, facts, progress or (lambda *_: None)
    )
    save(chart, path, theme=theme, size=size, force=force)
    tables = tuple(tuple(map(tuple, table.rows)) for table in chart.tables)
    return Plotted(str(path), what, chart.title, tables, chart.notes)


def _chart(
    subject: MotionLike,
    kind: str,
    other: MotionLike | None,
    selection: Selection,
    cut: tuple[int, int],
    codecs: Sequence[str],
    facts: SourceOptions,
    progress: Progress,
) -> Chart:
    if kind == "bytes":
        if not isinstance(subject, Clip):
            raise OptionError("a plot of bytes needs an .mcz", clip=subject.name)
        return bytes_chart(subject)
    motion = _motion(subject, cut, facts)
    if other is not None:
        theirs = _motion(other, cut if other.n_frames == subject.n_frames else None, facts)
        return error_chart(motion, theirs, facts.up, cut[0])
    if kind == "rate-distortion":
        return rate_chart(motion, codecs, progress)
    if kind == "spectrum":
        return spectrum_chart(motion, selection)
    return channel_chart(motion, selection, cut[0])


def _motion(subject: MotionLike, cut: tuple[int, int] | None, facts: SourceOptions) -> Motion:
    if isinstance(subject, Motion):
        motion = subject
        if cut is not None and cut != (0, subject.n_frames):
            motion = subject.cut(*cut)
    else:
        clip: Any = subject
        motion = clip.motion(cut)
    return facts.complete(motion)
