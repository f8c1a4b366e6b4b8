"""Colors of pictures: Okabe and Ito's blue and orange for left and right, on light or dark."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError

Color = tuple[float, float, float]  # red, green, blue, each 0 to 1


def rgb(text: str) -> Color:
    """
    >>> rgb("#ff0000")
    (1.0, 0.0, 0.0)
    """
    red, green, blue = (int(text[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


@dataclass(frozen=True, slots=True)
class Theme:
    """The colors of a picture; ``series`` are those of lines in plots."""

    ground: str
    ink: str
    quiet: str
    grid: str
    shadow: str
    left: str
    right: str
    middle: str
    series: tuple[str, ...]

    def sides(self) -> NDArray[np.float64]:
        """The colors of the middle, the left and the right, float64 (3, 3)."""
        return np.array([rgb(self.middle), rgb(self.left), rgb(self.right)])


THEMES = {
    "light": Theme(
        ground="#fbfbf9",
        ink="#1f2328",
        quiet="#6a7178",
        grid="#d9dcdf",
        shadow="#e4e5e4",
        left="#0072b2",
        right="#e08214",
        middle="#8d959e",
        series=("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#a07800", "#3aa0d8"),
    ),
    "dark": Theme(
        ground="#16191d",
        ink="#eceff1",
        quiet="#98a1a9",
        grid="#353b42",
        shadow="#0c0e10",
        left="#4ba9e4",
        right="#f0a13a",
        middle="#a7afb8",
        series=("#56b4e9", "#f0862f", "#1fc296", "#e394c0", "#e6c14a", "#9fd4f5"),
    ),
}


def theme_of(name: str) -> Theme:
    """The theme of that name; OptionError for another."""
    if name not in THEMES:
        raise OptionError(f"theme {name!r} is not one of {', '.join(THEMES)}")
    return THEMES[name]
