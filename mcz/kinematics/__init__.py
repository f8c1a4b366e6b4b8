"""Kinematics: where the points of a skeleton lie, what moves them, and the way back.

SPEC.md, "Kinematics", has the conventions and the point sets. Distances are in the length unit of
the skeleton. Everything is vectorized over frames and works in blocks of them.
"""

from __future__ import annotations

from mcz.kinematics.inverse import solve_ik
from mcz.kinematics.points import (
    MARKER_DISTANCE_CM,
    depths,
    point_names,
    point_set,
    points_and_markers_of,
    positions,
    positions_of,
    reach,
    virtual_markers_of,
)
from mcz.kinematics.sensitivity import sensitivities
from mcz.kinematics.single import FramePlaces
from mcz.kinematics.targets import unsolved_channels

__all__ = [
    "MARKER_DISTANCE_CM",
    "FramePlaces",
    "depths",
    "point_names",
    "point_set",
    "points_and_markers_of",
    "positions",
    "positions_of",
    "reach",
    "sensitivities",
    "solve_ik",
    "unsolved_channels",
    "virtual_markers_of",
]
