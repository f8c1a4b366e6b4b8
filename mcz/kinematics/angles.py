"""Unwrapping of angles and rotations along time.

SPEC.md, "Unwrapping", is normative. An ``Unwrapper`` goes through a signal block by block; the
result does not depend on where the blocks end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from mcz.model.motion import ROTATION_KINDS, Channel, Skeleton
from mcz.model.whole_turns import Columns, SignKeeper, VectorFollower, quaternions_of, vectors_of

FULL_TURN = {"deg": 360.0, "rad": 2 * math.pi}
# A value of this magnitude or more takes no part. Below it every count of turns, and its product
# with 360, is exact.
BEYOND = 2.0**40


def rotation_columns(channels: Sequence[Channel]) -> NDArray[np.int64]:
    """The columns of rotation channels."""
    kinds = [channel.kind in ROTATION_KINDS for channel in channels]
    return np.flatnonzero(kinds).astype(np.int64)


def turns(steps: NDArray[np.float64], full: float) -> NDArray[np.float64]:
    """Whole turns in each step from row to row; exactly half a turn, either way, counts as none.

    >>> turns(np.array([180.0, 180.5, -180.0, -540.5]), 360.0)
    array([ 0.,  1., -0., -2.])
    """
    ratio = steps / full
    return np.copysign(np.ceil(np.abs(ratio) - 0.5), ratio)


class Unwrapper:
    """Takes whole turns out of the rotation channels of a signal, given block after block.

    Rotation vectors and quaternions follow each other, too, by what turns as they do. Where the
    skeleton's angle unit is unknown nothing is done to angles: a turn has no known size.
    """

    def __init__(self, skeleton: Skeleton, channels: Sequence[Channel] | None = None) -> None:
        """``channels`` are those of the signal where it has its own."""
        self._full = FULL_TURN.get(skeleton.angle_unit)
        self._columns = rotation_columns(skeleton.channels if channels is None else channels)
        self._last = np.zeros(len(self._columns))  # the last value that took part
        self._begun = np.zeros(len(self._columns), np.bool_)  # whether there was one
        self._turns = np.zeros(len(self._columns))
        joints = skeleton if channels is None else Skeleton(())
        self._followers: list[tuple[Columns, VectorFollower | SignKeeper]] = []
        if self._full is not None:
            self._followers += [(c, VectorFollower(self._full)) for c in vectors_of(joints)]
        self._followers += [(c, SignKeeper()) for c in quaternions_of(joints)]

    def __copy__(self) -> Unwrapper:
        """One that goes on by itself from the same row."""
        made = object.__new__(Unwrapper)
        made.__dict__.update(self.__dict__)
        made._followers = [(columns, copy(follow)) for columns, follow in self._followers]
        return made

    def __call__(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
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
            steps = self._gapped(block, part)
        counted = np.cumsum(np.concatenate([self._turns[None], turns(steps, self._full)]), axis=0)
        self._turns = counted[-1].copy()
        out[:, self._columns] = np.where(part, block - self._full * counted[1:], block)
        return out

    def _gapped(self, block: NDArray[np.float64], part: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Steps from the last value that takes part to the next, 0 where one does not."""
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


def unwrap(
    values: NDArray[np.float64], skeleton: Skeleton, channels: Sequence[Channel] | None = None
) -> NDArray[np.float64]:
    """A whole signal, (n_rows, n_channels) in source units, unwrapped; a new array."""
    return Unwrapper(skeleton, channels)(values)


def without_turns(
    differences: NDArray[np.float64], skeleton: Skeleton, channels: Sequence[Channel] | None = None
) -> NDArray[np.float64]:
    """Differences of two signals, (n_rows, n_channels), those of rotations less their whole turns.

    A new array; a difference of ``BEYOND`` or more is left as it is.
    """
    out = np.array(differences, dtype=np.float64)
    full = FULL_TURN.get(skeleton.angle_unit)
    columns = rotation_columns(skeleton.channels if channels is None else channels)
    if full is not None and len(columns):
        block = out[:, columns]
        counted = turns(np.where(np.abs(block) < BEYOND, block, 0.0), full)
        out[:, columns] = block - full * counted
    return out
