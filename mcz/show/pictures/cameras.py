"""Cameras: their place, and projection to the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mcz.errors import OptionError
from mcz.kinematics.chain import Floats

# Degrees: around from the front towards its right side, and up.
VIEWS = {
    "front": (0.0, 6.0),
    "side": (90.0, 6.0),
    "top": (180.0, 90.0),
    "three-quarter": (40.0, 16.0),
}
FIELD = math.radians(24.0)  # of view, from bottom to top
NEAREST = 0.05  # of its distance: nearer parts are not drawn


@dataclass(frozen=True, slots=True)
class Viewport:
    """A rectangle of a picture in pixels, from its lower left corner up."""

    left: float
    bottom: float
    width: float
    height: float


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera that looks at ``target`` from ``distance``; ``axes`` (3, 3) are right, up, back."""

    axes: Floats
    target: Floats
    distance: float
    view: Viewport

    @property
    def zoom(self) -> float:
        """Pixels of a length at a distance of the same length."""
        return self.view.height / (2 * math.tan(FIELD / 2))

    def project(self, places: Floats) -> tuple[Floats, Floats]:
        """Pixels (..., 2) of places (..., 3), and pixels a unit of length there, NaN behind."""
        with np.errstate(all="ignore"):
            x, y, back = np.moveaxis((places - self.target) @ self.axes.T, -1, 0)
            ahead = self.distance - back
            scale = np.where(ahead > NEAREST * self.distance, self.zoom / ahead, np.nan)
            center_x = self.view.left + self.view.width / 2
            center_y = self.view.bottom + self.view.height / 2
            pixels = np.stack([center_x + x * scale, center_y + y * scale], axis=-1)
        return pixels, scale

    def at(self, target: Floats) -> Camera:
        """The same camera, moved to look at ``target``."""
        return Camera(self.axes, target, self.distance, self.view)


def axes_of(view: str, forward: Floats) -> Floats:
    """Right, up and back of the camera of that name, (3, 3), for a figure that faces ``forward``.

    Raises OptionError for another name.
    """
    if view not in VIEWS:
        raise OptionError(f"view is {view!r}; it must be one of {', '.join(VIEWS)}")
    round_, rise = map(math.radians, VIEWS[view])
    left = np.array([-forward[1], forward[0], 0.0])
    level = math.cos(round_) * forward - math.sin(round_) * left
    up = np.array([0.0, 0.0, 1.0])
    back = math.cos(rise) * level + math.sin(rise) * up
    above = math.cos(rise) * up - math.sin(rise) * level
    return np.stack([np.cross(above, back), above, back])


def fit_camera(axes: Floats, low: Floats, high: Floats, view: Viewport) -> Camera:
    """The camera that exactly frames a box, whose corners are along its own axes, (3,) each."""
    middle = (low + high) / 2
    half = np.maximum((high - low) / 2, 1e-9)
    zoom = view.height / (2 * math.tan(FIELD / 2))
    needed = (zoom * half[0] / (view.width / 2), zoom * half[1] / (view.height / 2))
    return Camera(axes, middle @ axes, float(half[2] + max(needed)), view)
