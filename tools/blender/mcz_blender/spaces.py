"""Axes, units, quaternions and names: what a motion's numbers become in Blender. NumPy alone."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CM_PER_M = 100.0
UNITS_CM = {"mm": 0.1, "cm": 1.0, "m": 100.0, "in": 2.54, "ft": 30.48}
# From the motion's axes to Blender's, whose z points up: proper rotations.
TO_Z_UP = {
    "x": np.array([(0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)]),
    "y": np.array([(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)]),
    "z": np.eye(3),
    "-x": np.array([(0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)]),
    "-y": np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)]),
    "-z": np.diag((1.0, -1.0, -1.0)),
}
NAME_BYTES = 63  # of a bone's name in Blender


def to_quaternions(matrices: Floats) -> Floats:
    """Rotation matrices (n, 3, 3) as unit quaternions (n, 4), w first; NaN stays NaN.

    Of the four products of a quaternion's parts with one of them, those with the greatest are
    taken (Shepperd 1978), so that none is a difference of nearly equal numbers.
    """
    m = np.moveaxis(np.asarray(matrices, np.float64), 0, 2)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    greatest = np.argmax(np.stack([trace, m[0, 0], m[1, 1], m[2, 2]]), axis=0)
    found = np.empty((4, m.shape[2]))
    for part in range(4):
        rows = greatest == part
        found[:, rows] = _products(m[:, :, rows], trace[rows], part)
    with np.errstate(invalid="ignore"):
        return (found / np.sqrt((found * found).sum(axis=0))).T


def _products(m: Floats, trace: Floats, part: int) -> Floats:
    """4 q q[part], (4, n), of matrices (3, 3, n)."""
    if part == 0:
        return np.stack([1 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    i = part - 1
    j, k = (i + 1) % 3, (i + 2) % 3
    found = np.empty((4, m.shape[2]))
    found[0] = m[k, j] - m[j, k]
    found[1 + i] = 1 + m[i, i] - m[j, j] - m[k, k]
    found[1 + j] = m[i, j] + m[j, i]
    found[1 + k] = m[k, i] + m[i, k]
    return found


def continuous(quaternions: Floats) -> Floats:
    """Quaternions (n, 4) with the signs that keep neighbors near each other, the first w >= 0."""
    if not len(quaternions):
        return quaternions
    steps = np.ones(len(quaternions))
    steps[0] = -1.0 if quaternions[0, 0] < 0 else 1.0
    steps[1:][(quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0] = -1.0
    return quaternions * np.cumprod(steps)[:, None]


def blender_names(names: Iterable[str], fallback: str = "joint") -> list[str]:
    """Names as Blender's bones have them: at most 63 bytes of UTF-8, none empty, each once.

    >>> blender_names(["hip", "hip", ""])
    ['hip', 'hip.001', 'joint']
    """
    taken: set[str] = set()
    found: list[str] = []
    numbers: dict[str, int] = {}
    for name in names:
        plain = cut(name, NAME_BYTES) or fallback
        made = plain
        while made in taken:
            numbers[plain] = numbers.get(plain, 0) + 1
            end = f".{numbers[plain]:03}"
            made = cut(plain, NAME_BYTES - len(end)) + end
        taken.add(made)
        found.append(made)
    return found


def cut(name: str, n_bytes: int) -> str:
    """Cut a name to ``n_bytes``, at a whole character."""
    return holdable(name).encode()[:n_bytes].decode("utf-8", "ignore")


def holdable(text: str) -> str:
    """A text as Blender's properties take it: valid UTF-8 without zeros."""
    return text.replace("\0", "").encode("utf-8", "replace").decode()
