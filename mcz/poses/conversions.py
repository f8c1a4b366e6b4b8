"""Rotation matrices to other representations and back. SciPy does all but the plain ones.

Matrices are (..., 3, 3), active, for column vectors. What is NaN stays NaN.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.errors import OptionError
from mcz.kinematics.chain import Floats

# What each representation adds to the shape of an array of rotations.
FORMS = {"matrix": (3, 3), "quat": (4,), "rotvec": (3,), "6d": (6,), "euler": (3,)}


def check_form(form: str) -> None:
    """Raise OptionError where ``form`` is no representation."""
    if form not in FORMS:
        raise OptionError(f"rotations as {form!r}: one of {', '.join(FORMS)}")


def check_order(order: str) -> None:
    """Raise OptionError where ``order`` is no order of Euler angles: three axes, XYZ or xyz."""
    letters = order.lower()
    same_case = order in (letters, order.upper())
    apart = len(order) == 3 and letters[0] != letters[1] != letters[2]
    if not (same_case and apart and set(letters) <= set("xyz")):
        raise OptionError(
            f"Euler order {order!r}: three axes, such as ZXY (about axes that turn along) or zxy "
            "(about fixed axes)"
        )


def from_matrices(matrices: Floats, form: str, order: str = "XYZ") -> Floats:
    """Matrices (n_frames, n, 3, 3) as ``form``, a key of ``FORMS``.

    Quaternions have w first and keep their sign from frame to frame: of the first frame, and of
    one after a gap, w >= 0. "6d" is the first column, then the second. Rotation vectors and Euler
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
        out[known] = _scipy(flat if known.all() else flat[known], form, order)
    shaped = out.reshape(*matrices.shape[:-2], *FORMS[form])
    return continuous(shaped) if form == "quat" else shaped


def _scipy(matrices: Floats, form: str, order: str) -> Floats:
    from scipy.spatial.transform import Rotation

    turns: Any = Rotation.from_matrix(matrices)
    if form == "quat":
        return np.asarray(turns.as_quat(scalar_first=True))
    if form == "rotvec":
        return np.asarray(turns.as_rotvec())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # gimbal lock: one angle of many is as good
        return np.asarray(turns.as_euler(order))


def to_matrices(values: NDArray[Any], form: str, order: str = "XYZ") -> Floats:
    """The inverse of ``from_matrices``: (..., *FORMS[form]) to (..., 3, 3).

    Quaternions may have any length but 0; of 6D vectors the second is made orthogonal to the first.
    Raises OptionError where the shape does not fit.
    """
    check_form(form)
    values = np.asarray(values, np.float64)
    tail = FORMS[form]
    if values.shape[-len(tail) :] != tail:
        raise OptionError(f"rotations as {form!r} of shape {values.shape}: ends in {tail}")
    if form == "matrix":
        return values
    lead = values.shape[: -len(tail)]
    flat = values.reshape(-1, *tail)
    if form == "6d":
        return _from_6d(flat).reshape(*lead, 3, 3)
    known = np.isfinite(flat).all(axis=1)
    if form == "quat":
        known &= np.einsum("ij,ij->i", flat, flat) > 0
    out = np.full((len(flat), 3, 3), np.nan)
    if known.any():
        from scipy.spatial.transform import Rotation

        if form == "quat":
            turns: Any = Rotation.from_quat(flat[known], scalar_first=True)
        elif form == "rotvec":
            turns = Rotation.from_rotvec(flat[known])
        else:
            check_order(order)
            turns = Rotation.from_euler(order, flat[known])
        out[known] = turns.as_matrix()
    return out.reshape(*lead, 3, 3)


def _from_6d(flat: Floats) -> Floats:
    """Zhou et al. 2019, "On the Continuity of Rotation Representations", equation 15."""
    with np.errstate(invalid="ignore", divide="ignore"):
        first = flat[:, :3] / np.linalg.norm(flat[:, :3], axis=1, keepdims=True)
        second = flat[:, 3:] - (first * flat[:, 3:]).sum(axis=1, keepdims=True) * first
        second /= np.linalg.norm(second, axis=1, keepdims=True)
    return np.stack([first, second, np.cross(first, second)], axis=2)


def continuous(quaternions: Floats) -> Floats:
    """Quaternions (n_frames, n, 4), w first, with the signs that keep neighbours near each other.

    w >= 0 in the first frame and in each after a gap.
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
    # From each fresh start on, what its own sign asks for holds up to the next one.
    frames = np.arange(len(signs))[:, None]
    last_wrong = np.maximum.accumulate(np.where(wrong, frames, -1), axis=0)
    last_right = np.maximum.accumulate(np.where(right, frames, -1), axis=0)
    signs[last_wrong > last_right] *= -1.0
    return quaternions * signs[..., None]


def slerp(first: Floats, second: Floats, share: Floats) -> Floats:
    """Matrices (n, 3, 3) a ``share``, (n,), of the shortest way from ``first`` to ``second``."""
    from scipy.spatial.transform import Rotation

    out = np.full(first.shape, np.nan)
    known = np.isfinite(first).all(axis=(1, 2)) & np.isfinite(second).all(axis=(1, 2))
    if known.any():
        start: Any = Rotation.from_matrix(first[known])
        way = (start.inv() * Rotation.from_matrix(second[known])).as_rotvec()
        out[known] = (start * Rotation.from_rotvec(way * share[known, None])).as_matrix()
    return out
