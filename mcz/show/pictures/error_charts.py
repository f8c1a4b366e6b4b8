"""The chart of errors: over time, by joint, and on the figure in its worst frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mcz.errors import MczError, MotionError
from mcz.kinematics.chain import Floats
from mcz.kinematics.metrics import compare
from mcz.kinematics.metrics.diff_document import joint_errors, pairs_of
from mcz.kinematics.metrics.sums import Distances, scale_figure
from mcz.kinematics.points import origins_of, positions_of
from mcz.model.motion import Motion
from mcz.model.types import Settings
from mcz.show.pictures.bodies import MIDDLE, Track, track_of
from mcz.show.pictures.canvases import Theme, import_library
from mcz.show.pictures.capsules import Shapes, Viewport, add_figure, add_shadow, pieces_of
from mcz.show.pictures.channel_charts import times_of
from mcz.show.pictures.charts import Chart, Sheet, legend, line, name_ticks, number, rows_of, style
from mcz.show.pictures.stages import stage_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLOCK = 2**19  # numbers that are worked on at a time
MOST_BARS = 18  # joints that have a bar
SIZE = (1100, 760)


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Distances in ``unit``, "mm" or "units".

    ``means`` and ``greatest`` of each frame are float64 (n_frames,), NaN where unknown; ``joints``
    (name, mean, greatest, its frame). ``frame`` and ``place`` belong to the greatest of all; frames
    count from 0 here.
    """

    unit: str
    means: Floats
    greatest: Floats
    joints: list[tuple[str, float | None, float | None, int | None]]
    mean: float
    most: float
    frame: int
    place: str
    notes: tuple[str, ...]


def errors_between(original: Motion, other: Motion) -> Errors:
    """Errors of ``other`` against ``original``: the figures of ``mcz diff``, and of each frame.

    Points in order if both have equally many, otherwise joints of the same names. Raises
    MotionError if the two differ in frames, or have no position in common.
    """
    figures = compare(original, other, virtual_markers=False, shell_cm=None)
    a, b = original.skeleton, other.skeleton
    factor = 1.0 if figures.unit_cm is None else 10.0 * figures.unit_cm
    unit = "units" if figures.unit_cm is None else "mm"
    if figures.points is None or len(figures.by_joint) != a.n_joints:
        return _by_names(original, other)
    scale = b.unit_cm / a.unit_cm if a.unit_cm and b.unit_cm else 1.0
    n_points = figures.points
    means, greatest = _over_time(
        original,
        other,
        lambda values: positions_of(a, values),
        lambda values: positions_of(b, values)[:, :n_points] * scale,
    )
    if figures.mean_position_error is None or figures.where is None:
        raise MotionError(f"{original.name!r}, {other.name!r}: no position is known in both")
    joints = [
        (
            each.joint,
            scale_figure(each.mean_position_error, factor),
            scale_figure(each.max_position_error, factor),
            each.frame,
        )
        for each in figures.by_joint
    ]
    assert figures.max_position_error is not None
    overall = (figures.mean_position_error * factor, figures.max_position_error * factor)
    return Errors(
        unit, means * factor, greatest * factor, joints, *overall, *figures.where, figures.notes
    )


def _by_names(original: Motion, other: Motion) -> Errors:
    """Errors by joint, for joints that both motions have."""
    figures = joint_errors(original, other)
    if figures.mean is None or figures.frame is None or figures.greatest is None:
        raise MotionError(f"{original.name!r}, {other.name!r}: no point or joint to compare")
    a, b = original.skeleton, other.skeleton
    factor = 1.0 if figures.unit_cm is None else 10.0 * figures.unit_cm
    scale = b.unit_cm / a.unit_cm if a.unit_cm and b.unit_cm else 1.0
    left, right = (list(side) for side in zip(*pairs_of(a, b), strict=True))
    sums = Distances(len(left))
    means, greatest = _over_time(
        original,
        other,
        lambda values: origins_of(a, values)[:, left],
        lambda values: origins_of(b, values)[:, right] * scale,
        sums,
    )
    per_frame = original.signals[0].samples_per_frame
    groups = sums.by_group([1] * len(left))
    joints = [
        (
            name,
            scale_figure(mean, factor),
            scale_figure(most, factor),
            None if row is None else row // per_frame,
        )
        for name, (mean, most, row) in zip(figures.joints, groups, strict=True)
    ]
    return Errors(
        "units" if figures.unit_cm is None else "mm",
        means * factor,
        greatest * factor,
        joints,
        figures.mean * factor,
        figures.greatest * factor,
        figures.frame,
        figures.joint or "",
        ("joints of the same names are compared; the points of the two are others",),
    )


def _over_time(
    original: Motion, other: Motion, ours: Any, theirs: Any, sums: Distances | None = None
) -> tuple[Floats, Floats]:
    """Mean and greatest distance of every frame, (n_frames,), NaN where none is known."""
    n_rows = original.signals[0].n_rows
    widest = max(12 * m.skeleton.n_joints + m.signals[0].n_channels for m in (original, other))
    step = max(1, BLOCK // max(1, widest))
    means, greatest = np.full(n_rows, np.nan), np.full(n_rows, np.nan)
    values = [np.asarray(motion.values, np.float64) for motion in (original, other)]
    for start in range(0, n_rows, step):
        rows = slice(start, start + step)
        with np.errstate(all="ignore"):  # overflow is no distance
            apart = ours(values[0][rows]) - theirs(values[1][rows])
            distances = np.sqrt((apart**2).sum(axis=2))
            known = np.isfinite(distances)
            filled = np.where(known, distances, 0.0)
            means[rows] = filled.sum(axis=1) / known.sum(axis=1)
            most = np.where(known, distances, -1.0).max(axis=1, initial=-1.0)
        greatest[rows] = np.where(most < 0, np.nan, most)
        if sums is not None:
            sums.add(start, filled, known)
    per_frame = original.signals[0].samples_per_frame
    frames = (means.reshape(-1, per_frame), greatest.reshape(-1, per_frame))
    return frames[0].mean(axis=1), frames[1].max(axis=1)


def error_chart(original: Motion, other: Motion, up: str | None, first: int = 0) -> Chart:
    """The chart of ``other`` against ``original``, whose frame 0 is ``first`` of the clip."""
    errors = errors_between(original, other)
    summary = (
        f"mean {number(errors.mean)} {errors.unit}, greatest {number(errors.most)} {errors.unit} "
        f"(frame {errors.frame + first}, {errors.place})"
    )

    rows: list[list[object]] = [
        ["joint", f"mean {errors.unit}", f"greatest {errors.unit}", "frame"]
    ]
    rows += [
        [name, mean, most, "-" if frame is None else str(frame + first)]
        for name, mean, most, frame in errors.joints
    ]
    table = Sheet("Errors by joint", rows_of(rows), "lrrr", summary)
    title = f"{other.name} against {original.name}: {summary}"
    draw = partial(_draw, motion=original, errors=errors, up=up, first=first)
    return Chart(title, SIZE, draw, (table,), errors.notes)


def _draw(
    figure: Figure, theme: Theme, *, motion: Motion, errors: Errors, up: str | None, first: int
) -> None:
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.3), height_ratios=(1, 1.15))
    _draw_figure(figure.add_subplot(grid[:, 0]), theme, motion, errors, up, first)
    _draw_time(figure.add_subplot(grid[0, 1]), theme, motion, errors, first)
    _draw_bars(figure.add_subplot(grid[1, 1]), theme, errors)


def _draw_time(axes: Axes, theme: Theme, motion: Motion, errors: Errors, first: int) -> None:
    at, when = times_of(motion, first)
    at = at[:: motion.signals[0].samples_per_frame]
    style(axes, theme, x=when, y=errors.unit, title="over time")
    line(axes, at, errors.greatest, theme.series[1], "greatest", linewidth=0.8)
    line(axes, at, errors.means, theme.series[0], "mean")
    axes.set_ylim(0, max(errors.most * 1.12, 1e-12))
    axes.plot(at[errors.frame], errors.most, "o", color=theme.series[1], markersize=5)
    legend(axes, theme, loc="upper right", ncols=2)


def _draw_bars(axes: Axes, theme: Theme, errors: Errors) -> None:
    known = [each for each in errors.joints if each[1] is not None and each[2] is not None]
    known.sort(key=lambda each: each[1] or 0.0, reverse=True)
    more = len(known) - MOST_BARS
    bars = known[:MOST_BARS][::-1]
    title = "by joint: mean, and a line to the greatest"
    title += f" ({more} with less left out)" if more > 0 else ""
    style(axes, theme, x=errors.unit, title=title)
    places = np.arange(len(bars))
    means, most = (np.array([each[k] for each in bars], float) for k in (1, 2))
    axes.barh(places, means, color=theme.series[0], height=0.68)
    axes.hlines(places, means, most, color=theme.series[1], linewidth=1.2)
    axes.plot(most, places, "|", color=theme.series[1], markersize=6)
    name_ticks(axes, places, [each[0] for each in bars], 20)
    axes.set_xlim(left=0)


def _draw_figure(
    axes: Axes, theme: Theme, motion: Motion, errors: Errors, up: str | None, first: int
) -> None:
    """The original in the frame of the greatest error, each joint in the color of its mean."""
    axes.set_axis_off()
    heading = f"frame {errors.frame + first}, colored by mean error"
    axes.set_title(heading, loc="left", fontsize=9.5, color=theme.ink)
    try:
        track = track_of(motion, np.array([errors.frame], np.int64), None, up)
    except MczError:  # nothing to show
        return
    most = max((each[1] or 0.0 for each in errors.joints), default=0.0) or 1.0
    colors, cm = import_library("matplotlib.colors"), import_library("matplotlib.cm")
    scale = cm.ScalarMappable(colors.Normalize(0.0, most), "viridis")
    means = {name: mean for name, mean, _, _ in errors.joints}
    by_joint = np.array(
        [
            theme.sides()[MIDDLE] if means.get(name) is None else scale.to_rgba(means[name])[:3]
            for name in motion.skeleton.addresses()
        ]
    )
    _add_polygons(axes, track, by_joint[track.body.joints], theme)
    place: Settings = {
        "ax": axes,
        "orientation": "horizontal",
        "shrink": 0.75,
        "aspect": 28,
        "pad": 0.02,
    }
    bar = axes.figure.colorbar(scale, **place)
    bar.outline.set_visible(False)
    bar.ax.tick_params(colors=theme.quiet, labelsize=8)
    bar.set_label(f"mean error, {errors.unit}", color=theme.quiet, fontsize=9)


def _add_polygons(axes: Axes, track: Track, colors: Floats, theme: Theme) -> None:
    """The only frame of a track, with its nodes in these colors (n_nodes, 3)."""
    port = Viewport(0, 0, 420, 560)
    camera = stage_of(track, theme, "front", port, None, 1.0).camera
    ((_, nodes),) = track
    pieces = pieces_of(track, nodes, colors)
    shadows, figures = Shapes(), Shapes()
    add_shadow(shadows, camera, pieces, track.floor, theme)
    add_figure(figures, camera, pieces, theme, track.size)
    polygons = import_library("matplotlib.collections").PolyCollection
    for shapes in (shadows, figures):
        corners, shades = shapes.arrays()
        axes.add_collection(polygons(corners, facecolors=shades, linewidths=0), autolim=False)
    axes.set_xlim(0, port.width)
    axes.set_ylim(0, port.height)
    axes.set_aspect("equal")
