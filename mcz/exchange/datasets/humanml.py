"""HumanML3D's 263 features of a frame, from the positions of 22 joints, and back.

C. Guo et al. 2022, "Generating Diverse and Natural 3D Human Motions from Text", as published with
the data set (``motion_representation``). Columns, of a frame and the next one:

    0          turn of the root about y, half the angle in radians
    1:3        velocity of the root along x and z, by the heading of the next frame
    3          height of the root
    4:67       positions of the joints but the root: root at x = z = 0, facing z
    67:193     rotations of the joints but the root, two columns of the matrix (6D)
    193:259    velocities of all joints, by the heading
    259:263    1 if it stands: left ankle, left foot, right ankle, right foot

Velocities are meters a frame. The heading is smoothed; of the first frame it is 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mcz.errors import MotionError, OptionError
from mcz.model.checks import NUMBERS, check_arguments
from mcz.model.types import Floats

_NAMES = """
    pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3
    left_foot right_foot neck left_collar right_collar head left_shoulder right_shoulder
    left_elbow right_elbow left_wrist right_wrist
"""
JOINTS = tuple(_NAMES.split())
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
CHAIN_STARTS = (1, 2, 3, 13, 14)  # turned from the root, the collars too
# Directions of the bones in the rest pose, a joint each: an axis, negative if it is a capital.
BONES = "-xXyYYyYYyzzyxXzYYYYYY"
LEFT_FOOT, RIGHT_FOOT = [7, 10], [8, 11]
# Hips and shoulders, each from the second to the first. For the smoothed heading the published
# program takes the hips from right to left, and so do the published data.
ACROSS = ((2, 1), (17, 16))
ACROSS_SMOOTH = ((1, 2), (17, 16))
N_FEATURES = 263
SIGMA, RADIUS = 20, 80  # frames of the Gaussian that smooths the heading
Y = np.array([0.0, 1.0, 0.0])


@check_arguments(positions=NUMBERS)
def humanml3d(
    positions: ArrayLike, *, bone_lengths: ArrayLike | None = None, threshold: float = 0.002
) -> Floats:
    """HumanML3D's features of joint positions, float64 (n_frames - 1, 263).

    ``positions`` (n_frames, 22, 3), in meters, y up, at 20 frames a second: of SMPL's joints in
    their order, ``pelvis`` to ``right_wrist``. ``bone_lengths`` (22,), of each joint from its
    parent, makes the body that size first, as HumanML3D does with the body of its clip 000021; the
    root moves by the ratio of the legs. A foot stands if it moves less than the root of
    ``threshold`` in meters, from a frame to the next. If a position is NaN, so is what depends
    on it. Raises MotionError for another shape, and OptionError for other lengths.
    """
    places = _check_positions(positions)
    with np.errstate(all="ignore"):  # positions that coincide, or overflow, have NaN
        if bone_lengths is not None:
            places = _with_lengths(places, np.asarray(bone_lengths, np.float64))
        return _features(places, threshold)


@check_arguments(features=NUMBERS)
def humanml3d_positions(features: ArrayLike) -> Floats:
    """Joint positions (n_frames, 22, 3) from features: the inverse of ``humanml3d``.

    The first frame faces z above the origin. Raises MotionError for another shape.
    """
    rows = np.asarray(features, np.float64)
    if rows.ndim != 2 or rows.shape[1] != N_FEATURES:
        raise MotionError(
            f"features have shape {rows.shape}; expected {N_FEATURES} numbers a frame"
        )
    headings = np.zeros(len(rows))
    headings[1:] = 2 * np.cumsum(rows[:-1, 0])
    roots = np.zeros((len(rows), 3))
    roots[1:, [0, 2]] = rows[:-1, 1:3]
    roots = np.cumsum(_turn(roots, -headings), axis=0)
    joints = np.concatenate([np.zeros((len(rows), 1, 3)), rows[:, 4:67].reshape(-1, 21, 3)], axis=1)
    places = _turn(joints, -headings) + roots[:, None]
    places[:, 0, 1] = rows[:, 3]
    return places


def _check_positions(positions: ArrayLike) -> Floats:
    places = np.array(positions, np.float64)
    if places.ndim != 3 or places.shape[1:] != (len(JOINTS), 3) or len(places) < 2:
        raise MotionError(
            f"positions have shape {places.shape}; expected (at least 2 frames, {len(JOINTS)} "
            "joints, 3)"
        )
    return places


def _features(places: Floats, threshold: float) -> Floats:
    places[..., 1] -= places[..., 1].min(initial=np.inf)
    places -= places[0, 0] * (1, 0, 1)
    places = _turn(places, _headings(_forward(places[:1], ACROSS)))
    headings = _headings(_smooth(_forward(places, ACROSS_SMOOTH)))
    headings[0] = 0.0

    moves = np.diff(places, axis=0)
    stands = (moves**2).sum(axis=-1) < threshold
    local = places - places[:, :1] * (1, 0, 1)
    parts = [
        np.arcsin(np.sin(np.diff(headings)[:, None] / 2)),  # as published: past -z its sign is lost
        _turn(moves[:, 0], headings[1:])[:, [0, 2]],
        places[:-1, 0, 1:2],
        _turn(local, headings)[:-1, 1:],
        _rotations(places, headings)[:-1],
        _turn(moves, headings[:-1]),
        stands[:, LEFT_FOOT + RIGHT_FOOT],
    ]
    return np.concatenate([part.reshape(len(moves), -1) for part in parts], axis=1)


def _forward(places: Floats, pairs: Sequence[tuple[int, int]]) -> Floats:
    """Direction in which the body faces, (n_frames, 3), horizontal, at most of length 1."""
    across = np.sum([places[:, first] - places[:, second] for first, second in pairs], axis=0)
    forward: Floats = np.cross(Y, across / np.linalg.norm(across, axis=-1, keepdims=True))
    return forward


def _headings(forward: Floats) -> Floats:
    """Angles about y that turn these directions to z, in radians."""
    return np.arctan2(-forward[:, 0], forward[:, 2])


def _smooth(rows: Floats) -> Floats:
    """Rows (n, 3) convolved with a Gaussian; the first and last row go on beyond the ends."""
    weights = np.exp(-0.5 * (np.arange(-RADIUS, RADIUS + 1) / SIGMA) ** 2)
    weights /= weights.sum()
    padded = np.pad(rows, ((RADIUS, RADIUS), (0, 0)), "edge")
    return np.stack([np.convolve(column, weights, "valid") for column in padded.T], axis=1)


def _turn(vectors: Floats, angles: Floats) -> Floats:
    """Vectors (n, ..., 3) turned about y by an angle each frame, (n,)."""
    angles = angles.reshape(-1, *[1] * (vectors.ndim - 2))
    x, y, z = np.moveaxis(vectors, -1, 0)
    cos, sin = np.cos(angles), np.sin(angles)
    return np.stack([x * cos + z * sin, y, z * cos - x * sin], axis=-1)


def _rotations(places: Floats, headings: Floats) -> Floats:
    """Rotations from each joint's bone to the next, (n_frames, 21, 6).

    A bone's rotation turns its direction in the rest pose the shortest way to the one that it has;
    the first bone of a chain is relative to the heading.
    """
    root = np.stack([_turn(np.tile(axis, (len(places), 1)), headings) for axis in np.eye(3)], -1)
    bones: list[Floats] = [root]
    for joint in range(1, len(JOINTS)):
        bone = places[:, joint] - places[:, PARENTS[joint]]
        bone /= np.linalg.norm(bone, axis=-1, keepdims=True)
        bones.append(_shortest_turn(_rest_direction(joint), bone))
    local = [
        np.swapaxes(root if joint in CHAIN_STARTS else bones[PARENTS[joint]], 1, 2) @ bones[joint]
        for joint in range(1, len(JOINTS))
    ]
    matrices = np.stack(local, axis=1)
    return np.concatenate([matrices[..., 0], matrices[..., 1]], axis=-1)


def _rest_direction(joint: int) -> Floats:
    direction = np.zeros(3)
    direction["xyz".index(BONES[joint].lower())] = -1.0 if BONES[joint].isupper() else 1.0
    return direction


def _shortest_turn(start: Floats, ends: Floats) -> Floats:
    """Matrices (n, 3, 3) that turn ``start`` (3,) to ``ends`` (n, 3), all of length 1."""
    cos = ends @ start
    opposite = cos < -1 + 1e-12  # any half turn; across ``start``, an axis
    scale = np.where(opposite, 0.0, 1 / (1 + np.where(opposite, 0.0, cos)))
    x, y, z = np.cross(start, ends).T
    zero = np.zeros_like(x)
    spin = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    turns: Floats = np.eye(3) + spin + spin @ spin * scale[:, None, None]
    axis = np.roll(start, 1)
    turns[opposite] = 2 * np.outer(axis, axis) - np.eye(3)
    return turns


def _with_lengths(places: Floats, lengths: Floats) -> Floats:
    """Positions with bones of these lengths, in their directions."""
    if lengths.shape != (len(JOINTS),) or not (lengths[1:] > 0).all():
        raise OptionError(
            f"bone_lengths must be {len(JOINTS)} lengths, all above 0 except that of the root"
        )
    bones = places - places[:, [max(0, parent) for parent in PARENTS]]
    own_lengths = np.linalg.norm(bones, axis=-1, keepdims=True)
    leg = [5, 8]
    out: Floats = places * (lengths[leg].sum() / own_lengths[0, leg].sum())
    for joint in range(1, len(JOINTS)):
        direction = bones[:, joint] / own_lengths[:, joint]
        out[:, joint] = out[:, PARENTS[joint]] + direction * lengths[joint]
    return out
