"""Damped Gauss-Newton steps (Levenberg, Marquardt), many frames at once, each damped for itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcz.kinematics.chain import Floats
from mcz.kinematics.targets import Targets

Ints = NDArray[np.int64]

BLOCK_NUMBERS = 2**22  # of a Jacobian at a time, 32 MB
START_DAMPING, LEAST_DAMPING = 1e-3, 1e-9  # of the mean of the normal matrix's diagonal
EASIER, HARDER = 0.2, 5.0
GIVE_UP = 1e9  # damping at which no step helps any more
CLOSE = 1e-6  # change of cost, relative, by which a frame is done
NOTHING = 1e-9  # of the typical lever: a distance that counts as met
LEAST = 1e-12  # added to the diagonal, so that what moves nothing stays where it is


def refine(
    targets: Targets,
    columns: Floats,
    seen: Floats,
    known: Floats,
    prior: Floats,
    weight: Floats,
    most_steps: int,
) -> tuple[Floats, Floats]:
    """Values (n_channels, F) from which no step leads nearer, and the sums of squares there, (F,).

    Least is the sum over targets of |position - seen|^2 where ``known`` is 1, plus ``weight``,
    (n_channels, 1), times the squares of the steps, in ``targets.units``, from ``prior``.
    """
    result, errors = columns.copy(), np.empty(columns.shape[1])
    per_frame = 3 * max(1, len(targets)) * max(1, len(columns))
    step = max(1, BLOCK_NUMBERS // per_frame)
    for start in range(0, columns.shape[1], step):
        rows = slice(start, start + step)
        part = _Descent(targets, seen[:, :, rows], known[:, rows], prior[:, rows], weight)
        result[:, rows], errors[rows] = part.run(columns[:, rows], most_steps)
    return result, errors


class _Descent:
    """A block of frames on its way down."""

    def __init__(
        self, targets: Targets, seen: Floats, known: Floats, prior: Floats, weight: Floats
    ) -> None:
        self.targets, self.known, self.prior, self.weight = targets, known, prior, weight
        self.seen = np.where(known[:, None] > 0, seen, 0.0)
        self.free = np.flatnonzero(targets.units)
        self.units = targets.units[self.free, None]

    def run(self, columns: Floats, most_steps: int) -> tuple[Floats, Floats]:
        """Return the values and sums of squares after at most ``most_steps`` steps."""
        columns, active = columns.copy(), np.arange(columns.shape[1])
        damping = np.full(columns.shape[1], START_DAMPING)
        costs, errors = self._objectives(columns, active)
        for _ in range(most_steps if len(self.free) else 0):
            trial = columns[:, active]
            trial[self.free] += self._steps(trial, active, damping[active]) * self.units
            cost, error = self._objectives(trial, active)
            before = costs[active]
            better = cost < before
            at = active[better]
            columns[:, at], costs[at], errors[at] = trial[:, better], cost[better], error[better]
            factor = np.where(better, EASIER, HARDER)
            damping[active] = np.maximum(damping[active] * factor, LEAST_DAMPING)
            near = np.abs(before - cost) <= CLOSE * before + self._floor()
            active = active[~(near | (damping[active] > GIVE_UP))]
            if not len(active):
                break
        return columns, errors

    def _floor(self) -> float:
        """A sum of squares beyond which numbers are rounded alone."""
        return len(self.targets) * (NOTHING * self.targets.lever) ** 2

    def _objectives(self, columns: Floats, frames: Ints) -> tuple[Floats, Floats]:
        """Objective of each frame, and the targets' share of it, (F,) each."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            positions = self.targets.positions(columns, self.targets.chain.pose(columns))
            missed = (positions - self.seen[:, :, frames]) * self.known[:, None, frames]
            errors = (missed * missed).sum(axis=(0, 1))
        away = self._steps_from_prior(columns, frames)
        costs = errors + (self.weight[self.free] * away * away).sum(axis=0)
        return np.where(np.isfinite(costs), costs, np.inf), errors

    def _steps_from_prior(self, columns: Floats, frames: Ints) -> Floats:
        """The steps from the prior, (n_free, F)."""
        away: Floats = (columns[self.free] - self.prior[self.free][:, frames]) / self.units
        return away

    def _steps(self, columns: Floats, frames: Ints, damping: Floats) -> Floats:
        """The damped Gauss-Newton step of each frame, (n_free, F)."""
        targets = self.targets
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            pose = targets.chain.pose(columns)
            positions = targets.positions(columns, pose)
            known = self.known[:, None, frames]
            slopes = targets.jacobian(columns, pose, positions)[self.free] * known
            missed = (self.seen[:, :, frames] - positions) * known
        n_frames = len(frames)
        matrix = np.ascontiguousarray(
            slopes.reshape(len(self.free), -1, n_frames).transpose(2, 0, 1)
        )
        normal = matrix @ matrix.transpose(0, 2, 1)
        slope = (matrix @ missed.reshape(-1, n_frames).T[:, :, None])[:, :, 0]
        slope -= (self.weight[self.free] * self._steps_from_prior(columns, frames)).T
        diagonal = np.einsum("fcc->fc", normal)
        level = damping * diagonal.mean(axis=1) + LEAST
        diagonal += self.weight[self.free].T + level[:, None]
        steps: Floats = np.array(np.linalg.solve(normal, slope[:, :, None])[:, :, 0].T, np.float64)
        return steps
