"""A chart: its drawing, its numbers as tables, and their files."""

from __future__ import annotations

import base64
import hashlib
import io
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.files.writing.atomic import replacing
from mcz.kinematics.chain import Floats
from mcz.model.text_format import printable, shorten
from mcz.model.types import Settings
from mcz.show.pictures.canvases import THEMES, Theme, new_figure, plot_context, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike


SUFFIXES = (".png", ".svg", ".html")
MOST_TITLE, MOST_LABEL = 120, 40  # characters of texts in a picture
MOST_POINTS = 3000  # of a line; beyond, the least and the greatest of neighbors


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

    Raises OptionError, ExistsError if ``path`` exists and not ``force``.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise OptionError(f"a plot must be one of {', '.join(SUFFIXES)}, by its suffix", path=path)
    colors = theme_of(theme)
    width, height = size or chart.size
    if suffix == ".html":
        data = html(chart, (width, height))
    else:
        data = picture_bytes(chart, colors, (width, height), suffix[1:])
    with replacing(path, force=force) as stream:
        stream.write(data)


def picture_bytes(
    chart: Chart, theme: Theme, size: tuple[int, int], kind: str, *, titled: bool = True
) -> bytes:
    """The picture as bytes of a PNG or an SVG, ``kind`` "png" or "svg"."""
    figure = new_figure(*size, facecolor=theme.ground, layout="constrained")
    out = io.BytesIO()
    with plot_context():
        if titled:
            heading = {"color": theme.ink, "fontsize": 11, "fontweight": "bold", "ha": "left"}
            figure.suptitle(shorten(chart.title, MOST_TITLE), parse_math=False, x=0.012, **heading)
        about = {"Date": None, "Title": shorten(chart.title, MOST_TITLE)} if kind == "svg" else {}
        try:
            chart.draw(figure, theme)
            figure.savefig(out, format=kind, metadata=about, dpi=100 if kind == "svg" else 150)
        except (ValueError, OverflowError) as error:  # numbers near the end of float64
            raise MotionError(f"{chart.title}: its numbers cannot be drawn: {error}") from None
    return out.getvalue()


def html(chart: Chart, size: tuple[int, int]) -> bytes:
    """A page of the chart in both themes and its tables, as UTF-8."""
    pictures = {
        name: data_uri(picture_bytes(chart, theme, size, "svg", titled=False), "svg+xml")
        for name, theme in THEMES.items()
    }
    page = ChartPage(chart.title, chart.notes)
    page.add_picture(chart.title, pictures["light"], pictures["dark"])
    for table in chart.tables:
        page.add_table(table)
    return page.html()


def style(axes: Axes, theme: Theme, *, x: str = "", y: str = "", title: str = "") -> Axes:
    """Axes in the colors of the theme, with texts that are not parsed as mathematics."""
    axes.set_facecolor(theme.ground)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(theme.grid)
    axes.tick_params(colors=theme.quiet, labelsize=8, which="both")
    axes.grid(True, color=theme.grid, linewidth=0.6)
    axes.set_axisbelow(True)
    words: Settings = {"parse_math": False, "color": theme.quiet, "fontsize": 9}
    axes.set_xlabel(shorten(x, MOST_LABEL), **words)
    axes.set_ylabel(shorten(y, MOST_LABEL), **words)
    heading: Settings = {"loc": "left", "fontsize": 9.5}
    axes.set_title(shorten(title, MOST_TITLE), **words | heading | {"color": theme.ink})
    return axes


def legend(axes: Axes, theme: Theme, **options: Any) -> None:
    """The legend in the colors of the theme; its texts are not parsed as mathematics."""
    box = axes.legend(frameon=False, fontsize=8, labelcolor=theme.ink, **options)
    for text in box.get_texts():
        text.set_parse_math(False)


def name_ticks(axes: Axes, places: ArrayLike, names: Sequence[str], most: int) -> None:
    """Names of bars at their places, long ones cut, not parsed as mathematics."""
    labels = [shorten(name, most) for name in names]
    for tick in axes.set_yticks(places, labels):
        tick.label1.set_parse_math(False)
    axes.grid(False, axis="y")


def line(axes: Axes, x: Floats, y: Floats, color: str, label: str = "", **options: Any) -> None:
    """A line of many points, of which only the visible ones are drawn; breaks where y is NaN."""
    x, y = thin_line(x, y)
    axes.plot(x, y, color=color, label=shorten(label, MOST_LABEL), **{"linewidth": 1.1} | options)


def thin_line(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """A line with fewer points: the least and the greatest of each run of neighbors."""
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
    """Cells as text: short numbers, whole counts."""
    return [[_cell(cell) for cell in row] for row in rows]


def _cell(cell: object) -> str:
    if isinstance(cell, int):
        return f"{cell:,}"
    return number(cell) if cell is None or isinstance(cell, float) else str(cell)


STYLE = """
:root { color-scheme: light dark; --ground: #fbfbf9; --ink: #1f2328; --quiet: #5b626a;
  --line: #d9dcdf; --stripe: #f1f2f0; }
@media (prefers-color-scheme: dark) { :root { --ground: #16191d; --ink: #eceff1; --quiet: #a3abb3;
  --line: #353b42; --stripe: #1d2126; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 75rem; background: var(--ground);
  color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.4rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
h2 { font-size: 1.1rem; margin: 2.5rem 0 .5rem; overflow-wrap: anywhere; }
p, li, figcaption { color: var(--quiet); max-width: 60rem; overflow-wrap: anywhere; }
figure { margin: 1rem 0; }
img { max-width: 100%; height: auto; display: block; border-radius: .4rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid var(--line); text-align: left;
  white-space: nowrap; }
th.n, td.n { text-align: right; }
thead th { color: var(--quiet); font-weight: 600; }
tbody tr:nth-child(even) { background: var(--stripe); }
nav a { color: inherit; }
"""
POLICY = (
    "default-src 'none'; img-src data:; style-src '{style}'; base-uri 'none'; form-action 'none'"
)


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table: its first row are headings; ``right`` has "r" for each column of numbers."""

    title: str
    rows: Sequence[Sequence[str]]
    right: str = ""
    caption: str = ""


@dataclass(frozen=True, slots=True)
class ChartPage:
    """Pictures and tables, one below the other."""

    title: str
    notes: Sequence[str] = ()
    parts: list[str] = field(default_factory=list)
    headings: list[str] = field(default_factory=list)

    def add_picture(self, name: str, light: str, dark: str) -> None:
        """Add a picture on light and on dark ground, each as a data: URI."""
        source = f'<source media="(prefers-color-scheme: dark)" srcset="{_text(dark)}">'
        image = f'<img src="{_text(light)}" alt="{_text(name)}">'
        self.parts.append(f"<figure><picture>{source}{image}</picture></figure>")

    def add_table(self, table: Sheet) -> None:
        if table.title:
            self.add_heading(table.title)
        if table.caption:
            self.parts.append(f"<p>{_text(table.caption)}</p>")
        head, *body = table.rows
        sides = table.right.ljust(len(head), "l")
        rows = "".join(f"<tr>{_cells(row, sides, 'td')}</tr>\n" for row in body)
        heads = _cells(head, sides, "th")
        # It scrolls by itself, so that the keyboard reaches it too.
        self.parts.append(
            f'<div class="scroll" tabindex="0" role="region" aria-label="{_text(table.title)}">'
            f"<table><thead><tr>{heads}</tr></thead>\n<tbody>{rows}</tbody></table></div>"
        )

    def add_heading(self, text: str) -> None:
        self.headings.append(text)
        self.parts.append(f'<h2 id="part{len(self.headings)}">{_text(text)}</h2>')

    def html(self) -> bytes:
        """The page as UTF-8."""
        style = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode("ascii")
        policy = POLICY.format(style=f"sha256-{style}")
        notes = "".join(f"<li>{_text(note)}</li>" for note in self.notes)
        items = f"<ul>{notes}</ul>" if notes else ""
        contents = ""
        if len(self.headings) > 3:
            links = (
                f'<li><a href="#part{number}">{_text(text)}</a></li>'
                for number, text in enumerate(self.headings, 1)
            )
            contents = f'<nav aria-label="Contents"><ul>{"".join(links)}</ul></nav>'
        body = "\n".join(self.parts)
        return (
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{_text(self.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n"
            f"<h1>{_text(self.title)}</h1>\n{items}{contents}\n{body}\n</main>\n</body>\n</html>\n"
        ).encode("utf-8", "backslashreplace")


def data_uri(data: bytes, kind: str) -> str:
    """A picture, "png" or "svg+xml", as a data: URI."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _cells(row: Sequence[str], sides: str, tag: str) -> str:
    scope = ' scope="col"' if tag == "th" else ""
    kinds = {"r": ' class="n"', "l": ""}
    return "".join(
        f"<{tag}{scope}{kinds[side]}>{_text(cell)}</{tag}>"
        for cell, side in zip(row, sides, strict=True)
    )


def _text(text: str) -> str:
    """Text for a page, also between quotes; control characters are shown."""
    return escape(printable(text))
