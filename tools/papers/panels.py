"""Plots of lines in panels, one a clip or a method, as PNG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcz.bench.report import MARKS, PUBLISHED, plain_ticks

N_COLUMNS = 3


@dataclass(frozen=True, slots=True)
class Line:
    """Points (x, y); ``dashed``: a comparator, or a setting as published."""

    label: str
    points: tuple[tuple[float, float], ...]
    dashed: bool = False
    marked: bool = True


@dataclass(frozen=True, slots=True)
class Panels:
    """One file: what it is called, what the axes are, titles of panels with their lines."""

    name: str
    title: str
    axes: tuple[str, str]
    panels: tuple[tuple[str, tuple[Line, ...]], ...]
    logarithmic: tuple[bool, bool] = (True, True)


def draw(figures: Sequence[Panels], folder: Path) -> Iterator[Path]:
    """One PNG a figure that has lines; matplotlib is imported when the first is drawn."""
    for figure in figures:
        if any(lines for _, lines in figure.panels):
            path = folder / f"{figure.name}.png"
            _draw(figure, path)
            yield path


def _draw(figure: Panels, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = [(title, lines) for title, lines in figure.panels if lines]
    n_columns = min(N_COLUMNS, len(panels))
    n_rows = -(-len(panels) // n_columns)
    sheet: Any = Figure(figsize=(5 * n_columns + 0.5, 1.2 + 4.2 * n_rows), layout="constrained")
    FigureCanvasAgg(sheet)
    grid = sheet.subplots(n_rows, n_columns, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.remove()
    labels = list(dict.fromkeys(line.label for _, lines in panels for line in lines))
    handles: dict[str, Any] = {}
    for axes, (title, lines) in zip(grid, panels, strict=False):
        for line in lines:
            handles.setdefault(line.label, _line(axes, line, labels.index(line.label)))
        _finish(axes, figure, title)
    shown = [label for label in labels if label in handles]
    sheet.legend(
        [handles[label] for label in shown],
        shown,
        loc="outside lower center",
        ncols=min(5, len(shown)),
        frameon=False,
    )
    sheet.suptitle(figure.title)
    sheet.savefig(path, dpi=110)


def _line(axes: Any, line: Line, number: int) -> Any:
    (handle,) = axes.plot(
        *zip(*line.points, strict=True),
        linestyle=PUBLISHED if line.dashed else "-",
        marker=MARKS[number % len(MARKS)] if line.marked else None,
        markersize=4,
        linewidth=1.3,
        color=f"C{number % 10}",
    )
    return handle


def _finish(axes: Any, figure: Panels, title: str) -> None:
    for wanted, scale, axis in zip(
        figure.logarithmic,
        (axes.set_xscale, axes.set_yscale),
        (axes.xaxis, axes.yaxis),
        strict=True,
    ):
        if wanted:
            scale("log")
            plain_ticks(axis)
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(figure.axes[0], fontsize=9)
    axes.set_ylabel(figure.axes[1], fontsize=9)
    axes.grid(True, which="both", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=8)
