"""A scene as binary glTF 2.0 (ISO/IEC 12113): one file for any viewer.

The root node, named after the motion, turns the up axis to y; below it are the joints in the rest
pose. One animation moves all nodes. Bones are a mesh, skinned to the joints. Markers are nodes with
a mesh each; glTF has no visibility, so missing ones are scaled to 0, in steps.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.exchange.conversion.scenes.keys import Keys, SceneKeys
from mcz.exchange.conversion.scenes.nodes import (
    COLORS,
    MARKER,
    OCTAHEDRON,
    SIDES,
    Scene,
    Solid,
    marker_corners,
    solid_of,
)
from mcz.kinematics.chain import Floats
from mcz.model.types import Items, JsonObject

UBYTE, USHORT, UINT, FLOAT = 5121, 5123, 5125, 5126  # component types
VERTICES, INDICES = 34962, 34963  # purposes of a buffer view
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
HALF = 0.5**0.5
UP_TURNS = {  # quaternions (x, y, z, w) that turn an axis to y
    "x": [0.0, 0.0, HALF, HALF],
    "z": [-HALF, 0.0, 0.0, HALF],
    "-x": [0.0, 0.0, -HALF, HALF],
    "-y": [1.0, 0.0, 0.0, 0.0],
    "-z": [HALF, 0.0, 0.0, HALF],
}
UP_MATRICES = {
    "x": [(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)],
    "y": [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)],
    "z": [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)],
    "-x": [(0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)],
    "-y": [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)],
    "-z": [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)],
}


def build_glb(scene: Scene, keys: SceneKeys, generator: str, extras: JsonObject) -> bytes:
    """Build the file; ``extras`` are facts about the motion, stored under "asset"."""
    return _Document(scene, keys).bytes(generator, extras)


class _Document:
    """Collects the parts of the file. Node 0 turns the up axis."""

    def __init__(self, scene: Scene, keys: SceneKeys) -> None:
        self.scene, self.keys = scene, keys
        self.buffer = bytearray()
        self.views: list[JsonObject] = []
        self.accessors: list[JsonObject] = []
        self.sides = [s for s in SIDES if any(node.side == s for node in scene.nodes)]
        self.up = np.array(UP_MATRICES[scene.up_axis])
        self.nodes = self._nodes()
        self.meshes, self.skins = ([], []) if scene.is_markers else self._skinned_mesh()
        if scene.is_markers:
            self.meshes = self._marker_meshes()
        self.animations = self._animations()

    def bytes(self, generator: str, extras: JsonObject) -> bytes:
        document: JsonObject = {
            "asset": {"version": "2.0", "generator": generator, "extras": extras},
            "scene": 0,
            "scenes": [{"nodes": [0] if self.scene.is_markers else [0, len(self.nodes) - 1]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "skins": self.skins,
            "animations": self.animations,
            "materials": [_material(side) for side in self.sides],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.buffer)}],
        }
        present = {key: value for key, value in document.items() if value or key == "scene"}
        text = json.dumps(present, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        head = text.encode("utf-8", "replace")
        head += b" " * (-len(head) % 4)
        body = bytes(self.buffer) + bytes(-len(self.buffer) % 4)
        total = 12 + 8 + len(head) + 8 + len(body)
        return b"".join(
            [
                struct.pack("<4sIIII", b"glTF", 2, total, len(head), 0x4E4F534A),  # "JSON"
                head,
                struct.pack("<II", len(body), 0x004E4942),  # "BIN"
                body,
            ]
        )

    def _nodes(self) -> list[JsonObject]:
        """Node 0, then those of the scene, then the mesh's if there is one skin."""
        scene = self.scene
        roots = [number + 1 for number, node in enumerate(scene.nodes) if node.parent < 0]
        top: JsonObject = {"name": scene.name, "children": roots}
        if scene.up_axis in UP_TURNS:
            top["rotation"] = UP_TURNS[scene.up_axis]
        nodes = [top]
        for node, children in zip(scene.nodes, scene.children, strict=True):
            entry: JsonObject = {"name": node.name}
            rest = _floats(node.rest)
            if any(rest):
                entry["translation"] = rest
            if children:
                entry["children"] = [number + 1 for number in children]
            if scene.is_markers:
                entry["mesh"] = self.sides.index(node.side)
                if not node.is_visible.any():
                    entry["scale"] = [0.0, 0.0, 0.0]
            nodes.append(entry)
        if not scene.is_markers:
            nodes.append({"name": "bones", "mesh": 0, "skin": 0})
        return nodes

    def _skinned_mesh(self) -> tuple[list[JsonObject], list[JsonObject]]:
        """The mesh of the bones, in the world at rest, and its skin."""
        solid, count = solid_of(self.scene), len(self.scene.nodes)
        attributes = self._attributes(solid)
        primitives = []
        for side, triangles in solid.triangles.items():
            indices = self._indices(triangles, len(solid.corners))
            material = self.sides.index(side)
            primitives.append({"attributes": attributes, "indices": indices, "material": material})
        binds = np.zeros((count, 4, 4))  # from the world at rest to each node, column by column
        binds[:, :3, :3] = self.up  # the transpose of its inverse
        binds[:, 3, :3] = -self.scene.rest_places
        binds[:, 3, 3] = 1.0
        matrices = self._accessor(binds.reshape(count, 16).astype("<f4"), FLOAT, view=self._view())
        skin = {"inverseBindMatrices": matrices, "skeleton": 0, "joints": [*range(1, count + 1)]}
        return [{"name": "bones", "primitives": primitives}], [skin]

    def _attributes(self, solid: Solid) -> dict[str, int]:
        kind, code = ("<u1", UBYTE) if len(self.scene.nodes) <= 256 else ("<u2", USHORT)
        joints = np.zeros((len(solid.nodes), 4), kind)
        joints[:, 0] = solid.nodes
        weights = np.zeros((len(solid.nodes), 4), "u1")
        weights[:, 0] = 255
        corners = (solid.corners @ self.up.T).astype("<f4")
        return {
            "POSITION": self._accessor(corners, FLOAT, True, self._view(VERTICES)),
            "JOINTS_0": self._accessor(joints, code, view=self._view(VERTICES)),
            "WEIGHTS_0": self._accessor(weights, UBYTE, view=self._view(VERTICES), normalized=True),
        }

    def _indices(self, triangles: NDArray[np.int64], n_corners: int) -> int:
        kind, code = ("<u2", USHORT) if n_corners < 65536 else ("<u4", UINT)
        data = triangles.reshape(-1, 1).astype(kind)
        return self._accessor(data, code, view=self._view(INDICES))

    def _marker_meshes(self) -> list[JsonObject]:
        corners = marker_corners(MARKER * self.scene.size).astype("<f4")
        position = self._accessor(corners, FLOAT, True, self._view(VERTICES))
        indices = self._indices(OCTAHEDRON, len(corners))
        return [
            {
                "primitives": [
                    {"attributes": {"POSITION": position}, "indices": indices, "material": number}
                ]
            }
            for number in range(len(self.sides))
        ]

    def _animations(self) -> list[JsonObject]:
        view = self._view()
        samplers: list[JsonObject] = []
        channels: list[JsonObject] = []
        inputs: dict[bytes, int] = {}

        def add(number: int, path: str, keys: Keys, interpolation: str) -> None:
            times = self.scene.times[keys.frames].astype("<f4")[:, None]
            key = times.tobytes()
            if key not in inputs:
                inputs[key] = self._accessor(times, FLOAT, True, view)
            output = self._accessor(keys.values.astype("<f4"), FLOAT, view=view)
            sampler: JsonObject = {"input": inputs[key], "output": output}
            if interpolation != "LINEAR":
                sampler["interpolation"] = interpolation
            target = {"node": number + 1, "path": path}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append(sampler)

        for number, node in enumerate(self.scene.nodes):
            turns, shifts = self.keys.turns[number], self.keys.shifts[number]
            if turns is not None:
                add(number, "rotation", turns, "LINEAR")
            if shifts is not None:
                add(number, "translation", shifts, "LINEAR")
            if self.scene.is_markers and 0 < node.is_visible.sum() < len(node.is_visible):
                add(number, "scale", _sizes(node.is_visible), "STEP")
        if not channels:
            self.views.pop()
            return []
        return [{"name": self.scene.name, "channels": channels, "samplers": samplers}]

    def _view(self, target: int | None = None) -> int:
        """A new buffer view, at the end of the buffer, for the next numbers."""
        self.buffer += bytes(-len(self.buffer) % 4)
        view: JsonObject = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": 0}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        return len(self.views) - 1

    def _accessor(
        self, data: Items, code: int, bounds: bool = False, view: int = 0, **more: object
    ) -> int:
        """Add an accessor of rows of numbers in the last buffer view, number ``view``."""
        start = self.views[view]["byteOffset"]
        entry = {"bufferView": view, "byteOffset": len(self.buffer) - start, "componentType": code}
        entry |= {"count": len(data), "type": TYPES[data.shape[1]], **more}
        if not entry["byteOffset"]:
            del entry["byteOffset"]
        if bounds:
            entry |= {"min": _floats(data.min(axis=0)), "max": _floats(data.max(axis=0))}
        self.buffer += data.tobytes()
        self.views[view]["byteLength"] = len(self.buffer) - start
        self.accessors.append(entry)
        return len(self.accessors) - 1


def _sizes(is_visible: NDArray[np.bool_]) -> Keys:
    """Keys of the scale of a marker: 1 while it is visible, 0 while it is missing."""
    frames = np.flatnonzero(np.diff(is_visible, prepend=~is_visible[:1]))
    values = np.repeat(is_visible[frames, None], 3, axis=1)
    return Keys(frames, values.astype(np.float32))


def _material(side: str) -> JsonObject:
    return {
        "name": side or "middle",
        "pbrMetallicRoughness": {
            "baseColorFactor": [*COLORS[side], 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.8,
        },
    }


def _floats(values: Sequence[Any] | Items | Floats) -> list[float]:
    return [float(value) for value in np.asarray(values, np.float32)]
