"""Compare the add-on's bones and markers with their expected positions. Needs ``bpy``.

    python tools/blender/check_addon.py import CLIP.bvh [--clip NAME] [--option rate=30 ...]
    python tools/blender/check_addon.py export CLIP.bvh OUT.mcz [--option codec=best ...]

``import`` compares with ``mcz.positions`` every bone's head, and its tail where a joint's bone ends
there, on sampled frames, evaluated by the dependency graph. ``export`` imports, exports, imports
that and compares. The last line printed is JSON: ``distance``, the greatest in units of the
skeleton's size, where it is, what was compared, seconds, and which other packages were loaded.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

import mcz
from mcz.kinematics.points import listed_points, point_set

SAMPLED = 60  # frames at most
OTHERS = {"click", "fsspec", "pywt"}  # not all Blenders have them


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("job", choices=("import", "export"))
    parser.add_argument("path")
    parser.add_argument("target", nargs="?")
    parser.add_argument("--option", action="append", default=[])
    parser.add_argument("--out", action="append", default=[], help="an option of the export")
    parser.add_argument("--addon", help="the folder that has mcz_blender, in place of this one")
    asked = parser.parse_args()
    register(asked.addon or str(Path(__file__).parent))
    options = dict(map(option, asked.option))
    start = time.perf_counter()
    (made,) = import_file(asked.path, **options)
    report: dict[str, Any] = {"seconds": time.perf_counter() - start}
    motion, numbers = read_expected(asked.path, options)
    report |= compare_positions(made, motion, numbers, options)
    if asked.job == "export":
        report["export"] = export_and_compare(
            made, asked.target, dict(map(option, asked.out)), motion
        )
    unregister()
    report["loaded"] = sorted(OTHERS & {name.partition(".")[0] for name in sys.modules})
    print(json.dumps(report))


def option(text: str) -> tuple[str, Any]:
    name, _, value = text.partition("=")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


def register(folder: str) -> None:
    """The add-on in an empty scene, as Blender enables it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sys.path.insert(0, folder)
    import mcz_blender

    mcz_blender.register()


def unregister() -> None:
    """Disable the add-on as Blender does; bpy 4.2 crashes at exit with a registered operator."""
    import mcz_blender

    mcz_blender.unregister()


def import_file(path: str, **options: Any) -> list[Any]:
    """The armatures, and the empties above markers, that come of a file."""
    before = set(bpy.data.objects)
    bpy.ops.import_anim.mcz(filepath=path, **options)
    return [thing for thing in bpy.data.objects if thing not in before and thing.parent is None]


def read_expected(path: str, options: dict[str, Any]) -> tuple[mcz.Motion, np.ndarray]:
    """The motion, and the numbers of the frames that are wanted of it."""
    motion = mcz.read(path, clip=options.get("clip")) if path.endswith(".mcz") else mcz.read(path)
    stop = options.get("stop") or motion.n_frames
    return motion, np.arange(options.get("first", 0), stop, options.get("step", 1))


def compare_positions(
    made: Any, motion: mcz.Motion, numbers: np.ndarray, options: dict[str, Any]
) -> dict[str, Any]:
    """The greatest distance on sampled frames."""
    skeleton, scene = motion.skeleton, bpy.context.scene
    unit_cm = skeleton.unit_cm or {"cm": 1.0, "m": 100.0, "in": 2.54}[options.get("unit", "cm")]
    scale = unit_cm / 100 / scene.unit_settings.scale_length
    up = skeleton.up_axis or options.get("up", "y")
    wanted = turn_up(mcz.positions(motion), up) * scale
    rate = float(motion.frame_rate or options.get("rate", 120))
    apart = scene.render.fps / scene.render.fps_base / rate
    rows = numbers[:: max(1, len(numbers) // SAMPLED)]
    find = markers if point_set(skeleton) == "markers" else points
    worst: dict[str, Any] = {"distance": 0.0}
    count = 0
    for row in rows:
        frame = options.get("start", 1) + (row - numbers[0]) * apart
        scene.frame_set(int(np.floor(frame)), subframe=frame % 1)
        places = find(made, skeleton)
        gone = np.isnan(wanted[row]).any(axis=1)
        assert (np.isnan(places).any(axis=1) == gone).all(), f"frame {row}: not the same are seen"
        distances = np.where(gone, 0.0, np.linalg.norm(places - wanted[row], axis=1))
        count += int((~gone).sum())
        if distances.max() >= worst["distance"]:
            point = int(distances.argmax())
            worst = {"distance": float(distances[point]), "frame": int(row)}
            worst["point"] = mcz.point_names(skeleton)[point]
    size = figure(wanted, skeleton, scale)
    return worst | {"distance": worst["distance"] / size, "size": size, "compared": count}


def figure(wanted: np.ndarray, skeleton: mcz.Skeleton, scale: float) -> float:
    """The size of a skeleton, or of the box around markers."""
    from mcz.kinematics.points import reach

    if point_set(skeleton) == "markers":
        return float(np.nanmax(np.nanmax(wanted, axis=1) - np.nanmin(wanted, axis=1)))
    return reach(skeleton) * scale


def turn_up(places: np.ndarray, up: str) -> np.ndarray:
    """With z up; written out here, so that the add-on's own matrices are not trusted."""
    x, y, z = np.moveaxis(places, 2, 0)
    return np.stack({"x": (-y, -z, x), "y": (x, -z, y), "z": (x, y, z)}[up], axis=2)


def points(made: Any, skeleton: mcz.Skeleton) -> np.ndarray:
    """Positions of the skeleton's points, by heads and tails of the evaluated bones."""
    evaluated = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix, bones = evaluated.matrix_world, evaluated.pose.bones
    by_joint = [bone for bone in bones if "mcz_joint" in bone.bone]
    found = []
    for joint, tail in listed_points(skeleton):
        bone = by_joint[joint]
        if tail < 0:
            place = bone.head
        elif tail == 0 and bone.bone["mcz_end"]:
            place = bone.tail
        else:
            place = end_of(bone, tail).head
        found.append(matrix @ place)
    return np.array(found)


def end_of(bone: Any, tail: int) -> Any:
    """The bone that begins at a tail of a joint: an end of its own, or that of a child."""
    name = f"{bone.name} end" + (f" {tail + 1}" if tail else "")
    ends = [child for child in bone.children if child.name == name]
    return ends[0] if ends else next(child for child in bone.children if "mcz_joint" in child.bone)


def markers(made: Any, skeleton: mcz.Skeleton) -> np.ndarray:
    """Positions of the markers, NaN for hidden ones."""
    graph = bpy.context.evaluated_depsgraph_get()
    by_name = {child["mcz_marker"]: child for child in made.children}
    found = np.full((skeleton.n_joints, 3), np.nan)
    for number, name in enumerate(skeleton.addresses()):
        if not by_name[name].hide_viewport:
            found[number] = by_name[name].evaluated_get(graph).matrix_world.translation
    return found


def export_and_compare(
    made: Any, target: str, options: dict[str, Any], motion: mcz.Motion
) -> dict[str, Any]:
    """Export, read that again: how far its positions are from those of ``motion``."""
    start = time.perf_counter()
    bpy.ops.object.select_all(action="DESELECT")
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    bpy.ops.export_anim.mcz(filepath=target, **options)
    seconds = time.perf_counter() - start
    (again,) = import_file(target)
    second = mcz.read(target)
    numbers = np.arange(second.n_frames)
    return {
        "seconds": seconds,
        "bytes": Path(target).stat().st_size,
        "names": list(second.skeleton.joint_names) == list(motion.skeleton.joint_names),
        "rate": str(second.frame_rate),
        "unit_cm": second.skeleton.unit_cm,
        "up": second.skeleton.up_axis,
        "frames": second.n_frames,
        "again": compare_positions(again, second, numbers, {}),
        "same": apart(motion, second, options),
    }


def apart(first: mcz.Motion, second: mcz.Motion, options: dict[str, Any]) -> float:
    """The greatest distance between joints (or markers) of both, in sizes of the skeleton."""
    from mcz.kinematics.points import origins_of

    if point_set(first.skeleton) == "markers":
        one, other = mcz.positions(first), mcz.positions(second)
        assert (np.isnan(one) == np.isnan(other)).all(), "not the same markers are seen"
        size = figure(one, first.skeleton, 1.0)
    else:
        one, other = (origins_of(m.skeleton, m.values) for m in (first, second))
        size = figure(one, first.skeleton, 1.0)
    unit = (second.skeleton.unit_cm or 1.0) / (first.skeleton.unit_cm or options.get("cm", 1.0))
    one = turn_up(one, first.skeleton.up_axis or "y")
    other = turn_up(other, second.skeleton.up_axis) * unit
    return float(np.nanmax(np.linalg.norm(one - other, axis=2)) / size)


main()
