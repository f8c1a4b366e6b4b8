"""A whole run of the benchmark: its measurements, document, report and plots."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mcz
from mcz.bench import peers, sweep
from mcz.bench.cases import cases_by_names, find_cases, variants_of
from mcz.bench.sweep import ClipResult, Curve
from mcz.bench.tables import ResultTable
from mcz.bench.tasks import Runner
from mcz.model.types import JsonObject
from mcz.show.pictures.canvases import THEMES, Theme, theme_of
from mcz.show.pictures.charts import ChartPage, Sheet, data_uri

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis


Figures = Callable[[Path], Iterator[Path]]  # draws into a folder, yields the paths

MISSING = "no plots, because matplotlib is not installed (pip install 'mcz[plot]')"
MARKS = "osD^vP*X<>"
PUBLISHED = (0, (4, 2))  # dashes of presets that follow a paper
PEER = (0, (1, 1.5))
LINES = ("blue", "orange", "green", "red", "purple", "brown", "pink", "gray", "olive", "cyan")
BRIGHTER = 0.3  # of the way to white, lines on dark ground
LONG_AXIS = 3.2  # decades of an axis
MOST_WIDE = 2  # times the greatest size of our codecs: right edge for peers


def can_draw() -> bool:
    return find_spec("matplotlib") is not None


def draw_all(figures: Iterable[Figures], folder: Path, theme: str) -> list[Path]:
    """Draw all ``figures`` into a folder, in the colors of a theme, "light" or "dark"."""
    from matplotlib import rc_context

    with rc_context(_colors(theme_of(theme))):
        return [path for each in figures for path in each(folder)]


def _colors(theme: Theme) -> Any:
    """Settings of matplotlib: ten colors of lines, brighter on a dark ground."""
    from cycler import cycler
    from matplotlib.colors import to_rgb

    share = BRIGHTER if theme is THEMES["dark"] else 0.0
    lines = [tuple(c + share * (1 - c) for c in to_rgb(f"tab:{name}")) for name in LINES]
    ground = ("figure.facecolor", "axes.facecolor", "savefig.facecolor")
    quiet = ("xtick.color", "ytick.color", "axes.edgecolor", "axes.labelcolor")
    return {
        **dict.fromkeys(ground, theme.ground),
        **dict.fromkeys(quiet, theme.quiet),
        "text.color": theme.ink,
        "grid.color": theme.grid,
        "axes.prop_cycle": cycler(color=lines),
    }


def draw(clips: Sequence[ClipResult], folder: Path) -> Iterator[Path]:
    """One plot a clip with all its codecs, and one a codec with all its variants."""
    for clip in clips:
        if not clip.lossy:
            continue
        path = folder / f"{_plain(clip.name)}.png"
        _draw(clip, clip.plotted_curves, path, clip.name)
        yield path
        names = list(dict.fromkeys(c.variant.codec for c in clip.lossy if c.variant))
        for name in names:
            own = [c for c in clip.lossy if c.variant and c.variant.codec == name]
            path = folder / f"{_plain(clip.name)}_{name}.png"
            _draw(clip, own, path, f"{clip.name}, {name}", labels=True)
            yield path


def _plain(name: str) -> str:
    return re.sub(r"[^\w.-]", "_", name)


def _panels(clip: ClipResult) -> list[tuple[str, str, bool]]:
    """Key, axis label, whether the axis is logarithmic."""
    panels = [(clip.error_key, f"mean position error, joints ({clip.unit})", True)]
    if clip.unit_cm:
        panels.append(("virtual_marker_mean_cm", "mean position error, virtual markers (cm)", True))
    mse = "MSE of channels (degrees and length units, squared)"
    return [*panels, ("mse", mse, True), ("sqnr_db", "SQNR of positions (dB)", False)]


def _draw(
    clip: ClipResult, curves: Sequence[Curve], path: Path, title: str, *, labels: bool = False
) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = [p for p in _panels(clip) if any(curve.pairs(p[0]) for curve in curves)]
    n_rows = -(-len(panels) // 2)
    figure = Figure(figsize=(13, 1.2 + 4.6 * n_rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(n_rows, 2, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.remove()
    for axes, panel in zip(grid, panels, strict=False):
        _panel(axes, clip, curves, panel, labels)
    handles, names = grid[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(f"{title}: {clip.n_frames:,} frames, {clip.source_bytes:,} bytes of source")
    figure.savefig(path, dpi=110)


def _panel(
    axes: Axes,
    clip: ClipResult,
    curves: Sequence[Curve],
    panel: tuple[str, str, bool],
    labels: bool,
) -> None:
    """Draw the curves of one figure of a clip over their sizes."""
    key, text, logarithmic = panel
    codecs = list(dict.fromkeys(c.variant.codec if c.variant else c.label for c in curves))
    widest = max((p["coded_bytes"] for c in curves if c.variant for p in c.points), default=0)
    for curve in curves:
        pairs = [pair for pair in curve.pairs(key) if pair[0] <= MOST_WIDE * widest]
        if not pairs:
            continue
        number = codecs.index(curve.variant.codec if curve.variant else curve.label)
        published = bool(curve.variant and curve.variant.is_published)
        style: object = PUBLISHED if published else "-" if curve.variant else PEER
        axes.plot(
            *zip(*pairs, strict=True),
            linestyle=style,
            marker=MARKS[number % len(MARKS)],
            markersize=4.5,
            markerfacecolor=axes.get_facecolor() if published else None,
            linewidth=1.4,
            color=f"C{number}" if curve.variant else "0.5",
            label=curve.label,
        )
        if labels:
            _label_points(axes, curve, key, published)
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    if logarithmic:
        axes.set_yscale("log")
        plain_ticks(axes.yaxis)
    axes.set_xlabel("coded bytes, payload and overhead")
    axes.set_ylabel(text)
    axes.grid(True, which="both", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    above = axes.secondary_xaxis(
        "top",
        functions=(
            lambda x: clip.source_bytes / _positive(x),
            lambda x: clip.source_bytes / _positive(x),
        ),
    )
    above.set_xlabel("CR: source bytes / coded bytes (cr_source)", fontsize=8)
    above.tick_params(which="both", labelsize=8)
    plain_ticks(above.xaxis)


def plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis at 1, 2 and 5, a long one only at 1, with plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    long = low > 0 and math.log10(high / low) > LONG_AXIS
    axis.set_major_locator(LogLocator(subs=(1.0,) if long else (1.0, 2.0, 5.0), numticks=30))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.12g}"))
    axis.set_minor_formatter(NullFormatter())


def _positive(x: Any) -> Any:
    import numpy as np

    return np.maximum(x, 1e-9)


def _label_points(axes: Axes, curve: Curve, key: str, published: bool) -> None:
    for point in curve.points:
        if point.get(key) and point["params"]:
            value = next(iter(point["params"].values()))
            axes.annotate(
                f"{value:.3g}",
                (point["coded_bytes"], point[key]),
                xytext=(4, -9 if published else 4),
                textcoords="offset points",
                fontsize=6.5,
                alpha=0.8,
            )


@dataclass(frozen=True, slots=True)
class BenchResult:
    """Outcome of a run: clips that were swept, tables, plots and remarks."""

    clips: list[ClipResult] = field(default_factory=list)
    tables: list[ResultTable] = field(default_factory=list)
    figures: list[Figures] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def document(self) -> JsonObject:
        return {
            "mcz": mcz.__version__,
            "clips": [clip.document() for clip in self.clips],
            "tables": [table.document() for table in self.tables],
            "notes": self.notes,
        }

    def markdown(self, plots: Sequence[str]) -> Iterator[str]:
        yield "# Codecs compared"
        yield ""
        yield f"By mcz {mcz.__version__}; its SPEC.md defines sizes, ratios and metrics."
        yield ""
        for note in self.notes:
            yield f"- {note}"
        if self.notes:
            yield ""
        for plot in plots:
            yield f"![{plot}]({plot})"
            yield ""
        for table in self.tables:
            yield from table.markdown()

    def page(self, plots: Sequence[tuple[Path, Path]]) -> bytes:
        """One page with all tables and the ``plots``, on light and on dark ground; UTF-8."""
        known = f"By mcz {mcz.__version__}; its SPEC.md defines sizes, ratios and metrics."
        page = ChartPage("Codecs compared", [known, *self.notes])
        for pair in plots:
            light, dark = (data_uri(plot.read_bytes(), "png") for plot in pair)
            page.add_picture(pair[0].stem, light, dark)
        for table in self.tables:
            page.add_table(Sheet(table.title, table.cells(), table.right, table.caption))
        return page.html()


def bench(
    paths: Sequence[str],
    runner: Runner,
    *,
    codecs: Sequence[str] = (),
    with_peers: bool = False,
    speeds: bool = True,
    unit: str | None = None,
) -> BenchResult:
    """Measure the clips of ``paths``; raises OptionError for an unknown codec or no clip at all."""
    variants = variants_of(codecs)
    cases = cases_by_names(find_cases(paths, unit))
    peer_names = peers.installed_peers() if with_peers else ()
    clips = sweep.measure_all(runner, cases, variants, speeds=speeds, peers=peer_names)
    outcome = BenchResult(clips, figures=[partial(draw, clips)])
    for clip in clips:
        outcome.tables.extend(sweep.tables(clip))
        outcome.notes.extend(
            f"{clip.name}, {curve.label}: {curve.error}" for curve in clip.curves if curve.error
        )
    if with_peers and peers.missing_peers():
        outcome.notes.append(f"peers that are not installed: {', '.join(peers.missing_peers())}")
    return outcome
