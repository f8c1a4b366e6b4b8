"""A skeleton as an armature, and its motion as an action."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from .actions import Curves
from .placing import Bone, keys_of_bone
from .spaces import holdable

JOINT, END = "mcz_joint", "mcz_end"  # properties of bones: the joint's own name; of which tail


def armature_of(name: str, bones: list[Bone], joint_names: list[str], collection: Any) -> Any:
    """A new object with these bones, at rest."""
    data = bpy.data.armatures.new(name)
    made = bpy.data.objects.new(name, data)
    collection.objects.link(made)
    active = bpy.context.view_layer.objects
    if active.active is not None and active.active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    active.active = made
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        _edit(data, bones)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    for bone in bones:
        kept = data.bones[bone.name]
        if bone.end < 0:
            kept[JOINT] = holdable(joint_names[bone.joint])
            kept[END] = bone.ends_at >= 0
        else:
            kept[END] = True
    return made


def _edit(data: Any, bones: list[Bone]) -> None:
    made = []
    for bone in bones:
        edited = data.edit_bones.new(bone.name)
        edited.head, edited.tail = bone.head, bone.tail
        if bone.parent >= 0:
            edited.parent = made[bone.parent]
            if bones[bone.parent].scales is not None:
                edited.inherit_scale = "NONE"
        made.append(edited)


def animate(
    made: Any, bones: list[Bone], frames: np.ndarray, name: str, step: Callable[[float], None]
) -> None:
    """Key the bones at ``frames``; ``step`` is told the share that is done."""
    curves = Curves(name)
    curves.of(made)
    axes: list[np.ndarray] = []
    for number, bone in enumerate(bones):
        posed = made.pose.bones[bone.name]
        posed.rotation_mode = "QUATERNION"
        axes.append(np.array(posed.bone.matrix_local.to_3x3(), np.float64))
        parent = bones[bone.parent] if bone.parent >= 0 else None
        scaled = parent is not None and parent.scales is not None
        above = (axes[bone.parent], parent.scales) if scaled else None
        turns, shifts = keys_of_bone(bone, axes[-1], above)
        keys = {"location": shifts, "rotation_quaternion": turns}
        if bone.scales is not None:
            keys["scale"] = np.stack([np.ones(len(frames)), bone.scales, np.ones(len(frames))], 1)
        _key(curves, bone.name, frames, keys)
        step((number + 1) / len(bones))


def _key(curves: Curves, name: str, frames: np.ndarray, keys: dict[str, np.ndarray | None]) -> None:
    """Curves of a bone's properties, in a group of its name."""
    group = curves.group(name) if any(v is not None for v in keys.values()) else None
    path = f'pose.bones["{bpy.utils.escape_identifier(name)}"]'
    for property_, values in keys.items():
        for index in range(0 if values is None else values.shape[1]):
            curves.add(f"{path}.{property_}", index, frames, values[:, index], group)
