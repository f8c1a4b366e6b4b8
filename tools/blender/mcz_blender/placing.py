"""A motion as bones and keys: rest pose, how bones are turned and moved. Without Blender.

Every joint becomes a bone that begins where the joint is. At rest nothing is turned, so that a
joint's axes are those of the world, whatever its bone's are; ``keys_of_bone`` goes from the one to
the other. What stretches (lengths, scales) moves the bones at the other end. The bone itself is
scaled along its length, which no other bone inherits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import mcz
from mcz.kinematics.chain import Chain, Pose, multiply_matrices
from mcz.kinematics.joint_names import sides_of

from .spaces import TO_Z_UP, Floats, blender_names, continuous, to_quaternions

SHORT = 1e-4  # of the figure: bones shorter than this are points
FARTHEST = 2.0**60  # Blender's numbers are float32, and it squares them
LEAST_SCALE = 1e-3
STUB = 0.02  # of the figure, the length of the bone of a point
UNSIZED = 1.0


@dataclass(frozen=True)
class Bone:
    """A bone at rest, in Blender's axes and units.

    ``joint`` and ``end``: which joint begins here, or (``end`` >= 0) which of its tails.
    ``ends_at``: the tail of the joint at which the bone ends, -1: none. ``turns`` (n, 4) and
    ``shifts`` (n, 3), None where there are none: its rotation from its parent, w first, and where
    it is from its parent, both along the axes of the world at rest; NaN where unknown.
    """

    name: str
    joint: int
    end: int
    parent: int
    head: Floats
    tail: Floats
    ends_at: int
    turns: Floats | None
    shifts: Floats | None
    offset: Floats
    scales: Floats | None = None


def size_of(skeleton: mcz.Skeleton) -> float:
    """The greatest distance of a joint or a tail from its root at rest, in length units."""
    rests = mcz.rest_positions(skeleton)
    roots: list[int] = []
    most = 0.0
    for index, joint in enumerate(skeleton.joints):
        roots.append(roots[joint.parent] if joint.parent >= 0 else index)
        for tail in ((0.0, 0.0, 0.0), *joint.tails):
            away = rests[index] + np.array(tail) - rests[roots[index]]
            most = max(most, float(np.sqrt(away @ away)))
    return most or UNSIZED


def bones_of(motion: mcz.Motion, up: str, scale: float) -> list[Bone]:
    """The bones of ``motion``, parents before children; ``up`` its axis, ``scale`` of its units.

    Raises MotionError where the skeleton has no kinematics.
    """
    return _Placed(motion, TO_Z_UP[up] * scale).bones()


class _Placed:
    """The joints of a motion in Blender's axes; ``matrix`` turns and scales."""

    def __init__(self, motion: mcz.Motion, matrix: Floats) -> None:
        if motion.signals[0].channels is not None:
            raise mcz.MotionError(
                f"{motion.name!r}: the channels of its motion signal differ from its skeleton's"
            )
        self.skeleton = motion.skeleton
        self.matrix, self.scale = matrix, float(np.cbrt(np.linalg.det(matrix)))
        self.turn = matrix / self.scale
        self.size = size_of(self.skeleton) * self.scale
        if not self.size < FARTHEST:
            raise mcz.MotionError(f"{motion.name!r}: bones of {self.size:g} m are beyond Blender")
        self.chain = Chain(self.skeleton)
        self.links = self.chain.links
        self.tails = [self._loose(index) for index in range(len(self.links))]
        self.values = np.asarray(motion.values, np.float64)
        self.turns: dict[int, Floats] = {}
        self.shifts: dict[tuple[int, int], Floats] = {}
        self._solve()
        self.offsets = [self._offset(index) for index in range(len(self.links))]

    def _stretches(self, index: int) -> bool:
        return index >= 0 and bool(self.links[index].scales or self.links[index].lengths)

    def _loose(self, index: int) -> list[int]:
        """The tails of a joint at which no child begins and stays."""
        joints = self.skeleton.joints
        begun = {
            joint.offset
            for joint, link in zip(joints, self.links, strict=True)
            if joint.parent == index and not link.moves
        }
        return [k for k, tail in enumerate(joints[index].tails) if tail not in begun]

    def _solve(self) -> None:
        """Fill ``turns`` and ``shifts``, block by block."""
        n_frames = len(self.values)
        for index, link in enumerate(self.links):
            if link.turns:
                self.turns[index] = np.empty((n_frames, 4))
            if link.moves or self._stretches(link.parent):
                self.shifts[index, -1] = np.empty((n_frames, 3))
            if self._stretches(index):
                self.shifts |= {(index, k): np.empty((n_frames, 3)) for k in self.tails[index]}
        for rows, columns, pose in self.chain.poses(self.values):
            self._block(rows, columns, pose)
        for index, turns in self.turns.items():
            turns[:, 1:] = turns[:, 1:] @ self.turn.T
            self.turns[index] = continuous(turns)
        for shifts in self.shifts.values():
            shifts[:] = shifts @ self.matrix.T

    def _block(self, rows: slice, columns: Floats, pose: Pose) -> None:
        for index, out in self.turns.items():
            own = self.chain.turned[index]
            axes = np.eye(3)[:, :, None] if own is None else own[:, :, None]
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                axes = self.chain.apply_turns(self.links[index], axes, columns, [])
            turned = axes if own is None else multiply_matrices(axes, own.T[:, :, None])
            out[rows] = to_quaternions(np.moveaxis(turned, 2, 0))
        for (index, tail), out in self.shifts.items():
            arm = pose.arms[index] if tail < 0 else self.links[index].tails[tail][:, None]
            out[rows] = self._along_rest(index, tail, arm, columns).T

    def _along_rest(self, index: int, tail: int, arm: Floats, columns: Floats) -> Floats:
        """``arm``, along the local axes of the joint it begins at, along its axes at rest."""
        holder = self.links[index].parent if tail < 0 else index
        if holder < 0:
            return arm
        link = self.links[holder]
        if tail >= 0:
            arm = self.chain.apply_lengths(link, arm, columns)
        arm = self.chain.apply_scales(link, arm, columns)
        own = self.chain.turned[holder]
        return arm if own is None else multiply_matrices(own[:, :, None], arm[:, None])[:, 0]

    def _offset(self, index: int) -> Floats:
        """From the parent at rest; of a joint that would lie on it, where it is first known."""
        offset = self.matrix @ np.array(self.skeleton.joints[index].offset)
        shifts = self.shifts.get((index, -1))
        if shifts is not None and self.links[index].parent >= 0 and not offset.any():
            known = shifts[np.isfinite(shifts).all(axis=1)]
            return known[0] if len(known) else offset
        return offset

    def bones(self) -> list[Bone]:
        """A bone a joint, each followed by those of its tails at which it does not end."""
        addresses, children = self.skeleton.addresses(), self.skeleton.children
        sides = sides_of(addresses)
        made: list[Bone] = []
        numbers: list[int] = []
        for index, joint in enumerate(self.skeleton.joints):
            above = made[numbers[joint.parent]] if joint.parent >= 0 else None
            parent = numbers[joint.parent] if above else -1
            head = self.offsets[index] + (above.head if above else 0.0)
            ends_at, arm = self._arm(index, children[index], sides)
            tail = head + (self._stub(above) if arm is None else arm)
            turns, shifts = self.turns.get(index), self.shifts.get((index, -1))
            offset = self.offsets[index]
            ends, scales = (ends_at, turns, shifts, offset), self._scales(index, tail - head)
            bone = Bone(addresses[index], index, -1, parent, head, tail, *ends, scales)
            numbers.append(len(made))
            made.append(bone)
            made += [self._end(bone, numbers[index], k) for k in self.tails[index] if k != ends_at]
        names = blender_names(bone.name for bone in made)
        return [replace(bone, name=name) for bone, name in zip(made, names, strict=True)]

    def _arm(
        self, index: int, children: tuple[int, ...], sides: list[str]
    ) -> tuple[int, Floats | None]:
        """Number of a bone's tail, and the vector to it from the head; None without length."""
        tails = self.skeleton.joints[index].tails
        if tails:
            arm = self.matrix @ np.array(tails[0])
            if self._is_long(arm):
                return -1 if self._stretches(index) else 0, arm
        arms = {k: self.offsets[k] for k in children if self._is_long(self.offsets[k])}
        middle = [child for child in arms if not sides[child]]
        if len(middle) == 1:
            return -1, arms[middle[0]]  # the spine goes on, whatever hangs beside it
        if not arms:
            return -1, None
        mean = np.mean(list(arms.values()), axis=0)
        return -1, mean if self._is_long(mean) else next(iter(arms.values()))

    def _scales(self, index: int, arm: Floats) -> Floats | None:
        """Relative lengths of the bone, 1 at rest, for a joint that stretches its children."""
        if not self._stretches(index):
            return None
        children = [(k, -1) for k, link in enumerate(self.links) if link.parent == index]
        for key in [*((index, tail) for tail in self.tails[index]), *children]:
            if np.allclose(self._at_rest(*key), arm, 0, SHORT * self.size):
                length = np.sqrt((self.shifts[key] ** 2).sum(axis=1) / (arm @ arm))
                return np.maximum(length, LEAST_SCALE)
        return None

    def _at_rest(self, index: int, tail: int) -> Floats:
        """From a joint to its tail, or (-1) from its parent to it."""
        tails = self.skeleton.joints[index].tails
        return self.offsets[index] if tail < 0 else self.matrix @ np.array(tails[tail])

    def _is_long(self, arm: Floats) -> bool:
        return float(arm @ arm) > (SHORT * self.size) ** 2

    def _stub(self, above: Bone | None) -> Floats:
        """The bone of a joint without length: as the one above points, or up."""
        if above is None:
            return np.array([0.0, 0.0, STUB * self.size])
        way: Floats = above.tail - above.head
        return way * (STUB * self.size / np.sqrt(way @ way))

    def _end(self, bone: Bone, number: int, tail: int) -> Bone:
        """A short bone at a tail of a joint at which its own bone does not end."""
        place = self.matrix @ np.array(self.skeleton.joints[bone.joint].tails[tail])
        head = bone.head + place
        name = f"{bone.name} end" + (f" {tail + 1}" if tail else "")
        shifts = self.shifts.get((bone.joint, tail))
        stub = self._stub(bone)
        return Bone(name, bone.joint, tail, number, head, head + stub, -1, None, shifts, place)


def keys_of_bone(
    bone: Bone, rest: Floats, above: tuple[Floats, Floats] | None
) -> tuple[Floats | None, Floats | None]:
    """A bone's rotations (n, 4) and locations (n, 3) along its own axes, None where it has none.

    ``rest`` (3, 3) has as columns the axes of the bone at rest; ``above`` are those of its parent,
    and the scales of that, None where it has none.
    """
    turns, shifts = bone.turns, bone.shifts
    if turns is not None:
        turns = np.concatenate([turns[:, :1], turns[:, 1:] @ rest], axis=1)
    if shifts is not None:
        if above is not None:  # the parent's scale moves what hangs on it
            axes, scales = above
            along = shifts @ axes
            along[:, 1] /= scales
            shifts = along @ axes.T
        shifts = (shifts - bone.offset) @ rest
    return turns, shifts


def markers_of(motion: mcz.Motion, up: str, scale: float) -> Floats:
    """Marker positions of ``motion``, (n_frames, n_markers, 3), NaN for missing ones."""
    positions: Floats = mcz.positions(motion) @ (TO_Z_UP[up] * scale).T
    return positions
