"""The grid on the floor: squares of a round length, fading out around the figure."""

from __future__ import annotations

import math

import numpy as np

from mcz.kinematics.chain import Floats
from mcz.show.pictures.cameras import Camera
from mcz.show.pictures.themes import Theme, rgb

SQUARES = 4.0  # of the grid, on the size of the figure
MOST = 40  # squares from side to side
FADE = 0.55  # of the way to the edge, from where lines fade


def square_of(size: float, reach: float = 0.0) -> float:
    """A round length, 1, 2 or 5 times a power of ten, for a figure of that size.

    A floor that reaches far, ``reach`` from its middle, has greater squares.

    >>> square_of(170.0), square_of(1.7), square_of(36.0)
    (50.0, 0.5, 10.0)
    """
    wanted = max(size / SQUARES, 2 * reach / MOST)
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * min((1, 2, 5, 10), key=lambda k: abs(math.log(wanted / (k * power))))


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
    multiples of ``square``, wherever that is.
    """
    low = np.floor((middle - reach) / square).astype(np.int64)
    high = np.ceil((middle + reach) / square).astype(np.int64)
    across, along = (np.arange(low[k], high[k] + 1) * square for k in (0, 1))
    pieces = [_pieces(across, along, floor), _pieces(along, across, floor)[..., [1, 0, 2]]]
    lines = np.concatenate(pieces)
    away = ((lines.mean(axis=1)[:, :2] - middle) / (reach + square)) ** 2
    fade = np.clip((np.sqrt(away.sum(axis=1)) - FADE) / (1 - FADE), 0, 1)[:, None]
    pixels, _ = camera.seen(lines)
    kept = np.isfinite(pixels).all(axis=(1, 2)) & (fade[:, 0] < 1)
    colors = np.array(rgb(theme.grid)) * (1 - fade) + np.array(rgb(theme.ground)) * fade
    return pixels[kept], colors[kept]


def _pieces(fixed: Floats, steps: Floats, floor: float) -> Floats:
    """Lines at ``fixed`` of the first axis, cut where they cross those at ``steps``, (n, 2, 3)."""
    x, y = np.meshgrid(fixed, steps[:-1], indexing="ij")
    ends = [
        np.stack([x, y + k * (steps[1:] - steps[:-1]), np.full_like(x, floor)], -1) for k in (0, 1)
    ]
    return np.stack(ends, axis=2).reshape(-1, 2, 3)
