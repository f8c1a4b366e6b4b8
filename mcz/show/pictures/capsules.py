"""Cameras, and bones as tapered capsules before them: polygons in the order of their depth."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from mcz.errors import OptionError
from mcz.kinematics.chain import Floats
from mcz.model.types import Ints
from mcz.show.pictures.bodies import DOT, HEAD, Track
from mcz.show.pictures.canvases import Theme, rgb

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
        """Pixels (..., 2) of places (..., 3), and pixels a length unit; NaN behind the camera."""
        with np.errstate(all="ignore"):
            x, y, back = np.moveaxis((places - self.target) @ self.axes.T, -1, 0)
            ahead = self.distance - back
            scale = np.where(ahead > NEAREST * self.distance, self.zoom / ahead, np.nan)
            center_x = self.view.left + self.view.width / 2
            center_y = self.view.bottom + self.view.height / 2
            pixels = np.stack([center_x + x * scale, center_y + y * scale], axis=-1)
        return pixels, scale

    def at(self, target: Floats) -> Camera:
        """A copy, moved to look at ``target``."""
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


ARC = np.linspace(0.0, 1.0, 15)  # along the round end of a capsule
LIGHT = np.array([-0.42, 0.62])  # direction of the light on the picture
EDGE = 0.9  # pixels of an outline
FOG = 0.38  # share of the ground's color in the farthest parts
SUN = np.array([0.22, 0.30])  # sideways reach of shadows, per height above the floor
MOST_WIDTHS = 4.0  # picture widths off the middle: farther parts are not drawn


@dataclass(slots=True)
class Shapes:
    """Polygons (n, n_corners, 2) in pixels and their colors (n, 3), in the order of drawing."""

    corners: list[Floats] = field(default_factory=list)
    colors: list[Floats] = field(default_factory=list)

    def add(self, corners: Floats, colors: Floats) -> None:
        self.corners.append(corners)
        self.colors.append(colors)

    def arrays(self) -> tuple[Floats, Floats]:
        n_corners = 2 * len(ARC)
        return (
            np.concatenate([np.empty((0, n_corners, 2)), *self.corners]),
            np.concatenate([np.empty((0, 3)), *self.colors]),
        )


def capsules(a: Floats, b: Floats, ra: Floats, rb: Floats) -> Floats:
    """The outlines of circles at ``a`` (n, 2) and ``b`` and of all between, (n, n_corners, 2)."""
    along = b - a
    length = np.sqrt((along**2).sum(axis=1))
    turn = np.arctan2(along[:, 1], along[:, 0])
    with np.errstate(all="ignore"):
        lean = np.arccos(np.clip(np.where(length > 0, (ra - rb) / length, 1.0), -1.0, 1.0))
    round_a = turn[:, None] + lean[:, None] + ARC * (2 * np.pi - 2 * lean[:, None])
    round_b = turn[:, None] - lean[:, None] + ARC * (2 * lean[:, None])
    return np.concatenate([_round(a, ra, round_a), _round(b, rb, round_b)], axis=1)


def _round(center: Floats, radius: Floats, angles: Floats) -> Floats:
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=2)
    points: Floats = center[:, None] + radius[:, None, None] * circle
    return points


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """The parts of a figure in one frame: ends (n, 3), radii (n,) of both, colors (n, 3)."""

    starts: Floats
    ends: Floats
    start_radii: Floats
    end_radii: Floats
    colors: Floats
    has_bones: bool


def pieces_of(track: Track, nodes: Floats, colors: Floats) -> Pieces:
    """The pieces of a frame, whose nodes and their colors are (n_nodes, 3)."""
    body = track.body
    starts, ends = nodes[body.bones[:, 0]], nodes[body.bones[:, 1]]
    dots = nodes[body.lone]
    dot = np.full(len(dots), DOT * track.size)
    of_bones = colors[body.bones[:, 1]]
    low, top, bulk = _heads(track, starts, ends)
    inside = body.bones[body.heads, 1] >= track.moving.skeleton.n_joints
    ends[body.heads[inside]] = low[inside]
    return Pieces(
        np.concatenate([starts, low, dots]),
        np.concatenate([ends, top, dots]),
        np.concatenate([track.radii[:, 0], 0.86 * bulk, dot]),
        np.concatenate([track.radii[:, 1], bulk, dot]),
        np.concatenate([of_bones, of_bones[body.heads], colors[body.lone]]),
        has_bones=len(starts) > 0,
    )


def _heads(track: Track, starts: Floats, ends: Floats) -> tuple[Floats, Floats, Floats]:
    """The heads as long balls: their starts, ends and radii.

    A bone that ends in a tail is inside its head, one that ends in a joint leads to it.
    """
    heads, bulk = track.body.heads, HEAD * track.size
    along = ends[heads] - starts[heads]
    with np.errstate(all="ignore"):
        length = np.sqrt((along**2).sum(axis=1, keepdims=True))
        unit = np.where(length > 0, along / length, 0.0)
    inside = track.body.bones[heads, 1:] >= track.moving.skeleton.n_joints
    top = starts[heads] + unit * np.where(inside, np.maximum(length, 1.6 * bulk), length + 2 * bulk)
    low = top - unit * np.where(inside, np.minimum(1.3 * bulk, length), 1.3 * bulk)
    return low, top - 0.35 * bulk * unit, np.full(len(heads), bulk)


def add_figure(shapes: Shapes, camera: Camera, pieces: Pieces, theme: Theme, size: float) -> None:
    """Add the figure, farthest pieces first; each as its outline, itself and a light on it."""
    a, scale_a = camera.project(pieces.starts)
    b, scale_b = camera.project(pieces.ends)
    ra, rb = pieces.start_radii * scale_a, pieces.end_radii * scale_b
    near = _drawable(camera, a, b)
    with np.errstate(invalid="ignore"):
        depth = np.minimum(scale_a, scale_b)[near]
        order = np.argsort(0.5 * (scale_a + scale_b)[near])
    near = near[order]
    if not len(near):
        return
    a, b, ra, rb = a[near], b[near], np.maximum(ra[near], 0.8), np.maximum(rb[near], 0.8)
    span = size * camera.zoom / camera.distance**2  # how much scales differ across a figure
    haze = np.clip((depth.max() - depth[order]) / max(span, 1e-12), 0, 1)[:, None] * FOG
    ground = np.array(rgb(theme.ground))
    body = pieces.colors[near] * (1 - haze) + ground * haze
    dark, light = body * 0.62, body + (1 - body) * 0.38
    shift = LIGHT * 0.42
    layers = (
        capsules(a, b, ra + EDGE, rb + EDGE),
        capsules(a, b, ra, rb),
        capsules(a + shift * ra[:, None], b + shift * rb[:, None], 0.42 * ra, 0.42 * rb),
    )
    mixed = np.stack(layers, axis=1).reshape(-1, layers[0].shape[1], 2)
    shapes.add(mixed, np.clip(np.stack([dark, body, light], axis=1).reshape(-1, 3), 0, 1))


def add_shadow(shapes: Shapes, camera: Camera, pieces: Pieces, floor: float, theme: Theme) -> None:
    """The shadow on the floor, in one color."""
    flat = []
    sun = SUN if pieces.has_bones else np.zeros(2)  # shadows of markers are below them
    for places in (pieces.starts, pieces.ends):
        rise = np.maximum(places[:, 2:] - floor, 0.0)
        flat.append(np.concatenate([places[:, :2] + rise * sun, np.full_like(rise, floor)], axis=1))
    a, scale_a = camera.project(flat[0])
    b, scale_b = camera.project(flat[1])
    near = _drawable(camera, a, b)
    tilt = max(0.1, float(camera.axes[2, 2]))  # a circle on the floor is flat
    radii = (pieces.start_radii * scale_a, pieces.end_radii * scale_b)
    ra, rb = (np.maximum(radius[near], 0.5) for radius in radii)
    squeeze = np.array([1.0, 1 / tilt])
    corners = capsules(a[near] * squeeze, b[near] * squeeze, ra, rb) / squeeze
    shapes.add(corners, np.tile(rgb(theme.shadow), (len(corners), 1)))


def _drawable(camera: Camera, a: Floats, b: Floats) -> Ints:
    """Indices of pieces in front of the camera and not far outside of the picture."""
    view = camera.view
    middle = (view.left + view.width / 2, view.bottom + view.height / 2)
    most = MOST_WIDTHS * max(view.width, view.height)
    with np.errstate(invalid="ignore"):
        inside = (np.abs(np.stack([a, b]) - middle) < most).all(axis=(0, 2))
    return np.flatnonzero(inside)
