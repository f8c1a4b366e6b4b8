"""Skeleton as flat arrays for the pose metric, built once per clip.

SPEC.md, "Pose metric", is normative, from the fields of SKEL on: decoded values depend on every bit
of a plan, so all here is binary64 + - * / in the stated order, without NumPy's products.

Of a joint, B = W C are its local axes as columns, as in ``kinematics/chain.py``. What is fastened
to a joint is known along B: its mass, first moment and inertia never change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.orders import CODED
from mcz.codecs.posewave.trigonometry import BEYOND, RULES, VECTOR, Rule, sine_cosine
from mcz.kernels.types import Floats, Floats2, Floats3, Ints, Ints2
from mcz.kinematics.points import points_of
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

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]  # rows
Turn = tuple[int, int, int]  # axis, column, number among the kept

MAX_PATH = 96  # channels from the first of a block down to a channel, itself included
LEAST_REGULARIZATION, GREATEST_REGULARIZATION = 2.0**-100, 2.0**100
PLAIN = -1
QUATERNION = 3  # as an axis of turns, like VECTOR
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
N_INERTIA = 10  # mass, first moment x y z, inertia xx yy zz xy xz yz


class Plan(NamedTuple):
    """A skeleton and its kept channels, as the kernels want them.

    Of joints: ``parents`` (n_joints,), -1 for a root; ``changes`` (n_joints, 3, 3), from the
    parent's B to the joint's own before it turns; ``arms`` (n_joints, 3), from the parent's origin
    along the parent's B, 0 for a root; ``masses`` (n_joints, 10), what is fastened to the joint,
    along its B and about its origin.
    Of position channels, in joint order: ``moves`` (n_moves, 2), column and number among the kept
    or -1; ``directions`` (n_moves, 3) along the parent's B; ``move_starts`` (n_joints + 1,).
    Of rotation channels, in joint order and within a joint as they are multiplied from the left:
    ``turns`` (n_turns, 3), axis, column and number among the kept or -1; ``turn_starts``. A
    quaternion has four of them, of the axis QUATERNION, a rotation vector three, of VECTOR.
    Of kept channels: ``joints`` (n_kept,), -1 for a plain one; ``starts`` (n_kept + 1,), its row in
    ``path`` (n_entries,): the channels from the first of its block down to itself, as numbers among
    the kept; ``regularization`` (n_kept,). ``spread`` stiffens each turn by what its joint moves.
    ``n_channels`` are those of the skeleton.
    """

    parents: Ints
    changes: Floats3
    arms: Floats2
    masses: Floats2
    moves: Ints2
    directions: Floats2
    move_starts: Ints
    turns: Ints2
    turn_starts: Ints
    joints: Ints
    starts: Ints
    path: Ints
    regularization: Floats
    spread: float
    rule: Rule
    n_channels: int

    @property
    def n_kept(self) -> int:
        return len(self.joints)

    @property
    def n_entries(self) -> int:
        """Numbers of a factor."""
        return len(self.path)


def make_plan(
    skeleton: Skeleton,
    kept: NDArray[np.bool_],
    regularization: Floats,
    *,
    radius: float,
    kappa: float = 0.5,
    joint_weights: Floats | None = None,
    orders: Mapping[int, int] | None = None,
    whole: bool = False,
) -> Plan:
    """The plan of ``skeleton`` for the channels where ``kept``, bool (n_channels,), is true.

    ``regularization`` (n_kept,) is added to the diagonal; of a plain channel it is the diagonal.
    ``radius`` of the shell is in length units, ``kappa`` the shell's part of the whole,
    ``joint_weights`` (n_joints,) multiply what a joint has of both. ``orders`` are codes
    of axis orders by joint. ``whole``: quaternions and rotation vectors turn.

    All but positions and what turns are plain. The pose takes scales as 1 and lengths as 0. All
    channels are plain where angles have no known unit. What is 2^40 or more, or not finite, among
    offsets, tails, axes and weights counts as 0, and so do the values of a pose: the metric then is
    that of another pose, but there always is one.
    """
    if len(kept) != skeleton.n_channels or len(regularization) != np.count_nonzero(kept):
        raise ValueError(f"{len(regularization)} of {len(kept)} channels are kept")
    n_joints = skeleton.n_joints
    weights = (
        [1.0] * n_joints
        if joint_weights is None
        else [limit_number(float(w)) for w in joint_weights]
    )
    numbers = np.where(kept, np.cumsum(kept) - 1, -1).tolist()  # among the kept, -1 where dropped
    rule = RULES[skeleton.angle_unit]
    frames = [orientation(joint, rule) for joint in skeleton.joints]
    moves, move_starts, directions = _moves(skeleton, frames, numbers)
    turns, turn_starts = _turns(skeleton, numbers, orders or {}, whole)
    turning = {column for _, column, _ in turns}
    if has_kinematics(skeleton, whole):
        turning |= {column for column, _ in moves}
    joints, starts, path = _rows(skeleton, numbers, int(np.count_nonzero(kept)), turning)
    return Plan(
        parents=skeleton.parents,
        changes=_floats(map(_change, _parent_axes(skeleton, frames), frames), 3, 3),
        arms=_floats(map(_arm, skeleton.joints, _parent_axes(skeleton, frames)), 3),
        masses=_masses(skeleton, frames, weights, limit_number(float(radius)), float(kappa)),
        moves=_ints(moves, 2),
        directions=_floats(directions, 3),
        move_starts=_ints(move_starts),
        turns=_ints(turns, 3),
        turn_starts=_ints(turn_starts),
        joints=_ints(joints),
        starts=_ints(starts),
        path=_ints(path),
        regularization=bounded_regularization(regularization),
        spread=0.0,
        rule=rule,
        n_channels=skeleton.n_channels,
    )


def bounded_regularization(diagonal: Floats) -> Floats:
    """Regularization within the range that factors can take."""
    return np.clip(diagonal, LEAST_REGULARIZATION, GREATEST_REGULARIZATION)


def limit_number(value: float) -> float:
    """``value``, or 0 where its magnitude is 2^40 or more."""
    return value if abs(value) < BEYOND else 0.0


def has_kinematics(skeleton: Skeleton, whole: bool = False) -> bool:
    """Return True if the angle unit is known; otherwise all channels are plain."""
    kinds = ANGLE_KINDS if whole else ROTATION_KINDS
    turning = any(c.kind in kinds for c in skeleton.channels)
    return bool(skeleton.angle_unit) or not (turning or any(any(j.axis) for j in skeleton.joints))


def orientation(joint: Joint, rule: Rule) -> Matrix:
    """C, the matrix of the joint's ``axis``."""
    matrix = IDENTITY
    for letter in reversed(joint.axis_order):  # about fixed axes: the last is outermost
        axis = "XYZ".index(letter)
        sine, cosine = sine_cosine(joint.axis[axis], rule)
        matrix = _rotate_matrix(matrix, axis, sine, cosine)
    return matrix


def _rotate_matrix(matrix: Matrix, axis: int, sine: float, cosine: float) -> Matrix:
    j, k = (axis + 1) % 3, (axis + 2) % 3
    rows = [list(row) for row in matrix]
    for row in rows:
        one, other = row[j], row[k]
        row[j], row[k] = one * cosine + other * sine, other * cosine - one * sine
    return _matrix(rows)


def _matrix(rows: Sequence[Sequence[float]]) -> Matrix:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, b, c), (d, e, f), (g, h, i)


def _multiply_transposed(matrix: Matrix, vector: Sequence[float]) -> Vector:
    """The transpose of ``matrix`` times ``vector``: along the axes that are its columns."""
    a, b, c = (
        matrix[0][k] * vector[0] + matrix[1][k] * vector[1] + matrix[2][k] * vector[2]
        for k in range(3)
    )
    return a, b, c


def _parent_axes(skeleton: Skeleton, frames: list[Matrix]) -> list[Matrix]:
    """C of the parent of every joint, the identity above a root."""
    return [frames[j.parent] if j.parent >= 0 else IDENTITY for j in skeleton.joints]


def _change(above: Matrix, frame: Matrix) -> Matrix:
    columns = [
        _multiply_transposed(above, (frame[0][k], frame[1][k], frame[2][k])) for k in range(3)
    ]
    return _matrix([[column[i] for column in columns] for i in range(3)])


def _arm(joint: Joint, above: Matrix) -> Vector:
    """Constant part of the offset from the parent's origin, along the parent's B."""
    if joint.parent < 0:  # where a root is does not matter
        return 0.0, 0.0, 0.0
    replaced = set() if joint.adds_to_offset else {channel.kind for channel in joint.channels}
    pairs = zip(POSITION_KINDS, joint.offset, strict=True)
    return _multiply_transposed(
        above, [0.0 if kind in replaced else limit_number(x) for kind, x in pairs]
    )


def _moves(
    skeleton: Skeleton, frames: list[Matrix], numbers: list[int]
) -> tuple[list[tuple[int, int]], list[int], list[Vector]]:
    moves: list[tuple[int, int]] = []
    directions: list[Vector] = []
    starts, column = [0], 0
    for joint, above in zip(skeleton.joints, _parent_axes(skeleton, frames), strict=True):
        for channel in joint.channels:
            if channel.kind in POSITION_KINDS:
                moves.append((column, numbers[column]))
                directions.append(above[POSITION_KINDS.index(channel.kind)])
            column += 1
        starts.append(len(moves))
    return moves, starts, directions


def _turns(
    skeleton: Skeleton, numbers: list[int], orders: Mapping[int, int], whole: bool
) -> tuple[list[Turn], list[int]]:
    if not has_kinematics(skeleton, whole):
        return [], [0] * (skeleton.n_joints + 1)
    turns: list[Turn] = []
    starts, column = [0], 0
    for index, joint in enumerate(skeleton.joints):
        own = [
            (ROTATION_KINDS.index(channel.kind), column + k, numbers[column + k])
            for k, channel in enumerate(joint.channels)
            if channel.kind in ROTATION_KINDS
        ]
        if index in orders:
            by_axis = {turn[0]: turn for turn in own}
            coded = CODED[orders[index] - 1]
            if coded[0] == VECTOR:
                turns += [(VECTOR, *by_axis[part][1:]) for part in range(3)]
            else:
                turns += [by_axis[axis] for axis in coded]
        else:
            parts = [[turn] for turn in own] + (_whole(joint, column, numbers) if whole else [])
            parts.sort(key=lambda part: min(column for _, column, _ in part))
            turns += [turn for part in parts[:: 1 if skeleton.intrinsic else -1] for turn in part]
        column += len(joint.channels)
        starts.append(len(turns))
    return turns, starts


def _whole(joint: Joint, start: int, numbers: list[int]) -> list[list[Turn]]:
    """The quaternion and the rotation vector of a joint, where it has them."""
    columns = (
        [(axis, column, numbers[column]) for column in first_columns(joint.channels, kinds, start)]
        for axis, kinds in ((QUATERNION, QUATERNION_KINDS), (VECTOR, VECTOR_KINDS))
    )
    return [part for part in columns if part]


def _rows(
    skeleton: Skeleton, numbers: list[int], n_kept: int, turning: set[int]
) -> tuple[list[int], list[int], list[int]]:
    """The joint of each kept channel, where its row starts, and the rows."""
    joints = [PLAIN] * n_kept
    rows: list[list[int]] = [[kept] for kept in range(n_kept)]
    paths: list[list[int]] = []
    column = 0
    for index, joint in enumerate(skeleton.joints):
        path = paths[joint.parent] if joint.parent >= 0 else []
        columns = range(column, column + len(joint.channels))
        own = [numbers[c] for c in columns if numbers[c] >= 0 and c in turning]
        if len(path) + len(own) > MAX_PATH:  # POSE-02
            path = []
        for number in own:
            path = [number] if len(path) == MAX_PATH else [*path, number]
            joints[number], rows[number] = index, path
        paths.append(path)
        column += len(joint.channels)
    starts = np.cumsum([0, *map(len, rows)]).tolist()
    return joints, starts, [number for row in rows for number in row]


def _masses(
    skeleton: Skeleton, frames: list[Matrix], weights: list[float], radius: float, kappa: float
) -> Floats:
    """Points and shell of every joint as mass, first moment and inertia, (n_joints, 10)."""
    points = points_of(skeleton)
    n_points, n_joints = sum(map(len, points)), skeleton.n_joints
    result = np.zeros((n_joints, N_INERTIA))
    for index, (joint, frame) in enumerate(zip(skeleton.joints, frames, strict=True)):
        own = [0.0] * N_INERTIA
        for tail in points[index]:
            place = (0.0, 0.0, 0.0)
            if tail >= 0:
                x, y, z = joint.tails[tail]
                place = _multiply_transposed(
                    frame, (limit_number(x), limit_number(y), limit_number(z))
                )
            _add_point(own, (1.0 - kappa) / n_points * weights[index], place)
        _add_shell(own, kappa / (3.0 * n_joints) * weights[index], radius, frame)
        result[index] = own
    return result


def _add_point(own: list[float], weight: float, place: Vector) -> None:
    x, y, z = place
    added = (
        *(weight, weight * x, weight * y, weight * z),
        *(weight * (y * y + z * z), weight * (x * x + z * z), weight * (x * x + y * y)),
        *(-(weight * (x * y)), -(weight * (x * z)), -(weight * (y * z))),
    )
    own[:] = [one + other for one, other in zip(own, added, strict=True)]


def _add_shell(own: list[float], weight: float, radius: float, frame: Matrix) -> None:
    """Three points at ``radius`` along the axes of W, each of ``weight``."""
    own[0] += 3.0 * weight
    for k, middle in enumerate(_multiply_transposed(frame, (1.0, 1.0, 1.0))):
        own[1 + k] += weight * radius * middle
        own[4 + k] += 2.0 * (weight * (radius * radius))


def _floats(rows: object, *axes: int) -> Floats:
    return np.array(list(rows), np.float64).reshape(-1, *axes)  # type: ignore[call-overload]


def _ints(rows: object, *axes: int) -> Ints:
    return np.array(rows, np.int64).reshape(-1, *axes)
