"""Places and turns of bones, or of markers, back to a motion. Without Blender.

The inverse of ``placing``: joints turn about Euler angles, lengths are in a unit of the file's own,
and all numbers lie on a grid of so many decimals, which a lossless codec then keeps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

import mcz
from mcz.kinematics.rotations import euler_angles, euler_order
from mcz.model.numbers import Grid, GridKind

from .spaces import TO_Z_UP, Floats

STILL_TURN = 2e-6  # radians; what float32 matrices of Blender leave of no rotation
STILL = 2e-6  # of the figure, the same of no shift
NEAR = 1e-5  # of the figure: a child that begins so near to the tail begins there


@dataclass(frozen=True)
class Facts:
    """Facts about a motion from its file. ``scale``: its length units per unit of Blender.

    ``angle_decimals`` of degrees and ``length_decimals`` of units are the grid.
    """

    name: str
    rate: Fraction
    unit_cm: float
    up: str
    scale: float
    angle_decimals: int = 4
    length_decimals: int = 4
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Part:
    """A bone as it was recorded, in Blender's axes and units.

    ``rest`` (4, 4) at rest in the armature, ``tail`` (3,) likewise; ``matrices`` (n_frames, 4, 4)
    in the world. ``has_end``: its tail is a point of its own; ``is_end``: it stands for a tail of
    its parent.
    """

    name: str
    parent: int
    rest: Floats
    tail: Floats
    matrices: Floats
    has_end: bool
    is_end: bool


def motion_of_bones(parts: list[Part], facts: Facts, stretch: float = 1.0) -> mcz.Motion:
    """The motion of an armature whose object is scaled by ``stretch``."""
    return _Solved(parts, facts, stretch).motion()


class _Solved:
    """Joints and their channels, in the axes and units of the file."""

    def __init__(self, parts: list[Part], facts: Facts, stretch: float) -> None:
        self.parts, self.facts = parts, facts
        self.matrix = TO_Z_UP[facts.up].T
        self.rests = np.stack([part.rest[:3, 3] for part in parts]) * (stretch * facts.scale)
        self.rests = self.rests @ self.matrix.T
        tails = np.stack([part.tail for part in parts]) * (stretch * facts.scale)
        self.tails = tails @ self.matrix.T - self.rests
        self.places = [part.matrices[:, :3, 3] * facts.scale @ self.matrix.T for part in parts]
        self.turns = [self._turned(part) for part in parts]
        self.size = float(np.sqrt(((self.rests - self.rests[0]) ** 2).sum(axis=1)).max()) or 1.0

    def _turned(self, part: Part) -> Floats:
        """World rotations of a bone, the identity at rest, (n_frames, 3, 3)."""
        axes = part.matrices[:, :3, :3]
        axes = axes / np.sqrt((axes * axes).sum(axis=1, keepdims=True))
        rest = part.rest[:3, :3] / np.sqrt((part.rest[:3, :3] ** 2).sum(axis=0))
        return self.matrix @ (axes @ rest.T) @ self.matrix.T

    def _local(self, index: int) -> tuple[Floats, Floats, Floats]:
        """Offset (3,), shifts (n_frames, 3) from the parent, and turns (n_frames, 3, 3)."""
        parent = self.parts[index].parent
        if parent < 0:
            return self.rests[index], self.places[index], self.turns[index]
        back = np.swapaxes(self.turns[parent], 1, 2)
        shifts = (back @ (self.places[index] - self.places[parent])[:, :, None])[:, :, 0]
        return self.rests[index] - self.rests[parent], shifts, back @ self.turns[index]

    def motion(self) -> mcz.Motion:
        locals_ = [self._local(index) for index in range(len(self.parts))]
        still = [
            bool((np.abs(shifts - offset) <= STILL * self._reach(index)).all())
            for index, (offset, shifts, _) in enumerate(locals_)
        ]
        kept = [k for k, part in enumerate(self.parts) if not (part.is_end and still[k])]
        numbers = {index: number for number, index in enumerate(kept)}
        joints, columns = [], []
        for index in kept:
            part, (offset, shifts, turns) = self.parts[index], locals_[index]
            order, angles = _angles(turns)
            kinds = [f"r{letter}" for letter in order]
            if part.parent < 0 or not still[index]:
                columns += list((shifts - offset).T)
                kinds = ["tx", "ty", "tz", *kinds]
            columns += list(angles.T)
            parent = numbers[part.parent] if part.parent >= 0 else -1
            channels = tuple(map(mcz.Channel, kinds))
            tails = self._tails(index, still)
            joints.append(mcz.Joint(part.name, parent, _vector(offset), tails, channels=channels))
        return _made(joints, columns, self.facts)

    def _reach(self, index: int) -> float:
        """Magnitude of the numbers at a bone, which sets float32's rounding."""
        return max(self.size, float(np.abs(self.places[index]).max(initial=0.0)))

    def _tails(self, index: int, still: list[bool]) -> tuple[tuple[float, float, float], ...]:
        """Ends of bones at which no joint begins."""
        below = [k for k, part in enumerate(self.parts) if part.parent == index]
        arms = {k: self.rests[k] - self.rests[index] for k in below}
        found = [arms[k] for k in below if self.parts[k].is_end and still[k]]
        begun = [arms[k] for k in below if not self.parts[k].is_end and still[k]]
        tail = self.tails[index]
        taken = any(np.abs(arm - tail).max() <= NEAR * self.size for arm in begun)
        if self.parts[index].has_end and not taken:
            found.insert(0, tail)
        return tuple(map(_vector, found))


def _angles(turns: Floats) -> tuple[str, Floats]:
    """An order and the angles, (n_frames, 3) in degrees; of what never turns, none."""
    moved = np.moveaxis(turns, 0, 2)
    if (np.abs(moved - np.eye(3)[:, :, None]) <= STILL_TURN).all():
        return "", np.zeros((len(turns), 0))
    order = euler_order(moved)
    return order, np.rad2deg(euler_angles(moved, order))


def motion_of_markers(names: list[str], places: Floats, facts: Facts) -> mcz.Motion:
    """The motion of markers at ``places``, (n_frames, n_markers, 3), NaN where one is missing."""
    moved = places @ TO_Z_UP[facts.up] * facts.scale
    channels = tuple(map(mcz.Channel, ("tx", "ty", "tz")))
    joints = [mcz.Joint(name, channels=channels) for name in names]
    return _made(joints, list(moved.reshape(len(moved), -1).T), facts)


def _made(joints: list[mcz.Joint], columns: list[Floats], facts: Facts) -> mcz.Motion:
    """The motion of these channels, rounded to the grid; what is NaN is invalid."""
    skeleton = mcz.Skeleton(tuple(joints), facts.name, facts.unit_cm, up_axis=facts.up)
    digits = [
        facts.length_decimals if channel.kind.startswith("t") else facts.angle_decimals
        for channel in skeleton.channels
    ]
    steps = 10.0 ** np.array(digits)
    values = np.rint(np.stack(columns, axis=1) * steps) / steps + 0.0  # no -0
    known = np.isfinite(values)
    signal = mcz.Signal(
        np.where(known, values, 0.0),
        tuple(Grid(GridKind.FIXED, n) for n in digits),
        mask=None if known.all() else known,
    )
    metadata = dict(facts.metadata)
    return mcz.Motion(skeleton, (signal,), facts.rate, name=facts.name, metadata=metadata)


def _vector(vector: Floats) -> tuple[float, float, float]:
    """Rounded to what float32 knows of it, so that 5.9 is not 5.900000095."""
    x, y, z = (float(f"{part:.7g}") + 0.0 for part in vector)
    return x, y, z
