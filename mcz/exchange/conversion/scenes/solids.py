"""Meshes of a scene: an octahedron a bone, a small one for a node without.

Each corner follows one node alone: the far end of a bone the node there where that one moves by
itself, all others the node that the bone begins at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcz.exchange.conversion.scenes.nodes import Scene
from mcz.kinematics.chain import Floats

Ints = NDArray[np.int64]

SIDES = ("", "left", "right")
COLORS = {"": (0.6, 0.6, 0.62), "left": (0.05, 0.25, 0.7), "right": (0.75, 0.2, 0.05)}  # linear
WIDEST_AT, WIDTH = 0.15, 0.12  # of the bone, from where it begins, and from its middle
LEAST_WIDTH, GREATEST_WIDTH = 0.007, 0.03  # of the figure
KNOB, MARKER = 0.012, 0.008  # radius, of the figure, of the markers' box
LEAST_BONE = 1e-4  # of the figure; what is shorter is not seen

# Corners: one end, four around, the other end; triangles counterclockwise from outside.
OCTAHEDRON = np.array(
    [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 1, 4), (5, 1, 2), (5, 2, 3), (5, 3, 4), (5, 4, 1)]
)


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """All bones at rest.

    ``corners`` (n, 3) in the world, in meters; ``nodes`` (n,) is what each follows; ``triangles``
    (m, 3) those of each side that has any.
    """

    corners: Floats
    nodes: Ints
    triangles: dict[str, Ints]


def solid_of(scene: Scene) -> Solid:
    """The bones of ``scene``."""
    corners: list[Floats] = []
    nodes: list[int] = []
    triangles: dict[str, list[Ints]] = {side: [] for side in SIDES}
    for shape, start, end in _bones(scene):
        triangles[scene.nodes[start].side].append(OCTAHEDRON + 6 * len(corners))
        corners.append(shape)
        nodes += [start] * 5 + [end]
    made = {side: np.concatenate(found) for side, found in triangles.items() if found}
    return Solid(np.concatenate(corners), np.array(nodes, np.int64), made)


def _bones(scene: Scene) -> Iterator[tuple[Floats, int, int]]:
    """The corners of each bone, (6, 3), and the nodes that it and its far end follow."""
    places = scene.rest_places
    for number, below in enumerate(scene.children):
        drawn = False
        for child in below:
            bone = places[child] - places[number]
            if float(bone @ bone) > (LEAST_BONE * scene.size) ** 2:
                drawn = True
                end = number if scene.nodes[child].shifts is None else child
                yield _bone(places[number], bone, scene.size), number, end
        if not drawn and not (_is_reached(scene, number) and not below):
            yield places[number] + knob(KNOB * scene.size), number, number


def _is_reached(scene: Scene, number: int) -> bool:
    """Return True if a bone ends at the node."""
    rest = scene.nodes[number].rest
    return scene.nodes[number].parent >= 0 and float(rest @ rest) > (LEAST_BONE * scene.size) ** 2


def _bone(start: Floats, bone: Floats, size: float) -> Floats:
    length = float(np.sqrt(bone @ bone))
    along = bone / length
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.sqrt(aside @ aside)
    wide = min(max(WIDTH * length, LEAST_WIDTH * size), GREATEST_WIDTH * size)
    ring = [aside, np.cross(along, aside), -aside, -np.cross(along, aside)]
    middle = start + WIDEST_AT * bone
    return np.stack([start, *(middle + wide * arm for arm in ring), start + bone])


def knob(radius: float) -> Floats:
    """The corners of an octahedron around the origin, (6, 3)."""
    x, y, z = np.eye(3) * radius
    return np.stack([-z, x, y, -x, -y, z])
