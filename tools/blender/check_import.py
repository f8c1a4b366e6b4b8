"""Compare Blender's bones of a GLB or BVH with their expected positions. Runs inside Blender.

    blender --background --python tools/blender/check_import.py -- CLIP.glb EXPECTED.npz

``EXPECTED.npz`` has ``names`` (n,), ``places`` (n_frames, n, 3), y up, in meters, of a BVH in its
own units, and ``rate``. The last line printed is JSON: the greatest distance in that unit, its
frame and its bone, and how many bones were compared.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import bpy
import numpy as np

if not hasattr(np, "bool"):
    np.bool = bool  # Debian's Blender 3.4 asks for it, and its NumPy has it no more


FIRST = {".glb": 0, ".bvh": 1}  # the frame at which the importer puts time 0


def import_armature(path: str, rate: float) -> Any:
    """The armature of a GLB or BVH, in a scene of its frame rate."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    render = bpy.context.scene.render
    render.fps = round(rate)
    render.fps_base = round(rate) / rate
    if path.endswith(".bvh"):
        _mend_import_of_bvh()
        bpy.ops.import_anim.bvh(filepath=path, frame_start=FIRST[".bvh"])
    else:
        bpy.ops.import_scene.gltf(filepath=path)
    (armature,) = (thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    return armature


def _mend_import_of_bvh() -> None:
    """Debian's Blender 3.4 opens a BVH with a mode that its Python has no more."""
    from io_anim_bvh import import_bvh

    import_bvh.open = lambda path, mode: open(path, mode.strip("U"))  # noqa: SIM115


def compare_heads(
    armature: Any, first: int, names: list[str], places: np.ndarray
) -> dict[str, Any]:
    """The greatest distance of a bone's head, over all frames."""
    bones = [armature.pose.bones[name] for name in names]
    worst: dict[str, Any] = {"distance": -1.0}
    for frame, wanted in enumerate(places):
        bpy.context.scene.frame_set(first + frame)
        heads = np.array([armature.matrix_world @ bone.head for bone in bones])
        found = heads[:, [0, 2, 1]] * [1, 1, -1]  # z up to y up
        distances = np.linalg.norm(found - wanted, axis=1)
        if distances.max() > worst["distance"]:
            bone = int(distances.argmax())
            worst = {"distance": float(distances[bone]), "frame": frame, "bone": names[bone]}
    return worst | {"bones": len(bones), "frames": len(places)}


def main() -> None:
    """Compare what the command line names."""
    path, expected = sys.argv[sys.argv.index("--") + 1 :]
    with np.load(expected) as arrays:
        names, places, rate = arrays["names"].tolist(), arrays["places"], float(arrays["rate"])
    armature = import_armature(path, rate)
    print(json.dumps(compare_heads(armature, FIRST[path[-4:]], names, places)))


main()
