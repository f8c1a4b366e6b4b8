"""Actions: curves of keys, written whole. Blender 4.4 gave actions slots, 5.0 took the old way."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

CONSTANT, LINEAR = 0, 1  # interpolations, as numbers of Blender's enumeration


class Curves:
    """F-curves of objects: an action each, or a slot each of one action."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.strip: Any = None
        self.bag: Any = None
        self.action: Any = None

    def of(self, thing: Any) -> None:
        """Direct the curves added from now on to the object ``thing``."""
        data = thing.animation_data_create()
        if bpy.app.version < (4, 4, 0):
            self.action = self.bag = bpy.data.actions.new(self.name)
            data.action = self.action
            return
        if self.strip is None:
            self.action = bpy.data.actions.new(self.name)
            self.strip = self.action.layers.new("Layer").strips.new(type="KEYFRAME")
        data.action = self.action  # before its slot is there: Blender may choose one by name
        slot = self.action.slots.new("OBJECT", thing.name)
        if data.action_slot != slot:
            data.action_slot = slot
        self.bag = self.strip.channelbag(slot, ensure=True)

    def group(self, name: str) -> Any:
        """A group of curves, which the dope sheet shows under that name."""
        return self.bag.groups.new(name)

    def add(
        self, path: str, index: int, frames: np.ndarray, values: np.ndarray, group: Any = None
    ) -> None:
        """A curve with these keys, straight between them; of a constant one, a single key.

        Values that are not finite have no key.
        """
        known = np.isfinite(values)
        if not known.all():
            frames, values = frames[known], values[known]
        if not len(values):
            return
        if (values == values[0]).all():
            frames, values = frames[:1], values[:1]
        self._keys(path, index, frames, values, LINEAR, group)

    def steps(self, path: str, frames: np.ndarray, values: np.ndarray) -> None:
        """A curve that changes at once, with a key at the first frame and at each change."""
        changes = np.flatnonzero(np.diff(values, prepend=1 - values[:1]))
        self._keys(path, 0, frames[changes], values[changes], CONSTANT, None)

    def _keys(
        self, path: str, index: int, frames: Any, values: Any, interpolation: int, group: Any
    ) -> None:
        curve = self.bag.fcurves.new(path, index=index)
        if group is not None:
            curve.group = group
        points = curve.keyframe_points
        points.add(len(values))
        pairs = np.empty((len(values), 2), np.float32)
        pairs[:, 0], pairs[:, 1] = frames, values
        points.foreach_set("co", pairs.ravel())
        points.foreach_set("interpolation", np.full(len(values), interpolation, np.int32))
        curve.update()


def curves_of(thing: Any) -> Iterator[Any]:
    """The curves that move an object."""
    data = thing.animation_data
    if data is None or data.action is None:
        return
    if bpy.app.version < (4, 4, 0):
        yield from data.action.fcurves
        return
    for layer in data.action.layers:
        for strip in layer.strips:
            bag = strip.channelbag(data.action_slot) if data.action_slot else None
            yield from bag.fcurves if bag else ()
