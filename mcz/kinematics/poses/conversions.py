"""Rotation matrices to other representations and back, with the conventions of SciPy.

Matrices are (..., 3, 3), active, for column vectors. NaN stays NaN. Quaternions among plain scalars
are also detected here: four columns of unit norm, which splines would shrink.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import DTypeLike

from mcz.errors import OptionError
from mcz.kinematics.frames import (
    MOTION_OR_CLIP,
    Frames,
    MotionLike,
    as_type,
    frame_poses_of,
    frame_range,
    joint_numbers,
    values_of,
)
from mcz.kinematics.rotations import (
    matrices_of_vectors,
    quaternions_of_matrices,
    vectors_of_quaternions,
)
from mcz.model.checks import FRAMES, check_arguments
from mcz.model.motion import Channel, Skeleton
from mcz.model.skeleton import Joints
from mcz.model.text_format import quote_name
from mcz.model.types import Floats, Reals

# Dimensions that each representation adds to an array of rotations.
FORMS = {"matrix": (3, 3), "quat": (4,), "rotvec": (3,), "6d": (6,), "euler": (3,)}

LOCKED = 1e-7  # radians from gimbal lock within which the third Euler angle is 0


def check_form(form: str) -> None:
    """Raise OptionError unless ``form`` is a representation."""
    if form not in FORMS:
        raise OptionError(f"unknown rotations {form!r}; they must be one of {', '.join(FORMS)}")


def check_order(order: str) -> None:
    """Raise OptionError unless ``order`` is an order of Euler angles: three axes, XYZ or xyz."""
    letters = order.lower()
    same_case = order in (letters, order.upper())
    is_alternating = len(order) == 3 and letters[0] != letters[1] != letters[2]
    if not (same_case and is_alternating and set(letters) <= set("xyz")):
        raise OptionError(
            f"Euler order is {order!r}; it must be three axes, such as ZXY (intrinsic) or zxy "
            "(extrinsic)"
        )


def from_matrices(matrices: Floats, form: str, order: str = "XYZ") -> Floats:
    """Matrices (n_frames, n, 3, 3) as ``form``, a key of ``FORMS``.

    Quaternions have w first and keep their sign from frame to frame: w >= 0 in the first frame and
    after a break in time. "6d" is the first column, then the second. Rotation vectors and Euler
    angles are in radians.
    """
    if form == "matrix":
        return matrices
    if form == "6d":
        return np.concatenate([matrices[..., 0], matrices[..., 1]], axis=-1)
    flat = matrices.reshape(-1, 3, 3)
    known = np.isfinite(flat).all(axis=(1, 2))
    out = np.full((len(flat), *FORMS[form]), np.nan)
    if known.any():
        out[known] = _convert_finite(flat if known.all() else flat[known], form, order)
    shaped = out.reshape(*matrices.shape[:-2], *FORMS[form])
    return continuous_signs(shaped) if form == "quat" else shaped


def _convert_finite(matrices: Floats, form: str, order: str) -> Floats:
    """Finite matrices (n, 3, 3) as quaternions, rotation vectors or Euler angles."""
    quaternions = quaternions_of_matrices(np.moveaxis(matrices, 0, 2))
    if form == "quat":
        return quaternions.T
    if form == "rotvec":
        return vectors_of_quaternions(quaternions).T
    return _euler_angles(quaternions, order)


def _euler_angles(quaternions: Floats, order: str) -> Floats:
    """Euler angles, (n, 3), of quaternions of length 1, (4, n), first to last of ``order``.

    E. Bernardes and S. Viollet 2022, "Quaternion to Euler angles conversion: A direct, general and
    computationally efficient method". The second angle is in [0, pi] if the first axis is also
    the last, else in [-pi/2, pi/2]; the others are in [-pi, pi]. In gimbal lock the third is 0.
    """
    turning = order.isupper()  # intrinsic: extrinsic in reverse order
    i, j, k = ("xyz".index(letter) for letter in (order.lower()[::-1] if turning else order))
    proper = i == k
    k = 3 - i - j if proper else k
    sign = (i - j) * (j - k) * (k - i) // 2
    w, x, y, z = quaternions[0], *(quaternions[1 + axis] for axis in (i, j, k))
    a, b, c, d = (w, x, y, sign * z) if proper else (w - y, x + sign * z, y + w, sign * z - x)
    half_sum, half_difference = np.arctan2(b, a), np.arctan2(d, c)
    second = 2 * np.arctan2(np.hypot(c, d), np.hypot(a, b))
    ends = [half_sum - half_difference, half_sum + half_difference]
    low, high = second <= LOCKED, np.pi - second <= LOCKED
    first, third = (1, 0) if turning else (0, 1)
    ends[first][low] = 2 * half_sum[low]
    ends[first][high] = (2 if turning else -2) * half_difference[high]
    ends[third][low | high] = 0.0
    if not proper:
        ends[1] *= sign
        second -= np.pi / 2
    for angles in ends:
        angles -= 2 * np.pi * np.rint(angles / (2 * np.pi))
    return np.stack([ends[first], second, ends[third]], axis=1)


def continuous_signs(quaternions: Floats) -> Floats:
    """Quaternions (n_frames, n, 4), w first, with the signs that keep neighbors near each other.

    w >= 0 in the first frame and after each break in time.
    """
    if not len(quaternions):
        return quaternions
    steps = np.ones(quaternions.shape[:-1])
    dots = np.einsum("fnk,fnk->fn", quaternions[1:], quaternions[:-1])
    steps[1:][dots < 0] = -1.0
    signs = np.cumprod(steps, axis=0)
    fresh = np.concatenate([np.ones((1, *dots.shape[1:]), np.bool_), np.isnan(dots)])
    fresh &= ~np.isnan(quaternions[..., 0])
    wrong = fresh & (signs * quaternions[..., 0] < 0)
    right = fresh & ~wrong
    # The sign of each fresh start holds up to the next one.
    frames = np.arange(len(signs))[:, None]
    last_wrong = np.maximum.accumulate(np.where(wrong, frames, -1), axis=0)
    last_right = np.maximum.accumulate(np.where(right, frames, -1), axis=0)
    signs[last_wrong > last_right] *= -1.0
    return quaternions * signs[..., None]


def slerp(first: Floats, second: Floats, share: Floats) -> Floats:
    """Matrices (n, 3, 3) at a ``share``, (n,), of the shortest way from ``first`` to ``second``."""
    out = np.full(first.shape, np.nan)
    known = np.isfinite(first).all(axis=(1, 2)) & np.isfinite(second).all(axis=(1, 2))
    if known.any():
        start = first[known]
        turn = np.swapaxes(start, 1, 2) @ second[known]
        vectors = vectors_of_quaternions(quaternions_of_matrices(np.moveaxis(turn, 0, 2)))
        part = np.moveaxis(matrices_of_vectors(vectors * share[known]), 2, 0)
        out[known] = start @ part
    return out


SPACES = ("local", "world")


@check_arguments(motion=MOTION_OR_CLIP, frames=FRAMES)
def rotations(
    motion: MotionLike,
    form: str = "quat",
    *,
    space: str = "local",
    joints: Joints = None,
    frames: Frames = None,
    order: str = "XYZ",
    degrees: bool = False,
    dtype: DTypeLike = np.float64,
) -> Reals:
    """Rotations of the joints of a Motion or Clip, (n_frames, n_joints, ...).

    ``form``: "quat" (..., 4), w first, unit length, signs continuous; "matrix" (..., 3, 3);
    "rotvec" (..., 3), axis times angle; "6d" (..., 6), the first column of the matrix, then the
    second; "euler" (..., 3), about the axes of ``order``: "ZXY" about axes that turn along, in this
    order, "zxy" about fixed ones. Angles in radians, or ``degrees``.
    ``space``: "local", from the parent (of a root: from the world), or "world". In the rest pose
    both are the identity, whatever the skeleton's own axes are: what bones do, not how a file
    writes it. ``joints`` by index or name, None: all; ``frames`` (a, b) or a slice.

    Rotations are active, for column vectors: a bone that points along d in the rest pose points
    along W d. NaN if a channel that matters is invalid. Raises OptionError, and MotionError
    if the skeleton has no kinematics.
    """
    check_form(form)
    check_order(order)
    if space not in SPACES:
        raise OptionError(f"unknown space {space!r}; it must be one of {', '.join(SPACES)}")
    skeleton, span = motion.skeleton, frame_range(motion, frames)
    chosen = joint_numbers(skeleton, joints)
    poses = frame_poses_of(skeleton)
    needed = chosen if space == "local" else poses.above(chosen)
    values = values_of(motion, span, needed)
    turns = poses.local(values, chosen) if space == "local" else poses.world(values, chosen)
    converted = from_matrices(turns, form, order)
    if degrees:
        if form not in ("euler", "rotvec"):
            raise OptionError(f"degrees has no meaning for rotations as {form!r}")
        converted = np.degrees(converted)
    return as_type(converted, dtype)


Quaternion = tuple[int, ...]  # four columns

UNIT = 2e-3  # greatest deviation of a norm from 1, for numbers with three decimals
SIZE = 4
_NAMED = re.compile(r"(?i)quat|(^|[^a-z])q(_?[wxyz0-3])?($|[^a-z0-9])")
HINT = "; components=True interpolates each column by itself"


def scalar_quaternions(
    skeleton: Skeleton | None, own: Sequence[Channel] | None, values: Floats
) -> list[Quaternion]:
    """The columns of quaternions: four plain scalars side by side whose norm is 1 in all rows.

    Raises OptionError if these overlap and names do not decide between them, and if columns
    with the names of a quaternion have another norm.
    """
    names = _plain_names(skeleton, own)
    places = [at for at in range(len(names) - SIZE + 1) if None not in names[at : at + SIZE]]
    units = {at: _is_unit(values[:, at : at + SIZE]) for at in places}
    starts = [at for at in places if units[at]]
    firsts = {at for at in places if all(map(_is_named, names[at : at + SIZE]))}
    for at in sorted(firsts):
        inside = any(other in starts for other in range(at - SIZE + 1, at + SIZE))
        if units[at] is False and not inside:
            raise OptionError(
                f"{_describe_columns(names, at)} are named like a quaternion, but their norm "
                f"is not 1{HINT}"
            )
    accepted: list[int] = []
    for at in starts:
        rivals = [other for other in starts if other != at and abs(other - at) < SIZE]
        if not rivals or (at in firsts and firsts.isdisjoint(rivals)):
            accepted.append(at)
        elif firsts.isdisjoint([at, *rivals]):
            raise OptionError(
                f"{_describe_columns(names, at)} may be a quaternion or independent columns{HINT}"
            )
    return [tuple(range(at, at + SIZE)) for at in accepted]


def _plain_names(skeleton: Skeleton | None, own: Sequence[Channel] | None) -> list[str | None]:
    if own is not None:
        return [channel.label for channel in own]
    joints = () if skeleton is None else skeleton.joints
    return [
        None if channel.kind else f"{joint.name} {channel.label}"
        for joint in joints
        for channel in joint.channels
    ]


def _is_unit(four: Floats) -> bool | None:
    """Return whether all known norms are 1; None if none is known or all rows are equal."""
    norms = np.sqrt((four * four).sum(axis=1))
    known = norms[~np.isnan(norms)]
    if not len(known) or (four == four[:1]).all():
        return None
    return bool((np.abs(known - 1) <= UNIT).all())


def _is_named(name: str | None) -> bool:
    return name is not None and _NAMED.search(name) is not None


def _describe_columns(names: Sequence[str | None], at: int) -> str:
    return f"columns {at + 1} to {at + SIZE} ({quote_name(str(names[at]))}, ...)"


def slerp_quaternions(first: Floats, last: Floats, share: Floats) -> Floats:
    """Quaternions (n, 4) at a ``share``, (n,), of the shortest way from the first to the last."""
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (first * last).sum(axis=1, keepdims=True)
        last = np.where(cosine < 0, -last, last)
        angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
        weight, near = share[:, None], angle < 1e-6
        start = np.where(near, 1 - weight, np.sin((1 - weight) * angle))
        mixed = start * first + np.where(near, weight, np.sin(weight * angle)) * last
        return np.asarray(mixed / np.sqrt((mixed * mixed).sum(axis=1, keepdims=True)))
