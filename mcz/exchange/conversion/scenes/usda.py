"""A scene as USD in text (.usda): UsdSkel for skeletons, a sphere a marker.

Meters, the up axis of the motion, a sample a frame. Bones are a mesh, bound to the joints of the
skeleton; only joints that move are in the animation. A missing marker is invisible.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.exchange.conversion.scenes.keys import Keys, SceneKeys, interpolate_keys
from mcz.exchange.conversion.scenes.nodes import COLORS, MARKER, SIDES, Node, Scene, Solid, solid_of
from mcz.kinematics.chain import Floats
from mcz.model.types import JsonObject

UP_TURNS = {  # degrees about x, y and z: that axis becomes y
    "x": "(0, 0, 90)",
    "-x": "(0, 0, -90)",
    "-y": "(180, 0, 0)",
    "-z": "(90, 0, 0)",
}
IDENTIFIER = re.compile(r"[^A-Za-z0-9_]")


def build_usda(scene: Scene, keys: SceneKeys, generator: str, facts: JsonObject) -> bytes:
    """Build the file, with keys in every frame; the layer keeps ``facts`` about the motion."""
    name = identifiers([scene.name])[0]
    body = _markers(scene, keys) if scene.is_markers else _skeleton(scene, keys, name)
    kind = "Xform" if scene.is_markers else "SkelRoot"
    lines = [*_layer(scene, name, generator, facts), f"def {kind} {quote_text(name)} ("]
    lines.append(f"    displayName = {quote_text(scene.name)}")
    lines += [")", "{", *_indent(_to_usd_up(scene)), *_indent(body), "}", ""]
    return "\n".join(lines).encode("utf-8", "replace")


def _layer(scene: Scene, name: str, generator: str, facts: JsonObject) -> Iterator[str]:
    rate = _number(float(scene.rate))
    yield "#usda 1.0"
    yield "("
    yield f"    defaultPrim = {quote_text(name)}"
    yield f"    doc = {quote_text(generator)}"
    yield "    customLayerData = {"
    for key, value in facts.items():
        if isinstance(value, bool):
            yield f"        bool {key} = {int(value)}"
        elif isinstance(value, int):
            yield f"        int64 {key} = {value}"
        elif isinstance(value, float):
            yield f"        double {key} = {_number(value)}"
        else:
            text = value if isinstance(value, str) else "; ".join(value)
            yield f"        string {key} = {quote_text(text)}"
    yield "    }"
    codes = scene.codes if len(scene.codes) else np.zeros(1)
    yield f"    endTimeCode = {_number(codes[-1])}"
    yield f"    framesPerSecond = {rate}"
    yield "    metersPerUnit = 1"
    yield f"    startTimeCode = {_number(codes[0])}"
    yield f"    timeCodesPerSecond = {rate}"
    yield f'    upAxis = "{"Z" if scene.up_axis == "z" else "Y"}"'
    yield ")"
    yield ""


def _to_usd_up(scene: Scene) -> Iterator[str]:
    """Turn the up axis to y, unless it is y or z, the only ones of USD."""
    if scene.up_axis in UP_TURNS:
        yield f"float3 xformOp:rotateXYZ = {UP_TURNS[scene.up_axis]}"
        yield 'uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]'


def _markers(scene: Scene, keys: SceneKeys) -> Iterator[str]:
    names = identifiers([node.name for node in scene.nodes])
    for name, node, shifts in zip(names, scene.nodes, keys.shifts, strict=True):
        yield f"def Sphere {quote_text(name)} ("
        yield f"    displayName = {quote_text(node.name)}"
        yield ")"
        yield "{"
        yield f"    double radius = {_number(MARKER * scene.size)}"
        yield f"    color3f[] primvars:displayColor = [{_tuple(COLORS[node.side])}]"
        yield f"    double3 xformOp:translate = {_tuple(_float32(node.rest))}"
        if shifts is not None:
            rows = (_tuple(row) for row in shifts.values)
            yield from _indent(_samples("double3 xformOp:translate", scene, shifts.frames, rows))
        yield '    uniform token[] xformOpOrder = ["xformOp:translate"]'
        yield from _indent(_visibility(scene, node))
        yield "}"


def _visibility(scene: Scene, node: Node) -> Iterator[str]:
    is_visible = node.is_visible
    if is_visible.all():
        return
    frames = np.flatnonzero(np.diff(is_visible, prepend=~is_visible[:1]))
    words = ('"inherited"' if is_visible[frame] else '"invisible"' for frame in frames)
    yield from _samples("token visibility", scene, frames, words)


def _skeleton(scene: Scene, keys: SceneKeys, name: str) -> Iterator[str]:
    paths, count = _paths(scene), len(scene.nodes)
    binds = np.tile(np.eye(4), (count, 1, 1))
    binds[:, 3, :3] = scene.rest_places
    rests = np.tile(np.eye(4), (count, 1, 1))
    rests[:, 3, :3] = [node.rest for node in scene.nodes]
    animated = [k for k in range(count) if keys.turns[k] is not None or keys.shifts[k] is not None]
    yield 'def Skeleton "skeleton" ('
    yield '    prepend apiSchemas = ["SkelBindingAPI"]'
    yield ")"
    yield "{"
    yield f"    uniform token[] joints = [{', '.join(map(quote_text, paths))}]"
    names = ", ".join(quote_text(node.name) for node in scene.nodes)
    yield f"    uniform token[] jointNames = [{names}]"
    yield f"    uniform matrix4d[] bindTransforms = [{', '.join(map(_matrix, binds))}]"
    yield f"    uniform matrix4d[] restTransforms = [{', '.join(map(_matrix, rests))}]"
    if animated:
        yield f"    rel skel:animationSource = </{name}/animation>"
    yield "}"
    if animated:
        yield from _animation(scene, keys, [paths[k] for k in animated], animated)
    yield from _mesh(solid_of(scene), name)


def _animation(
    scene: Scene, keys: SceneKeys, paths: Sequence[str], animated: Sequence[int]
) -> Iterator[str]:
    frames = np.arange(len(scene.times))
    shifts = [_dense(keys.shifts[k], scene.nodes[k].rest, scene.times) for k in animated]
    turns = [_dense(keys.turns[k], np.array([0.0, 0, 0, 1]), scene.times) for k in animated]
    yield 'def SkelAnimation "animation"'
    yield "{"
    yield f"    uniform token[] joints = [{', '.join(map(quote_text, paths))}]"
    yield f"    half3[] scales = [{', '.join(['(1, 1, 1)'] * len(animated))}]"
    for label, tracks, order in (
        ("float3[] translations", shifts, [0, 1, 2]),
        ("quatf[] rotations", turns, [3, 0, 1, 2]),  # w first
    ):
        still = all(len(track) == 1 for track in tracks)
        rows = (_row(tracks, frame, order) for frame in frames[: 1 if still else None])
        if still:
            yield f"    {label} = {next(rows)}"
        else:
            yield from _indent(_samples(label, scene, frames, rows))
    yield "}"


def _dense(keys: Keys | None, rest: Floats, times: Floats) -> NDArray[np.float32]:
    if keys is None:
        return _float32(rest)[None]
    if len(keys.frames) == 1:
        return keys.values
    out = np.empty((len(times), keys.values.shape[1]))
    interpolate_keys(times, keys.frames, keys.values.astype(np.float64), 0, 0, out)
    return _float32(out)


def _row(tracks: Sequence[NDArray[np.float32]], frame: int, order: list[int]) -> str:
    return f"[{', '.join(_tuple(t[min(frame, len(t) - 1)][order]) for t in tracks)}]"


def _mesh(solid: Solid, name: str) -> Iterator[str]:
    triangles = np.concatenate([solid.triangles[s] for s in SIDES if s in solid.triangles])
    colors = [COLORS[side] for side in SIDES for _ in solid.triangles.get(side, ())]
    yield 'def Mesh "bones" ('
    yield '    prepend apiSchemas = ["SkelBindingAPI"]'
    yield ")"
    yield "{"
    yield f"    int[] faceVertexCounts = [{', '.join(['3'] * len(triangles))}]"
    yield f"    int[] faceVertexIndices = [{', '.join(map(str, triangles.ravel().tolist()))}]"
    yield f"    point3f[] points = [{', '.join(map(_tuple, _float32(solid.corners)))}]"
    yield f"    color3f[] primvars:displayColor = [{', '.join(map(_tuple, colors))}] ("
    yield '        interpolation = "uniform"'
    yield "    )"
    followed = ", ".join(map(str, solid.nodes.tolist()))
    for label, values in (
        ("int[] primvars:skel:jointIndices", followed),
        ("float[] primvars:skel:jointWeights", ", ".join(["1"] * len(solid.nodes))),
    ):
        yield f"    {label} = [{values}] ("
        yield "        elementSize = 1"
        yield '        interpolation = "vertex"'
        yield "    )"
    yield f"    rel skel:skeleton = </{name}/skeleton>"
    yield '    uniform token subdivisionScheme = "none"'
    yield "}"


def _paths(scene: Scene) -> list[str]:
    """The path of every joint below its root, made of valid USD names."""
    paths: list[str] = []
    for node, name in zip(scene.nodes, identifiers([n.name for n in scene.nodes]), strict=True):
        paths.append(name if node.parent < 0 else f"{paths[node.parent]}/{name}")
    return paths


def identifiers(names: Sequence[str]) -> list[str]:
    """Unique valid names of prims in USD.

    >>> identifiers(["Left Foot", "Left_Foot", "3"])
    ['Left_Foot', 'Left_Foot_2', '_3']
    """
    unique: dict[str, None] = {}
    # the last one of each stem, so that many equal names need no search
    numbers: dict[str, int] = {}
    for name in names:
        stem = IDENTIFIER.sub("_", name)
        stem = f"_{stem}" if not stem or stem[0].isdigit() else stem
        identifier, number = stem, numbers.get(stem, 1)
        while identifier in unique:
            number += 1
            identifier = f"{stem}_{number}"
        unique[identifier] = None
        numbers[stem] = number
    return list(unique)


def quote_text(text: str) -> str:
    r"""A text in quotes.

    >>> print(quote_text('a "b" \\ \n'))
    "a \"b\" \\ \x0a"
    """
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", lambda match: f"\\x{ord(match[0]):02x}", escaped) + '"'


def _samples(
    label: str, scene: Scene, frames: NDArray[np.int64], values: Iterable[str]
) -> Iterator[str]:
    yield f"{label}.timeSamples = {{"
    for code, value in zip(scene.codes[frames].tolist(), values, strict=True):
        yield f"    {_number(code)}: {value},"
    yield "}"


def _indent(lines: Iterable[str]) -> Iterator[str]:
    return (f"    {line}" for line in lines)


def _number(value: object) -> str:
    text = str(value)  # of a float32 with as many digits as that needs
    return text.removesuffix(".0")


def _tuple(values: Iterable[Any]) -> str:
    return f"({', '.join(map(_number, values))})"


def _matrix(rows: Floats) -> str:
    return f"({', '.join(_tuple(row.tolist()) for row in rows)})"


def _float32(values: Floats) -> NDArray[np.float32]:
    return values.astype(np.float32)
