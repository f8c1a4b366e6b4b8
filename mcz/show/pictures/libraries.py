"""Libraries that only pictures need: imported on use, and named plainly where they are missing."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING

from mcz.model.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXTRAS = {"matplotlib": "plot", "PIL": "plot", "av": "render"}
PACKAGES = {"PIL": "pillow", "av": "av (PyAV)"}


def library(name: str) -> ModuleType:
    """The module ``name``; OptionError that names the extra of mcz where it is not installed."""
    top = name.partition(".")[0]
    return import_extra(name, EXTRAS[top], package=PACKAGES.get(top, top), purpose="this picture")


def new_figure(width: int, height: int, **options: object) -> Figure:
    """A matplotlib figure of so many pixels, apart from every global state of pyplot."""
    library("matplotlib")
    canvas = library("matplotlib.backends.backend_agg")
    figure: Figure = library("matplotlib.figure").Figure(
        figsize=(width / DPI, height / DPI), dpi=DPI, **options
    )
    canvas.FigureCanvasAgg(figure)
    return figure


DPI = 100
SVG = {"svg.fonttype": "path", "svg.hashsalt": "mcz", "axes.unicode_minus": False}


@contextmanager
def quietly() -> Iterator[None]:
    """Draw letters that the font lacks as boxes, without a word, and SVG the same every time."""
    matplotlib = library("matplotlib")
    with warnings.catch_warnings(), matplotlib.rc_context(SVG):
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        warnings.filterwarnings("ignore", message="Matplotlib currently does not support")
        yield
