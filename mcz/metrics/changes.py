"""Errors of velocities and accelerations of points, from those of their places."""

from __future__ import annotations

import numpy as np

from mcz.metrics.sums import Distances, Values, known_points, squared_norms


class ChangeErrors:
    """Differences of velocities and accelerations of ``n`` points, in lengths a row, a row squared.

    Blocks of rows follow one another: the last two rows of one are kept for the next.
    """

    def __init__(self, n: int) -> None:
        self.velocity, self.acceleration = Distances(n), Distances(n)
        self._off, self._valid = np.zeros((0, n, 3)), np.zeros((0, n), np.bool_)

    def add_points(self, start: int, left: Values, right: Values) -> None:
        """Points of shape (n_rows, n, 3) from row ``start`` on, NaN where unknown."""
        n_before = len(self._off)
        known = known_points(left) & known_points(right)
        off = np.concatenate([self._off, np.where(known[:, :, None], left - right, 0.0)])
        valid = np.concatenate([self._valid, known])
        for order, sums in ((1, self.velocity), (2, self.acceleration)):
            first = max(n_before - order, 0)
            n_rows = len(off) - first - order
            if n_rows > 0:
                changed = np.sqrt(squared_norms(np.diff(off[first:], order, axis=0)))
                both = [valid[first + k : first + k + n_rows] for k in range(order + 1)]
                counted = np.logical_and.reduce(both)
                sums.add(start + first + order - n_before, np.where(counted, changed, 0.0), counted)
        self._off, self._valid = off[-2:], valid[-2:]
