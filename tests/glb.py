"""An independent reader of binary glTF for tests: where each node is at some time. NumPy alone."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

KINDS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    """A file: its ``document``, and the numbers of its accessors."""

    def __init__(self, data: bytes) -> None:
        magic, version, total, length, kind = struct.unpack_from("<4sIIII", data)
        assert (magic, version, total, kind) == (b"glTF", 2, len(data), 0x4E4F534A)
        self.document: dict[str, Any] = json.loads(data[20 : 20 + length])
        size, kind = struct.unpack_from("<II", data, 20 + length)
        assert kind == 0x004E4942 and 28 + length + size == len(data)
        self.buffer = data[28 + length :]

    def accessor(self, number: int) -> np.ndarray:
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        width = WIDTHS[accessor["type"]]
        count = accessor["count"] * width
        values = np.frombuffer(self.buffer, KINDS[accessor["componentType"]], count, start)
        return values.reshape(-1, width)

    def places(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """World positions of every node by name, (n_times, 3)."""
        return {name: matrix[:, :3, 3] for name, matrix in self.matrices(times).items()}

    def matrices(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """World matrices of every node by name, (n_times, 4, 4)."""
        nodes = self.document["nodes"]
        parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", ())}
        tracks = self.tracks(times)
        matrices: dict[int, np.ndarray] = {}

        def world(number: int) -> np.ndarray:
            if number not in matrices:
                own = self.local(nodes[number], tracks.get(number, {}), len(times))
                parent = parents.get(number)
                matrices[number] = own if parent is None else world(parent) @ own
            return matrices[number]

        return {node["name"]: world(number) for number, node in enumerate(nodes)}

    @staticmethod
    def local(node: dict[str, Any], tracks: dict[str, np.ndarray], n: int) -> np.ndarray:
        rests = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
        shift, turn, size = (
            np.broadcast_to(tracks.get(path, node.get(path, rest)), (n, len(rest)))
            for path, rest in rests.items()
        )
        x, y, z, w = (turn / np.linalg.norm(turn, axis=1, keepdims=True)).T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        matrix = np.zeros((n, 4, 4))
        matrix[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0) * size[:, None]
        matrix[:, :3, 3] = shift
        matrix[:, 3, 3] = 1
        return matrix

    def tracks(self, times: np.ndarray) -> dict[int, dict[str, np.ndarray]]:
        """Animated translation, rotation and scale of every node."""
        tracks: dict[int, dict[str, np.ndarray]] = {}
        for animation in self.document.get("animations", ()):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                keys = self.accessor(sampler["input"])[:, 0].astype(np.float64)
                values = self.accessor(sampler["output"]).astype(np.float64)
                at = np.clip(np.searchsorted(keys, times, "right") - 1, 0, len(keys) - 1)
                to = np.minimum(at + 1, len(keys) - 1)
                span = np.where(to > at, keys[to] - keys[at], 1.0)
                share = np.clip((times - keys[at]) / span, 0, 1)[:, None]
                if sampler.get("interpolation") == "STEP":
                    made = values[at]
                elif channel["target"]["path"] == "rotation":
                    made = slerp(values[at], values[to], share)
                else:
                    made = values[at] + share * (values[to] - values[at])
                tracks.setdefault(channel["target"]["node"], {})[channel["target"]["path"]] = made
        return tracks


def slerp(one: np.ndarray, other: np.ndarray, share: np.ndarray) -> np.ndarray:
    """glTF 2.0, appendix C.4."""
    dot = (one * other).sum(axis=1, keepdims=True)
    angle = np.arccos(np.clip(np.abs(dot), 0, 1))
    sine = np.where(angle < 1e-7, 1.0, np.sin(angle))
    start = np.where(angle < 1e-7, 1 - share, np.sin(angle * (1 - share)) / sine)
    end = np.where(angle < 1e-7, share, np.sin(angle * share) / sine)
    return start * one + np.where(dot < 0, -1, 1) * end * other
