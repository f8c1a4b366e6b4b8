"""Forward and inverse kinematics: the points of a skeleton and the channels that move them.

SPEC.md, "Kinematics", has the conventions and the point sets. Distances are in the length unit of
the skeleton. Everything is vectorized over frames and works in blocks of them. ``inverse`` is
imported from its own module. ``metrics`` compares two motions, ``poses`` resamples and
differentiates, ``retargeting`` moves motions between skeletons.

Imports ``mcz.model``.
"""

from __future__ import annotations

from mcz.kinematics.points import (
    MARKER_DISTANCE_CM,
    SHELL_CM,
    Places,
    depths,
    first_points,
    origins_of,
    places_of,
    point_names,
    point_set,
    points_and_markers_of,
    points_of,
    positions,
    positions_of,
    reach,
    shell_points_of,
    virtual_markers_of,
)

__all__ = [
    "MARKER_DISTANCE_CM",
    "SHELL_CM",
    "Places",
    "depths",
    "first_points",
    "origins_of",
    "places_of",
    "point_names",
    "point_set",
    "points_and_markers_of",
    "points_of",
    "positions",
    "positions_of",
    "reach",
    "shell_points_of",
    "virtual_markers_of",
]
