"""Markers as empties below one empty; a marker that is missing is hidden."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from .actions import Curves
from .spaces import blender_names, holdable

SIZE = 0.008  # of the box around the markers, the radius of one
HIDDEN = ("hide_viewport", "hide_render")
MARKER, ORDER = "mcz_marker", "mcz_order"  # properties of an empty: its own name, its number


def empties_of(
    name: str,
    names: list[str],
    places: np.ndarray,
    frames: np.ndarray,
    collection: Any,
    step: Callable[[float], None],
) -> Any:
    """A new empty, and below it one a marker, keyed at ``frames``.

    ``places`` (n_frames, n_markers, 3), NaN where a marker is missing: it has no keys there and is
    hidden; one that is never seen is hidden throughout.
    """
    top = _empty(name, None, "PLAIN_AXES", collection)
    size = SIZE * box_of(places)
    curves = Curves(name)
    for number, called in enumerate(blender_names(names, "marker")):
        made = _empty(called, top, "SPHERE", collection)
        made.empty_display_size = size
        made[MARKER], made[ORDER] = holdable(names[number]), number
        way = places[:, number]
        seen = np.isfinite(way).all(axis=1)
        if len(way):
            curves.of(made)
            for index in range(3):
                curves.add("location", index, frames, np.where(seen, way[:, index], np.nan))
            if not seen.all():
                for property_ in HIDDEN:
                    curves.steps(property_, frames, np.where(seen, 0.0, 1.0))
        step((number + 1) / len(names))
    return top


def _empty(name: str, parent: Any, kind: str, collection: Any) -> Any:
    made = bpy.data.objects.new(name, None)
    made.empty_display_type = kind
    made.parent = parent
    collection.objects.link(made)
    return made


def box_of(places: np.ndarray) -> float:
    """The diagonal of the box around the markers, the median over frames; 1 where there is none."""
    rows = places[:: max(1, len(places) // 500)]
    rows = rows[np.isfinite(rows).all(axis=2).any(axis=1)]
    if not len(rows):
        return 1.0
    box = np.nanmax(rows, axis=1) - np.nanmin(rows, axis=1)
    return float(np.median(np.sqrt((box**2).sum(axis=1)))) or 1.0
