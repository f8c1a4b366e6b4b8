"""The chain of joints: channel values -> origin and local axes of every joint.

SPEC.md, "Kinematics", is normative. For each joint only B = W C is stored, whose columns are the
joint's local axes in the world (W: its rotation in the world, C: the matrix of its ``axis``). A
step from parent to child takes one constant matrix, C_parent^-1 C, and then one mixing of two
columns a rotation channel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from operator import itemgetter

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.rotations import (
    matrices_of_quaternions,
    matrices_of_vectors,
    rotate_axes,
    spins_of_vectors,
)
from mcz.model.motion import (
    ANGLE_KINDS,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    VECTOR_KINDS,
    Joint,
    Skeleton,
)
from mcz.model.skeleton import first_columns
from mcz.model.text_format import named
from mcz.model.types import Floats as Floats

SCALE_KINDS = ("sx", "sy", "sz")
QUATERNION, VECTOR = 3, 4  # as an axis of ``Link.turns``
BLOCK_JOINTS = 2**15  # joints x frames at a time: their origins and axes take 3 MB
LEAST_FRAMES = 16


@dataclass(frozen=True, slots=True)
class Link:
    """A joint as the chain needs it; vectors are along its own local axes unless noted.

    ``change``: C_parent^-1 C, shape (3, 3, 1), None if it is the identity. ``offset``: from the
    parent's origin, (3,), along the parent's W. ``parent_back``: C_parent^-1, or None. ``moves``
    and ``scales``: (component, column); ``turns``: (axis, column) in the order of multiplication
    from the right; the axis QUATERNION stands for the columns ``quaternion``, VECTOR for the
    columns ``vector``, each with the first of its columns. ``direction``: of the first tail, None
    if it has no length.
    """

    parent: int
    change: Floats | None
    offset: Floats
    parent_back: Floats | None
    replaces: bool
    tails: tuple[Floats, ...]
    direction: Floats | None
    moves: tuple[tuple[int, int], ...]
    turns: tuple[tuple[int, int], ...]
    quaternion: tuple[int, ...]
    vector: tuple[int, ...]
    scales: tuple[tuple[int, int], ...]
    lengths: tuple[int, ...]

    @property
    def angles(self) -> list[int]:
        """The columns of rotations about one axis, in the order of ``turns``."""
        return [column for axis, column in self.turns if axis < QUATERNION]

    @property
    def turning(self) -> list[int]:
        """The columns of all turning channels, in the order of ``turns``."""
        return [each for turn in self.turns for each in self.parts(*turn)]

    @property
    def is_whole(self) -> bool:
        """True if a single turn can be any rotation."""
        return bool(self.quaternion or self.vector)

    @property
    def freedoms(self) -> str:
        """The axes of ``turns`` as letters: x y z, q of a quaternion, v of a rotation vector."""
        return "".join("xyzqv"[axis] for axis, _ in self.turns)

    def parts(self, axis: int, column: int) -> tuple[int, ...]:
        """The columns of one of ``turns``."""
        if axis == QUATERNION:
            return self.quaternion
        return self.vector if axis == VECTOR else (column,)


@dataclass(frozen=True, slots=True)
class Pose:
    """Joint transforms of a block of F frames.

    By joint: ``origins`` has its position, (3, F) or (3, 1) if it is constant; ``axes`` its local
    axes as columns, (3, 3, F) or (3, 3, 1); ``arms`` the vector from its parent's origin along the
    parent's local axes before the parent's scale, (3, F) or (3, 1); ``spins`` the rotation axis in
    the world of each of its columns ``turning``, (3, F) or (3, 1), for a unit of a quaternion's
    part, or a radian of any other.
    """

    origins: list[Floats]
    axes: list[Floats]
    arms: list[Floats]
    spins: list[list[Floats]]


def knows_angles(skeleton: Skeleton) -> bool:
    """Return whether the rotations of a skeleton have a meaning: quaternions need no angle unit."""
    if skeleton.angle_unit:
        return True
    turning = any(channel.kind in ANGLE_KINDS for channel in skeleton.channels)
    return not turning and not any(any(joint.axis) for joint in skeleton.joints)


class Chain:
    """The kinematics of a skeleton, prepared once for all frames.

    Raises MotionError if the skeleton has rotations and its angle unit is unknown, and if it
    has channels, but none of them moves a joint.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        channels = skeleton.channels
        if not knows_angles(skeleton):
            raise MotionError(
                f"the angle unit of {named('skeleton', skeleton.name)} is unknown, so its "
                "rotations have no meaning"
            )
        if channels and not any(channel.kind for channel in channels):
            raise MotionError(
                f"{named('skeleton', skeleton.name)}: all {len(channels)} "
                "channels are plain scalars, which do not move joints"
            )
        self.radians = np.pi / 180 if skeleton.angle_unit == "deg" else 1.0
        self.turned = [orientation(joint, self.radians) for joint in skeleton.joints]
        starts = np.cumsum([0, *(len(joint.channels) for joint in skeleton.joints)]).tolist()
        self.links = [
            self._link(joint, matrix, start)
            for joint, matrix, start in zip(skeleton.joints, self.turned, starts, strict=False)
        ]

    def _link(self, joint: Joint, matrix: Floats | None, start: int) -> Link:
        """The link of a joint; ``matrix`` turns its own axes, ``start`` is its first column."""
        above = self.turned[joint.parent] if joint.parent >= 0 else None
        if above is None:
            change = matrix
        else:
            change = above.T if matrix is None else above.T @ matrix
        kinds = [channel.kind for channel in joint.channels]
        first = {kind: start + kinds.index(kind) for kind in kinds}
        quaternion = first_columns(joint.channels, QUATERNION_KINDS, start)
        vector = first_columns(joint.channels, VECTOR_KINDS, start)
        turns = [
            (ROTATION_KINDS.index(kind), start + k)
            for k, kind in enumerate(kinds)
            if kind in ROTATION_KINDS
        ]
        turns += [(QUATERNION, min(quaternion))] if quaternion else []
        turns += [(VECTOR, min(vector))] if vector else []
        turns.sort(key=itemgetter(1))
        back = None if matrix is None else matrix.T
        tails = tuple(_to_local(back, np.array(tail)) for tail in joint.tails)
        length = float(np.sqrt(tails[0] @ tails[0])) if tails else 0.0
        return Link(
            parent=joint.parent,
            change=None if change is None else np.ascontiguousarray(change)[:, :, None],
            offset=np.array(joint.offset),
            parent_back=None if above is None else above.T,
            replaces=not joint.adds_to_offset,
            tails=tails,
            direction=tails[0] / length if length else None,
            moves=_components(kinds, POSITION_KINDS, start),
            turns=tuple(turns if self.skeleton.intrinsic else reversed(turns)),
            quaternion=quaternion,
            vector=vector,
            scales=tuple((k, first[s]) for k, s in enumerate(SCALE_KINDS) if s in first),
            lengths=tuple(start + k for k, kind in enumerate(kinds) if kind == "length"),
        )

    def poses(self, values: Floats) -> Iterator[tuple[slice, Floats, Pose]]:
        """Blocks of frames: their rows, their values (n_channels, F), and their pose."""
        if values.ndim != 2 or values.shape[1] != self.skeleton.n_channels:
            raise MotionError(
                f"values of shape {values.shape} for {self.skeleton.n_channels} channels"
            )
        step = max(LEAST_FRAMES, BLOCK_JOINTS // max(1, len(self.links)))
        for start in range(0, len(values), step):
            rows = slice(start, min(start + step, len(values)))
            columns = np.array(values[rows].T, dtype=np.float64, order="C")
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                yield rows, columns, self.pose(columns)

    def pose(self, columns: Floats) -> Pose:
        """The pose of frames with the values ``columns``, shape (n_channels, F)."""
        pose = Pose([], [], [], [])
        for link in self.links:
            self.add(pose, link, self.place_joint(pose, link, columns), columns)
        return pose

    def place_joint(self, pose: Pose, link: Link, columns: Floats) -> tuple[Floats, Floats, Floats]:
        """Place the next joint after those in ``pose``: its arm, origin and unturned axes."""
        arm = self._arm(link, columns)
        if link.parent < 0:
            return arm, arm, IDENTITY if link.change is None else link.change
        above = pose.axes[link.parent]
        scaled = self.apply_scales(self.links[link.parent], arm, columns)
        origin = pose.origins[link.parent] + to_world(above, scaled)
        return arm, origin, above if link.change is None else multiply_matrices(above, link.change)

    def add(
        self, pose: Pose, link: Link, placement: tuple[Floats, Floats, Floats], columns: Floats
    ) -> None:
        """Add a joint that ``place_joint`` placed to ``pose``, turned by its channels."""
        arm, origin, axes = placement
        spins: list[Floats] = []
        axes = self.apply_turns(link, axes, columns, spins)
        pose.arms.append(arm)
        pose.origins.append(origin)
        pose.axes.append(axes)
        pose.spins.append(spins)

    def apply_turns(self, link: Link, axes: Floats, columns: Floats, spins: list[Floats]) -> Floats:
        """Rotate ``axes`` by the joint's channels; append their rotation axes to ``spins``."""
        for axis, column in link.turns:
            if axis == QUATERNION:
                axes = self._quaternion(axes, columns[list(link.quaternion)], spins)
            elif axis == VECTOR:
                vectors = columns[list(link.vector)] * self.radians
                spins += [to_world(axes, spin) for spin in spins_of_vectors(vectors).swapaxes(0, 1)]
                axes = multiply_matrices(axes, matrices_of_vectors(vectors))
            else:
                spins.append(axes[:, axis])
                axes = rotate_axes(axes, axis, columns[column] * self.radians)
        return axes

    def _arm(self, link: Link, columns: Floats) -> Floats:
        """From the parent's origin to the joint's, lengthened by the parent, before scaling."""
        arm = link.offset[:, None]
        if link.moves:
            arm = np.repeat(arm, columns.shape[1], axis=1)
            if link.replaces:
                arm[[component for component, _ in link.moves]] = 0.0
            for component, column in link.moves:
                arm[component] += columns[column]
        if link.parent_back is not None:
            arm = multiply_matrices(link.parent_back[:, :, None], arm[:, None])[:, 0]
        if link.parent >= 0:
            arm = self.apply_lengths(self.links[link.parent], arm, columns)
        return arm

    def apply_lengths(self, link: Link, vector: Floats, columns: Floats) -> Floats:
        """``vector`` from the joint's origin, lengthened by the joint's own length channels."""
        if not link.lengths or link.direction is None:
            return vector
        longer: Floats = link.direction[:, None] * columns[list(link.lengths)].sum(axis=0)
        return vector + longer

    def apply_scales(self, link: Link, vector: Floats, columns: Floats) -> Floats:
        """``vector`` along the joint's local axes, scaled by the joint's own scale channels."""
        if not link.scales:
            return vector
        scales = np.ones((3, columns.shape[1]))
        for component, column in link.scales:
            scales[component] = columns[column]
        return vector * scales

    def tail(self, joint: int, k: int, columns: Floats, pose: Pose) -> Floats:
        """The position of a tail of ``joint`` in the world, (3, F) or (3, 1)."""
        link = self.links[joint]
        vector = self.apply_lengths(link, link.tails[k][:, None], columns)
        return pose.origins[joint] + to_world(
            pose.axes[joint], self.apply_scales(link, vector, columns)
        )

    @staticmethod
    def _quaternion(axes: Floats, parts: Floats, spins: list[Floats]) -> Floats:
        """Turn ``axes`` by quaternions, (4, F), of any length but 0.

        Appends to ``spins`` the rotation axis in the world for a change of each part.
        """
        square = (parts * parts).sum(axis=0)
        w, x, y, z = parts
        # 2 Im(e conj(q)) / |q|^2 is the rotation vector of a change of q along e, before q.
        two = 2.0 / square
        changes = ((-x, -y, -z), (w, z, -y), (-z, w, x), (y, -x, w))
        spins += [to_world(axes, np.stack(vector) * two) for vector in changes]
        return multiply_matrices(axes, matrices_of_quaternions(parts))


IDENTITY: Floats = np.eye(3)[:, :, None]


class SkeletonKey:
    """A skeleton as a key by identity, since comparing thousands of joints takes long."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton

    def __hash__(self) -> int:
        return id(self.skeleton)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SkeletonKey) and other.skeleton is self.skeleton


def chain_of(skeleton: Skeleton) -> Chain:
    """``Chain(skeleton)``, prepared once for repeated calls."""
    return _chain_of(SkeletonKey(skeleton))


@lru_cache(maxsize=4)
def _chain_of(key: SkeletonKey) -> Chain:
    return Chain(key.skeleton)


def _components(
    kinds: list[str], names: tuple[str, ...], start: int
) -> tuple[tuple[int, int], ...]:
    return tuple((names.index(kind), start + k) for k, kind in enumerate(kinds) if kind in names)


def _to_local(back: Floats | None, vector: Floats) -> Floats:
    return vector if back is None else back @ vector


def orientation(joint: Joint, radians: float) -> Floats | None:
    """C, the matrix of the joint's ``axis``, shape (3, 3); None for the identity."""
    if not any(joint.axis):
        return None
    matrix = IDENTITY
    for letter in reversed(joint.axis_order):  # about fixed axes: the last is outermost
        k = "XYZ".index(letter)
        matrix = rotate_axes(matrix, k, np.array([joint.axis[k] * radians]))
    return matrix[:, :, 0]


def multiply_matrices(left: Floats, right: Floats) -> Floats:
    """The products of matrices, (3, 3, F or 1) by (3, n, F or 1)."""
    return (
        left[:, 0, None] * right[None, 0]
        + left[:, 1, None] * right[None, 1]
        + left[:, 2, None] * right[None, 2]
    )


def to_world(axes: Floats, vector: Floats) -> Floats:
    """The vector whose components along ``axes``, (3, 3, F), are ``vector``, (3, F or 1)."""
    result: Floats = axes[:, 0] * vector[0] + axes[:, 1] * vector[1] + axes[:, 2] * vector[2]
    return result
