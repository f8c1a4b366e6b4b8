"""A chart: what is drawn, the numbers of it as tables, and how both become a file."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.files.writing.atomic import replacing
from mcz.kinematics.chain import Floats
from mcz.model.text_format import printable
from mcz.model.types import Settings
from mcz.show.pictures.chart_pages import ChartPage, Sheet, data_uri
from mcz.show.pictures.libraries import new_figure, quietly
from mcz.show.pictures.themes import THEMES, Theme, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

SUFFIXES = (".png", ".svg", ".html")
MOST_POINTS = 3000  # of a line: of more the least and the greatest of neighbors


@dataclass(frozen=True, slots=True)
class Chart:
    """``draw(figure, theme)`` draws it on ``size`` pixels; ``tables`` are its numbers."""

    title: str
    size: tuple[int, int]
    draw: Callable[[Figure, Theme], None]
    tables: tuple[Sheet, ...] = ()
    notes: tuple[str, ...] = field(default=())


def save(
    chart: Chart,
    path: str | os.PathLike[str],
    *,
    theme: str = "light",
    size: tuple[int, int] | None = None,
    force: bool = False,
) -> None:
    """Write a chart as .png, .svg or .html: a page with the tables, in light and dark.

    Raises OptionError, ExistsError where ``path`` is there and not ``force``.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OptionError(f"a plot is one of {', '.join(SUFFIXES)}, by its suffix", path=path)
    colors = theme_of(theme)
    width, height = size or chart.size
    if suffix == ".html":
        data = html(chart, (width, height))
    else:
        data = drawn(chart, colors, (width, height), suffix[1:])
    with replacing(path, force=force) as stream:
        stream.write(data)


def drawn(
    chart: Chart, theme: Theme, size: tuple[int, int], kind: str, *, titled: bool = True
) -> bytes:
    """The picture as bytes of a PNG or an SVG, ``kind`` "png" or "svg"."""
    figure = new_figure(*size, facecolor=theme.ground, layout="constrained")
    out = io.BytesIO()
    with quietly():
        if titled:
            heading = {"color": theme.ink, "fontsize": 11, "fontweight": "bold", "ha": "left"}
            figure.suptitle(printable(chart.title), parse_math=False, x=0.012, **heading)
        about = {"Date": None, "Title": printable(chart.title)} if kind == "svg" else {}
        try:
            chart.draw(figure, theme)
            figure.savefig(out, format=kind, metadata=about, dpi=100 if kind == "svg" else 150)
        except (ValueError, OverflowError) as error:  # of numbers near the end of float64
            raise MotionError(f"{chart.title}: its numbers cannot be drawn: {error}") from None
    return out.getvalue()


def html(chart: Chart, size: tuple[int, int]) -> bytes:
    """A page of the chart in both themes and its tables, as UTF-8."""
    pictures = {
        name: data_uri(drawn(chart, theme, size, "svg", titled=False), "svg+xml")
        for name, theme in THEMES.items()
    }
    found = ChartPage(chart.title, chart.notes)
    found.add_picture(chart.title, pictures["light"], pictures["dark"])
    for table in chart.tables:
        found.add_table(table)
    return found.html()


def styled(axes: Axes, theme: Theme, *, x: str = "", y: str = "", title: str = "") -> Axes:
    """Axes in the colors of the theme, with words of which none is mathematics."""
    axes.set_facecolor(theme.ground)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(theme.grid)
    axes.tick_params(colors=theme.quiet, labelsize=8, which="both")
    axes.grid(True, color=theme.grid, linewidth=0.6)
    axes.set_axisbelow(True)
    words: Settings = {"parse_math": False, "color": theme.quiet, "fontsize": 9}
    axes.set_xlabel(printable(x), **words)
    axes.set_ylabel(printable(y), **words)
    heading: Settings = {"loc": "left", "fontsize": 9.5}
    axes.set_title(printable(title), **words | heading | {"color": theme.ink})
    return axes


def legend(axes: Axes, theme: Theme, **options: Any) -> None:
    """The legend in the colors of the theme; its texts are no mathematics."""
    found = axes.legend(frameon=False, fontsize=8, labelcolor=theme.ink, **options)
    for text in found.get_texts():
        text.set_parse_math(False)


def name_ticks(axes: Axes, places: ArrayLike, names: Sequence[str], most: int) -> None:
    """Names of bars at their places, long ones cut; none is mathematics."""
    shown = [printable(name) for name in names]
    shown = [name if len(name) <= most else f"{name[: most - 1]}…" for name in shown]
    for tick in axes.set_yticks(places, shown):
        tick.label1.set_parse_math(False)
    axes.grid(False, axis="y")


def line(axes: Axes, x: Floats, y: Floats, color: str, label: str = "", **options: Any) -> None:
    """A line of many points, of which those are drawn that are seen; breaks where y is NaN."""
    x, y = thinned(x, y)
    axes.plot(x, y, color=color, label=printable(label), **{"linewidth": 1.1} | options)


def thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The same line with fewer points: of each run of neighbors its least and its greatest."""
    if len(y) <= MOST_POINTS:
        return x, y
    width = -(-2 * len(y) // MOST_POINTS)
    starts = np.arange(0, len(y), width)
    with np.errstate(invalid="ignore"):
        low, high = (way.reduceat(y, starts) for way in (np.fmin, np.fmax))
    at = np.minimum(starts + width // 2, len(y) - 1)
    return np.repeat(x[at], 2), np.stack([low, high], axis=1).ravel()


def number(value: float | None, digits: int = 4) -> str:
    """
    >>> number(0.123456), number(None), number(12345.6)
    ('0.1235', '-', '1.235e+04')
    """
    return "-" if value is None or not np.isfinite(value) else f"{value:.{digits}g}"


def rows_of(rows: Sequence[Sequence[object]]) -> list[list[str]]:
    """Cells as text: numbers short, counts whole."""
    return [[_cell(cell) for cell in row] for row in rows]


def _cell(cell: object) -> str:
    if isinstance(cell, int):
        return f"{cell:,}"
    return number(cell) if cell is None or isinstance(cell, float) else str(cell)
