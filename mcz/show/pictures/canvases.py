"""A picture of lines, polygons and words, which matplotlib draws: as pixels or as SVG."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcz.kinematics.chain import Floats
from mcz.model.text_format import printable
from mcz.show.pictures.libraries import library, new_figure, quietly
from mcz.show.pictures.themes import Theme

Pixels = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Word:
    """A line of text; ``x`` and ``y`` in pixels from the lower left corner."""

    x: float
    y: float
    text: str
    color: str
    size: float
    side: str = "left"  # of the text at x
    bold: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """Contents of one picture, from the back: lines, shadows, figures, words."""

    lines: tuple[Floats, Floats]
    shadows: tuple[Floats, Floats]
    figures: tuple[Floats, Floats]
    words: list[Word] = field(default_factory=list)


class Canvas:
    """Draws pictures of one size, one after the other; what they are made of is kept."""

    def __init__(self, width: int, height: int, theme: Theme) -> None:
        collections = library("matplotlib.collections")
        self.width, self.height = width, height
        self._figure = new_figure(width, height, facecolor=theme.ground)
        axes = self._figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_xlim(0, width)
        axes.set_ylim(0, height)
        self._axes = axes
        self._lines = collections.LineCollection([], linewidths=0.9)
        self._shadows = collections.PolyCollection([], linewidths=0)
        self._figures = collections.PolyCollection([], linewidths=0)
        for level, collection in enumerate((self._lines, self._shadows, self._figures)):
            axes.add_collection(collection, autolim=False)
            collection.set_zorder(level)
        self._words: dict[int, Any] = {}

    def draw(self, drawing: Drawing) -> None:
        self._lines.set_segments(drawing.lines[0])
        self._lines.set_color(drawing.lines[1])
        pairs = ((self._shadows, drawing.shadows), (self._figures, drawing.figures))
        for collection, (corners, colors) in pairs:
            collection.set_verts(corners)
            collection.set_facecolor(colors)
        for number, word in enumerate(drawing.words):
            self._place(number, word)
        for number in range(len(drawing.words), len(self._words)):
            self._words[number].set_text("")

    def _place(self, number: int, word: Word) -> None:
        if number not in self._words:
            self._words[number] = self._axes.text(0, 0, "", parse_math=False, zorder=3)
        text = self._words[number]
        text.set_position((word.x, word.y))
        text.set_text(printable(word.text))
        text.set_color(word.color)
        text.set_fontsize(word.size * 0.72)  # pixels as points of 100 dots an inch
        text.set_ha(word.side)
        text.set_va("baseline")
        text.set_fontweight("bold" if word.bold else "normal")

    def pixels(self) -> Pixels:
        """The picture as red, green, blue, uint8 (height, width, 3)."""
        with quietly():
            canvas = self._figure.canvas
            canvas.draw()
            found = np.asarray(getattr(canvas, "buffer_rgba")())[:, :, :3]  # noqa: B009 - of Agg's
        return np.ascontiguousarray(found)

    def svg(self, stream: BinaryIO, title: str) -> None:
        """The picture as SVG."""
        with quietly():
            about = {"Date": None, "Title": printable(title)}
            self._figure.savefig(stream, format="svg", metadata=about)
