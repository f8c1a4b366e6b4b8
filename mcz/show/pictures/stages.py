"""A frame of a track as a drawing: camera, floor, shadow, figure, and texts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mcz.kinematics.chain import Floats
from mcz.show.pictures.bodies import LEFT, RIGHT, Track, are_known
from mcz.show.pictures.canvases import Drawing, Theme, Word, rgb
from mcz.show.pictures.capsules import (
    Camera,
    Shapes,
    Viewport,
    add_figure,
    add_shadow,
    axes_of,
    fit_camera,
    pieces_of,
)

ROAM = 1.1  # sizes of the figure that it may move about before the camera follows
STILL = 0.35  # seconds over which a camera that follows is steadied
MARGIN = 1.25  # of the figure's size, from the figure to the edge of the floor
ROOM = 0.10  # of its size, free space around the figure


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """View of a track's frames; ``targets`` (n_frames, 3), points looked at, or None: one."""

    track: Track
    theme: Theme
    camera: Camera
    targets: Floats | None
    reach: Floats
    square: float

    def camera_of(self, number: int) -> Camera:
        """The camera of the frame of that number in the track."""
        return self.camera if self.targets is None else self.camera.at(self.targets[number])

    def add(self, shadows: Shapes, figures: Shapes, camera: Camera, nodes: Floats) -> None:
        """Draw a frame, whose nodes are (n_nodes, 3), from ``camera``."""
        body, size = self.track.body, self.track.size
        pieces = pieces_of(self.track, nodes, self.theme.sides()[body.sides])
        add_shadow(shadows, camera, pieces, self.track.floor, self.theme)
        add_figure(figures, camera, pieces, self.theme, size)

    def floor(self, camera: Camera) -> tuple[Floats, Floats]:
        middle = camera.target[:2]
        return floor_lines(camera, middle, self.reach, self.track.floor, self.square, self.theme)

    @property
    def grid_text(self) -> str:
        return f"grid {length_text(self.square, self.track.unit)}"


def stage_of(
    track: Track,
    theme: Theme,
    view: str,
    port: Viewport,
    follow: bool | None,
    rate: float,
    around: float = MARGIN,
) -> Stage:
    """Choose a view that shows all of a track; ``rate`` its frames a second.

    ``around`` is the margin of the floor, of the figure's size. With ``follow`` the camera follows,
    with None only if the figure would be small otherwise.
    """
    axes = axes_of(view, track.forward)
    known = are_known(track.centers)
    centers = track.centers[known]
    travel = (centers.max(axis=0) - centers.min(axis=0))[:2]
    if follow is None:
        follow = bool(travel.max() > ROAM * track.size)
    targets = smooth_targets(track.centers, rate) if follow else None
    low, high = _box(track, axes, targets)
    margin = ROOM * track.size
    camera = fit_camera(axes, low - margin, high + margin, port)
    if targets is not None:
        camera_targets = targets + camera.target
        reach = np.full(2, around * track.size)
    else:
        camera_targets, reach = None, travel / 2 + around * track.size
    square = grid_spacing(track.size, float(reach.max()))
    return Stage(track, theme, camera, camera_targets, reach, square)


def smooth_targets(centers: Floats, rate: float) -> Floats:
    """Targets of a following camera: ``centers`` (n, 3), gaps bridged and smoothed."""
    targets = centers.copy()
    frames = np.arange(len(targets))
    known = are_known(targets)
    for axis in range(3):
        targets[:, axis] = np.interp(frames, frames[known], targets[known, axis])
    half = min(int(STILL * rate), len(targets) - 1)
    if half > 0:
        window = np.hanning(2 * half + 3)[1:-1]
        padded = np.pad(targets, ((half, half), (0, 0)), mode="edge")
        for axis in range(3):
            targets[:, axis] = np.convolve(padded[:, axis], window / window.sum(), mode="valid")
    return targets


def _box(track: Track, axes: Floats, targets: Floats | None) -> tuple[Floats, Floats]:
    """Extent that the camera must see, along its axes: about ``targets``, or about the origin."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    shown, done = track.body.drawn_nodes, 0
    for frames, places in track.blocks():
        about = 0.0 if targets is None else targets[done : done + len(frames)][:, None]
        seen = (places[:, shown] - about) @ axes.T
        centers = (track.centers[done : done + len(frames)][:, None] - about) @ axes.T
        with np.errstate(invalid="ignore"):
            near = np.abs(seen - centers).max(axis=2) <= 3 * track.size
        known = seen[are_known(seen) & near]
        done += len(frames)
        if len(known):
            low, high = np.minimum(low, known.min(axis=0)), np.maximum(high, known.max(axis=0))
    if not np.isfinite(low).all():
        middle = np.nan_to_num(track.centers[0] @ axes.T)
        low, high = middle - track.size / 2, middle + track.size / 2
    return low, high


def label_texts(stage: Stage, width: int, height: int, title: str, when: str) -> list[Word]:
    """Words around a picture."""
    theme, letter = stage.theme, max(9.0, min(15.0, height / 42))
    edge = 0.9 * letter
    top, bottom = height - edge - letter, edge
    fits = max(4, int((width - 2 * edge) / (0.66 * letter)) - len(when) - 2)
    words = [
        Word(edge, top, shorten(title, fits), theme.ink, letter, bold=True),
        Word(width - edge, top, when, theme.quiet, letter, "right"),
        Word(width - edge, bottom, stage.grid_text, theme.quiet, letter, "right"),
    ]
    x = edge
    sides = stage.track.body.sides[stage.track.body.drawn_nodes]
    if (sides == LEFT).any() and (sides == RIGHT).any():
        for text, color in (("left", theme.left), ("right", theme.right)):
            words.append(Word(x, bottom, f"\u25cf {text}", color, letter))
            x += (len(text) + 2.4) * 0.66 * letter
    if stage.track.up_assumed:
        words.append(Word(x, bottom, f"{stage.track.up} up assumed", theme.quiet, letter))
    return words


def shorten(text: str, most: int) -> str:
    """
    >>> shorten("walk", 8), shorten("a very long name", 8)
    ('walk', 'a very …')
    """
    return text if len(text) <= most else f"{text[: most - 1]}…"


def drawing_of(stage: Stage, number: int, nodes: Floats, words: list[Word]) -> Drawing:
    """The picture of one frame."""
    camera = stage.camera_of(number)
    shadows, figures = Shapes(), Shapes()
    stage.add(shadows, figures, camera, nodes)
    return Drawing(stage.floor(camera), shadows.arrays(), figures.arrays(), words)


SQUARES = 4.0  # of the grid, on the size of the figure
MOST_SQUARES = 40  # from side to side
FADE = 0.55  # of the way to the edge, where lines begin to fade


def grid_spacing(size: float, reach: float = 0.0) -> float:
    """A round length, 1, 2 or 5 times a power of ten, for a figure of that size.

    A large floor, with ``reach`` from its middle, has greater squares.

    >>> grid_spacing(170.0), grid_spacing(1.7), grid_spacing(36.0)
    (50.0, 0.5, 10.0)
    """
    length = max(size / SQUARES, 2 * reach / MOST_SQUARES)
    power = 10.0 ** math.floor(math.log10(length))
    return power * min((1, 2, 5, 10), key=lambda k: abs(math.log(length / (k * power))))


def length_text(length: float, unit: str) -> str:
    """
    >>> length_text(50.0, "cm"), length_text(200.0, "cm"), length_text(0.5, "units")
    ('50 cm', '2 m', '0.5 units')
    """
    if unit == "cm":
        return f"{length / 100:g} m" if length >= 100 else f"{length:g} cm"
    return f"{length:g} {unit}"


def floor_lines(
    camera: Camera, middle: Floats, reach: Floats, floor: float, square: float, theme: Theme
) -> tuple[Floats, Floats]:
    """Pieces of lines (n, 2, 2) in pixels and their colors (n, 3).

    The grid reaches ``reach`` (2,) from ``middle`` (2,) at the height ``floor``; its lines lie at
    multiples of ``square``.
    """
    low = np.floor((middle - reach) / square).astype(np.int64)
    high = np.ceil((middle + reach) / square).astype(np.int64)
    across, along = (np.arange(low[k], high[k] + 1) * square for k in (0, 1))
    pieces = [_pieces(across, along, floor), _pieces(along, across, floor)[..., [1, 0, 2]]]
    lines = np.concatenate(pieces)
    away = ((lines.mean(axis=1)[:, :2] - middle) / (reach + square)) ** 2
    fade = np.clip((np.sqrt(away.sum(axis=1)) - FADE) / (1 - FADE), 0, 1)[:, None]
    pixels, _ = camera.project(lines)
    kept = np.isfinite(pixels).all(axis=(1, 2)) & (fade[:, 0] < 1)
    colors = np.array(rgb(theme.grid)) * (1 - fade) + np.array(rgb(theme.ground)) * fade
    return pixels[kept], colors[kept]


def _pieces(fixed: Floats, steps: Floats, floor: float) -> Floats:
    """Lines at ``fixed`` of the first axis, cut at their crossings with ``steps``, (n, 2, 3)."""
    x, y = np.meshgrid(fixed, steps[:-1], indexing="ij")
    ends = [
        np.stack([x, y + k * (steps[1:] - steps[:-1]), np.full_like(x, floor)], -1) for k in (0, 1)
    ]
    return np.stack(ends, axis=2).reshape(-1, 2, 3)
