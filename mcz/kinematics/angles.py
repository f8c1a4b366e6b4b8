"""Unwrapping of angles, rotation vectors and quaternions along time.

SPEC.md, "Unwrapping", is normative. An ``Unwrapper`` goes through a signal block by block; the
result does not depend on where the blocks end. v and v (1 + 2 pi n / |v|) turn alike, and so do q
and -q: metrics take the nearest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy

import numpy as np

from mcz.model.motion import QUATERNION_KINDS, ROTATION_KINDS, VECTOR_KINDS, Channel, Skeleton
from mcz.model.skeleton import first_columns
from mcz.model.types import Bools, Floats, Ints

FULL_TURN = {"deg": 360.0, "rad": 2 * math.pi}
# A value of this magnitude or more takes no part. Below it every count of turns, and its product
# with 360, is exact.


def rotation_columns(channels: Sequence[Channel]) -> Ints:
    kinds = [channel.kind in ROTATION_KINDS for channel in channels]
    return np.flatnonzero(kinds).astype(np.int64)


def whole_turns(steps: Floats, full: float) -> Floats:
    """Whole turns in each step from row to row; exactly half a turn, either way, counts as none.

    >>> whole_turns(np.array([180.0, 180.5, -180.0, -540.5]), 360.0)
    array([ 0.,  1., -0., -2.])
    """
    ratio = steps / full
    return np.copysign(np.ceil(np.abs(ratio) - 0.5), ratio)


class Unwrapper:
    """Removes whole turns from the rotation channels of a signal, given block after block.

    Rotation vectors and quaternions become the equivalents nearest to the previous frame. If the
    skeleton's angle unit is unknown, angles are not changed: the size of a turn is unknown.
    """

    def __init__(self, skeleton: Skeleton, channels: Sequence[Channel] | None = None) -> None:
        """``channels``: the channels of the signal if it has its own."""
        self._full = FULL_TURN.get(skeleton.angle_unit)
        self._columns = rotation_columns(skeleton.channels if channels is None else channels)
        self._last = np.zeros(len(self._columns))  # the last value that took part
        self._begun = np.zeros(len(self._columns), np.bool_)  # True once a value has been seen
        self._turns = np.zeros(len(self._columns))
        joints = skeleton if channels is None else Skeleton(())
        self._followers: list[tuple[Ints, VectorFollower | SignKeeper]] = []
        if self._full is not None:
            self._followers += [(c, VectorFollower(self._full)) for c in vectors_of(joints)]
        self._followers += [(c, SignKeeper()) for c in quaternions_of(joints)]

    def __copy__(self) -> Unwrapper:
        """A copy that continues independently from the same row."""
        copied = object.__new__(Unwrapper)
        copied.__dict__.update(self.__dict__)
        copied._followers = [(columns, copy(follow)) for columns, follow in self._followers]
        return copied

    def __call__(self, values: Floats) -> Floats:
        """The next rows, (n_rows, n_channels), as a new array; values that are NaN stay NaN."""
        out = np.array(values, dtype=np.float64)
        for columns, follow in self._followers:
            out[:, columns] = follow(out[:, columns])
        if self._full is None or not out.size or not len(self._columns):
            return out
        block = out[:, self._columns]
        part = np.abs(block) < BEYOND  # False for NaN
        if part.all():
            before = np.concatenate([np.where(self._begun, self._last, block[0])[None], block[:-1]])
            steps = block - before
            self._last, self._begun = block[-1].copy(), np.ones_like(self._begun)
        else:
            steps = self._valid_steps(block, part)
        counted = np.cumsum(
            np.concatenate([self._turns[None], whole_turns(steps, self._full)]), axis=0
        )
        self._turns = counted[-1].copy()
        out[:, self._columns] = np.where(part, block - self._full * counted[1:], block)
        return out

    def _valid_steps(self, block: Floats, part: Bools) -> Floats:
        """Steps from the last valid value to the next, 0 at an invalid one."""
        rows = np.where(part, np.arange(len(block))[:, None], -1)
        latest = np.maximum.accumulate(rows, axis=0)
        previous = np.concatenate([np.full_like(latest[:1], -1), latest[:-1]])
        earlier = np.take_along_axis(block, np.maximum(previous, 0), axis=0)
        carried = np.where(self._begun, self._last, block)
        before = np.where(previous >= 0, earlier, carried)
        final = np.take_along_axis(block, np.maximum(latest[-1:], 0), axis=0)[0]
        self._last = np.where(latest[-1] >= 0, final, self._last)
        self._begun = self._begun | (latest[-1] >= 0)
        return np.where(part, block, 0.0) - np.where(part, before, 0.0)


def unwrap(values: Floats, skeleton: Skeleton, channels: Sequence[Channel] | None = None) -> Floats:
    """A whole signal, (n_rows, n_channels) in source units, unwrapped; a new array."""
    return Unwrapper(skeleton, channels)(values)


def without_turns(
    differences: Floats, skeleton: Skeleton, channels: Sequence[Channel] | None = None
) -> Floats:
    """Differences of two signals, (n_rows, n_channels), without whole turns of rotations.

    A new array; a difference of ``BEYOND`` or more is not changed.
    """
    out = np.array(differences, dtype=np.float64)
    full = FULL_TURN.get(skeleton.angle_unit)
    columns = rotation_columns(skeleton.channels if channels is None else channels)
    if full is not None and len(columns):
        block = out[:, columns]
        counted = whole_turns(np.where(np.abs(block) < BEYOND, block, 0.0), full)
        out[:, columns] = block - full * counted
    return out


BEYOND = 2.0**40  # numbers of this magnitude or more are ignored


def vectors_of(skeleton: Skeleton) -> list[Ints]:
    """The columns of the rotation vector of every joint that has one."""
    return _columns(skeleton, VECTOR_KINDS)


def quaternions_of(skeleton: Skeleton) -> list[Ints]:
    """The columns of the quaternion of every joint that has one."""
    return _columns(skeleton, QUATERNION_KINDS)


def _columns(skeleton: Skeleton, kinds: tuple[str, ...]) -> list[Ints]:
    starts = skeleton.column_starts()
    columns = (
        first_columns(joint.channels, kinds, start)
        for joint, start in zip(skeleton.joints, starts, strict=False)
    )
    return [np.array(columns, np.int64) for columns in columns if columns]


class VectorFollower:
    """Makes one rotation vector continuous, block after block of rows."""

    def __init__(self, full: float) -> None:
        self._full = full
        self._last: Floats | None = None

    def __call__(self, vectors: Floats) -> Floats:
        """The next rows, (n_rows, 3), each the equivalent vector nearest to the row before."""
        rows = np.flatnonzero((np.abs(vectors) < BEYOND).all(axis=1))
        if not len(rows):
            return vectors
        own = vectors[rows]
        last = own[:1] if self._last is None else self._last[None]
        counts = _turns(own, np.concatenate([last, own[:-1]]), self._full)[0]
        if counts.any():  # rare; each row depends on the previous one
            first = int(np.flatnonzero(counts)[0])
            before = own[first - 1] if first else last[0]
            for row in range(first, len(own)):
                own[row] = before = nearest(own[row : row + 1], before[None], self._full)[0]
            vectors = vectors.copy()
            vectors[rows] = own
        self._last = own[-1].copy()
        return vectors


class SignKeeper:
    """Gives a quaternion the sign that keeps it near the previous one, block after block."""

    def __init__(self) -> None:
        self._last: Floats | None = None

    def __call__(self, quaternions: Floats) -> Floats:
        """The next rows, (n_rows, 4)."""
        rows = np.flatnonzero(np.isfinite(quaternions).all(axis=1))
        if not len(rows):
            return quaternions
        own = quaternions[rows]
        last = own[:1] if self._last is None else self._last[None]
        dots = (own * np.concatenate([last, own[:-1]])).sum(axis=1)
        signs = np.cumprod(np.where(dots < 0, -1.0, 1.0))
        out = quaternions.copy()
        out[rows] = own * signs[:, None]
        self._last = out[rows[-1]].copy()
        return out


def nearest(vectors: Floats, target: Floats, full: float) -> Floats:
    """Return the equivalent rotation vectors, (n, 3), nearest to ``target``."""
    counts, axes = _turns(vectors, target, full)
    return np.where(counts[:, None] == 0, vectors, vectors + (full * counts)[:, None] * axes)


def _turns(vectors: Floats, target: Floats, full: float) -> tuple[Floats, Floats]:
    """Whole turns from each vector to the nearest equivalent one, and their axes."""
    sizes = np.sqrt((vectors * vectors).sum(axis=1))
    others = np.sqrt((target * target).sum(axis=1))
    zero = sizes == 0  # any axis is as good: the target's
    lengths = np.where(zero, others, sizes)
    axes = np.where(zero[:, None], target, vectors) / np.where(lengths == 0, 1.0, lengths)[:, None]
    counts = np.rint(((target * axes).sum(axis=1) - sizes) / full)
    return counts, axes


def without_whole_turns(
    original: Floats, decoded: Floats, differences: Floats, skeleton: Skeleton
) -> Floats:
    """Make ``differences`` of vectors and quaternions, decoded minus original, the least ones.

    All are (n_rows, n_channels); ``differences`` is written to and returned. A number of 2^40 or
    more in magnitude is not changed.
    """
    full = {"deg": 360.0, "rad": 2 * math.pi}.get(skeleton.angle_unit, 0.0)
    for columns in vectors_of(skeleton) if full else []:
        rows = _known_rows(original, decoded, columns)
        target = original[np.ix_(rows, columns)]
        differences[np.ix_(rows, columns)] = (
            nearest(decoded[np.ix_(rows, columns)], target, full) - target
        )
    for columns in quaternions_of(skeleton):
        rows = _known_rows(original, decoded, columns)
        one, other = original[np.ix_(rows, columns)], decoded[np.ix_(rows, columns)]
        signs = np.where((one * other).sum(axis=1) < 0, -1.0, 1.0)
        differences[np.ix_(rows, columns)] = other * signs[:, None] - one
    return differences


def _known_rows(original: Floats, decoded: Floats, columns: Ints) -> Ints:
    part = (np.abs(original[:, columns]) < BEYOND) & (np.abs(decoded[:, columns]) < BEYOND)
    return np.flatnonzero(part.all(axis=1)).astype(np.int64)
