"""Contact sheets: poses of a motion side by side, each seen from the same side, as large as all."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mcz.errors import OptionError
from mcz.kinematics.chain import Floats
from mcz.show.pictures.bodies import LEFT, RIGHT, Flags
from mcz.show.pictures.cameras import Viewport
from mcz.show.pictures.canvases import Drawing, Word
from mcz.show.pictures.capsules import Shapes
from mcz.show.pictures.stages import Stage, shortened

CELL = (220, 300)  # pixels of a pose
WIDE = 1.9  # of a whole sheet, how much wider than high it gets about
HEAD, FOOT, LABEL = 44, 10, 26  # pixels above all, below all, below each pose
LEAST = 60  # pixels of a cell


@dataclass(frozen=True, slots=True)
class Layout:
    """A sheet of ``columns`` x ``rows`` cells, ``cell`` (width, height) each, in pixels."""

    width: int
    height: int
    columns: int
    rows: int
    cell: tuple[int, int]


def sheet_size(count: int, size: tuple[int, int] | None) -> Layout:
    """The layout for ``count`` poses, on a sheet of that ``size`` if it is given; OptionError."""
    wide = WIDE if size is None else size[0] / size[1]
    per_cell = CELL[0] / (CELL[1] + LABEL)
    columns = min(count, max(1, round(math.sqrt(count * wide / per_cell))))
    rows = -(-count // columns)
    columns = -(-count // rows)
    if size is None:
        cell = CELL
        size = columns * CELL[0], rows * (CELL[1] + LABEL) + HEAD + FOOT
    else:
        cell = size[0] // columns, (size[1] - HEAD - FOOT) // rows - LABEL
    if min(cell) < LEAST:
        raise OptionError(f"a sheet of {size[0]} x {size[1]} pixels is too small for {count} poses")
    return Layout(*size, columns, rows, cell)


def sheet_drawing(stage: Stage, layout: Layout, title: str, when: Callable[[int], str]) -> Drawing:
    """The sheet as a drawing; ``when`` says of a frame what is written below it."""
    shadows, figures, lines, colors, words = Shapes(), Shapes(), [], [], []
    letter, theme = 12.0, stage.theme
    small = min(letter, layout.cell[0] / 12)
    for number, (frame, nodes) in enumerate(stage.track):
        row, column = divmod(number, layout.columns)
        left = column * layout.cell[0]
        bottom = layout.height - HEAD - row * (layout.cell[1] + LABEL) - layout.cell[1]
        camera = replace(stage.camera_of(number), view=Viewport(left, bottom, *layout.cell))
        pixels, shades = stage.floor(camera)
        inside = _inside(pixels, left, bottom, layout.cell)
        lines.append(pixels[inside])
        colors.append(shades[inside])
        stage.add(shadows, figures, camera, nodes)
        middle = left + layout.cell[0] / 2
        words.append(Word(middle, bottom - 0.62 * LABEL, when(frame), theme.quiet, small, "center"))
    top = layout.height - 0.64 * HEAD
    words += _heading(stage, layout, title, top, letter + 2)
    return Drawing(
        (np.concatenate(lines), np.concatenate(colors)), shadows.arrays(), figures.arrays(), words
    )


def _heading(stage: Stage, layout: Layout, title: str, top: float, letter: float) -> list[Word]:
    theme, edge = stage.theme, 14.0
    fits = max(4, int((layout.width - 260) / (0.66 * letter)))
    words = [Word(edge, top, shortened(title, fits), theme.ink, letter, bold=True)]
    x = layout.width - edge
    notes = [stage.grid_text]
    notes += [f"{stage.track.up} up assumed"] if stage.track.up_assumed else []
    for note in notes:
        words.append(Word(x, top, note, theme.quiet, letter - 2, "right"))
        x -= (len(note) + 2) * 0.62 * (letter - 2)
    sides = stage.track.body.sides[stage.track.body.shown]
    if (sides == LEFT).any() and (sides == RIGHT).any():
        for text, color in (("right", theme.right), ("left", theme.left)):
            words.append(Word(x, top, f"\u25cf {text}", color, letter - 2, "right"))
            x -= (len(text) + 3) * 0.62 * (letter - 2)
    return words


def _inside(pixels: Floats, left: float, bottom: float, cell: tuple[int, int]) -> Flags:
    low, high = np.array([left, bottom]), np.array([left + cell[0], bottom + cell[1]])
    return np.asarray(((pixels >= low) & (pixels <= high)).all(axis=(1, 2)))
