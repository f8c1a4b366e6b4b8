"""Inverse kinematics: values whose points, and virtual markers, reach the given positions.

There is no exact answer: the solution has the least sum of squared distances and, among equals, the
values nearest to rest and to the neighbor frames. All frames are solved together:

1. an initial pose from the roots down (``targets.InitialPose``),
2. damped Gauss-Newton steps (Levenberg, Marquardt),
3. a restart of frames that end far off or stand out,
4. if distances remain, smoothing of values that the positions hardly determine.

The cost per frame is constant; large arrays exist for a block of frames only.
mcz/kinematics/README.md explains the choices.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mcz.errors import MotionError
from mcz.kinematics.rotation_fit import center_angles, smallest_angles
from mcz.kinematics.rotations import ORDERS, continuous, nearest_solutions
from mcz.kinematics.targets import InitialPose, Targets
from mcz.model.motion import Skeleton
from mcz.model.text_format import named
from mcz.model.types import Bools, Floats, Ints

MOST_STEPS, REPAIR_STEPS, SMOOTHING_STEPS = 50, 20, 10
GUESS_WEIGHT = 1e-6  # keeps channels that no target determines near the guess
RESTARTS = 2
FAR_OFF = 0.1  # typical levers (rms): frames with a greater error are restarted
RESTART_NOISE = 1.0  # radians (rms)
GUESS_BLOCK = 2**12  # frames
JUMP = 0.35  # radians from a frame to the next, more than people turn
SHORT_RUN = 8  # frames: runs between two jumps that are always outliers
OUTLIER_RATIO = 5.0  # times the median error
MOST_OUTLIERS = 0.3  # of all frames
EQUAL_ERRORS = 1e-2  # relative difference of sums of squares that counts as none
NEGLIGIBLE_SQUARE = 1e-10  # of the sum where every target is a typical lever away
EXACT_FIT = 1e-5  # typical levers: smaller distances need no smoothing
ANGLE_SPREAD = 0.05  # radians: usual deviation of angles from their mean over WINDOWS
WINDOWS = (8, 4)  # frames to each side, from coarse to fine
MOST_EXCESS = 1.5  # excess error of a smoothed solution, in units of noise times free channels


def solve_ik(skeleton: Skeleton, points: Floats, markers: Floats | None = None) -> Floats:
    """Values (n_frames, n_channels) in source units that bring points to these positions.

    ``points`` are the positions of the points of ``skeleton``, (n_frames, n_points, 3) in its
    length unit, as ``positions_of`` returns them, ``markers`` those of its virtual markers if
    known. NaN is an unknown position. Channels that move no target are 0.

    Raises MotionError if the shapes do not match the skeleton, and if it has no kinematics;
    OptionError for virtual markers without a length unit.
    """
    targets = Targets(skeleton, markers=markers is not None)
    goals, known = _goals(targets, points, markers)
    if not goals.shape[2]:
        return np.zeros((0, skeleton.n_channels))
    return _Solution(targets, goals, known).values()


class _Solution:
    """The state of the solver: values (n_channels, F) and their errors (F,)."""

    def __init__(self, targets: Targets, points: Floats, known: Floats) -> None:
        self.targets, self.points, self.known = targets, points, known
        links = targets.chain.links
        self.angles = np.array([c for link in links for c in link.angles], np.int64)
        self.vectors = np.array([c for link in links for c in link.vector], np.int64)
        self.columns = self._initial_columns()
        self.errors = np.zeros(points.shape[2])

    def values(self) -> Floats:
        """Run all steps; returns values (n_frames, n_channels)."""
        weight = np.full((len(self.columns), 1), GUESS_WEIGHT)
        self._accept(self._refine(self.columns, self.columns, weight, MOST_STEPS), None)
        self._retry(weight)
        self._make_continuous()
        self._repair_outliers(weight)
        self._make_continuous()
        self._smooth()
        self._make_continuous()
        self.columns[self.targets.units == 0] = 0.0
        return np.ascontiguousarray(self.columns.T)

    def _initial_columns(self) -> Floats:
        guess, n_frames = InitialPose(self.targets), self.points.shape[2]
        parts = [slice(start, start + GUESS_BLOCK) for start in range(0, n_frames, GUESS_BLOCK)]
        return np.concatenate(
            [guess.columns(self.points[:, :, rows], self.known[:, rows]) for rows in parts], axis=1
        )

    def _refine(
        self, start: Floats, prior: Floats, weight: Floats, steps: int, frames: Ints | None = None
    ) -> tuple[Floats, Floats]:
        points, known = self.points, self.known
        if frames is not None:
            points, known = points[:, :, frames], known[:, frames]
        return refine(self.targets, start, points, known, prior, weight, steps)

    def _accept(
        self, solution: tuple[Floats, Floats], limit: Floats | None, frames: Any = slice(None)
    ) -> None:
        """Accept a solution for ``frames`` if its errors are within ``limit``."""
        columns, errors = solution
        accepted = np.ones(len(errors), np.bool_) if limit is None else errors <= limit
        self.columns[:, frames] = np.where(accepted, columns, self.columns[:, frames])
        self.errors[frames] = np.where(accepted, errors, self.errors[frames])

    def _retry(self, weight: Floats) -> None:
        """Restart frames that ended far off from nearby random angles."""
        random = np.random.default_rng(0)
        for _ in range(RESTARTS):
            frames = np.flatnonzero(self.errors > FAR_OFF**2 * self._lever_squares())
            if not len(frames):
                return
            start = self.columns[:, frames]
            turning = np.concatenate([self.angles, self.vectors])
            noise = random.normal(0.0, RESTART_NOISE, (len(turning), len(frames)))
            start[turning] += noise / self.targets.chain.radians
            solution = self._refine(start, start, weight, MOST_STEPS, frames)
            self._accept(solution, self.errors[frames], frames)

    def _make_continuous(self) -> None:
        """Make rotations continuous over time, by whole turns and by the other Euler angles."""
        radians = self.targets.chain.radians
        for link in self.targets.chain.links:
            vector, columns = list(link.vector), link.angles
            if vector:
                self.columns[vector] = continuous(self.columns[vector] * radians) / radians
            angles = self.columns[columns].T * radians
            if link.freedoms in ORDERS:
                angles = nearest_solutions(angles)
                angles = smallest_angles(np.unwrap(angles, axis=0))
            else:
                angles = center_angles(np.unwrap(angles, axis=0))
            self.columns[columns] = angles.T / radians

    def _repair_outliers(self, weight: Floats) -> None:
        """Solve outlier frames again, from the interpolation of their neighbors."""
        is_outlier = self._find_outliers()
        good = np.flatnonzero(~is_outlier)
        frames = np.flatnonzero(is_outlier)
        if not len(good) or not len(frames):
            return
        line = np.stack([np.interp(frames, good, track[good]) for track in self.columns])
        limit = self.errors[frames] * (1 + EQUAL_ERRORS) + self._lever_squares() * NEGLIGIBLE_SQUARE
        self._accept(self._refine(line, line, weight, REPAIR_STEPS, frames), limit, frames)

    def _find_outliers(self) -> Bools:
        """Frames that miss more than usual, lack a target, or lie between two jumps.

        A reason that holds for more than MOST_OUTLIERS of the frames is ignored.
        """
        counts = self.known.sum(axis=0)
        turning = np.concatenate([self.angles, self.vectors])
        steps = np.diff(self.columns[turning], axis=1) * self.targets.chain.radians
        jumps = np.flatnonzero((np.abs(steps) > JUMP).any(axis=0)) + 1
        reasons = (
            counts < counts.max(),
            self.errors
            > OUTLIER_RATIO**2 * np.median(self.errors) + self._lever_squares() * NEGLIGIBLE_SQUARE,
            _frames_between_jumps(jumps, len(counts)),
        )
        is_outlier = np.zeros(len(counts), np.bool_)
        for reason in reasons:
            if np.count_nonzero(reason) < MOST_OUTLIERS * len(counts):
                is_outlier |= reason
        return is_outlier

    def _lever_squares(self) -> float:
        """The sum of squares where every target is a typical lever away."""
        return max(1, len(self.targets)) * self.targets.lever**2

    def _smooth(self) -> None:
        """Smooth the values towards their neighbor frames if distances remain, as with noise.

        The remaining distances estimate the noise of positions; ANGLE_SPREAD is the usual variation
        of human angles.
        """
        n_free = np.count_nonzero(self.targets.units)
        freedoms = 3 * self.known.sum() - n_free * self.known.shape[1]
        if freedoms <= 0:
            return
        square = float(self.errors.sum() / freedoms)
        if square < (EXACT_FIT * self.targets.lever) ** 2:
            return
        weight = np.full((len(self.columns), 1), square / (ANGLE_SPREAD * self.targets.lever) ** 2)
        limit = self.errors + MOST_EXCESS * n_free * square
        for around in WINDOWS:
            prior = _means(self.columns, around)
            self._accept(self._refine(self.columns, prior, weight, SMOOTHING_STEPS), limit)


def _frames_between_jumps(jumps: Ints, n_frames: int) -> Bools:
    """Frames between two jumps that are close, or closer than those on either side."""
    between = np.zeros(n_frames, np.bool_)
    borders = np.concatenate([[0], jumps, [n_frames]])
    lengths = np.diff(borders)
    for k in range(1, len(lengths) - 1):
        if lengths[k] < max(SHORT_RUN, min(lengths[k - 1], lengths[k + 1])):
            between[borders[k] : borders[k + 1]] = True
    return between


def _goals(targets: Targets, points: Floats, markers: Floats | None) -> tuple[Floats, Floats]:
    """(positions (n_targets, 3, F), 0 if unknown; 1.0 if known, else 0.0, (n_targets, F))."""
    skeleton = targets.skeleton
    n_markers = 0 if markers is None else 3 * skeleton.n_joints
    shapes = {"points": (points, len(targets) - n_markers), "virtual markers": (markers, n_markers)}
    for kind, (positions, count) in shapes.items():
        if positions is not None and (positions.ndim != 3 or positions.shape[1:] != (count, 3)):
            raise MotionError(
                f"{named('skeleton', skeleton.name)} has {count} {kind}, so positions must have "
                f"shape (n_frames, {count}, 3), not {positions.shape}"
            )
    if markers is not None and len(markers) != len(points):
        raise MotionError(f"{len(points)} frames of points, but {len(markers)} of virtual markers")
    positions = points if markers is None else np.concatenate([points, markers], axis=1)
    goals = np.array(np.moveaxis(positions, 0, 2), np.float64, order="C")
    finite: Bools = np.isfinite(goals)
    known = np.logical_and.reduce(finite, axis=1)
    return np.where(known[:, None], goals, 0.0), known.astype(np.float64)


def _means(tracks: Floats, around: int) -> Floats:
    """Moving averages of tracks (n, F) over ``around`` frames before and after each."""
    n_frames = tracks.shape[1]
    sums = np.concatenate([np.zeros((len(tracks), 1)), np.cumsum(tracks, axis=1)], axis=1)
    frames = np.arange(n_frames)
    first, last = np.maximum(frames - around, 0), np.minimum(frames + around + 1, n_frames)
    result: Floats = (sums[:, last] - sums[:, first]) / (last - first)
    return result


BLOCK_NUMBERS = 2**22  # numbers of a Jacobian at a time, 32 MB
START_DAMPING, LEAST_DAMPING = 1e-3, 1e-9  # of the mean of the normal matrix's diagonal
LESS_DAMPING, MORE_DAMPING = 0.2, 5.0
GIVE_UP = 1e9  # greatest damping; larger ones end the search
CONVERGED = 1e-6  # relative change of cost at which a frame is finished
NEGLIGIBLE = 1e-9  # typical levers: a distance that counts as 0
DIAGONAL_FLOOR = 1e-12  # added to the diagonal, so the matrix is regular


def refine(
    targets: Targets,
    columns: Floats,
    points: Floats,
    known: Floats,
    prior: Floats,
    weight: Floats,
    most_steps: int,
) -> tuple[Floats, Floats]:
    """Minimize the squared distances; return values (n_channels, F) and sums of squares, (F,).

    The objective is the sum over targets of |position - point|^2 where ``known`` is 1, plus
    ``weight``, (n_channels, 1), times the squares of the steps, in ``targets.units``, from
    ``prior``.
    """
    result, errors = columns.copy(), np.empty(columns.shape[1])
    per_frame = 3 * max(1, len(targets)) * max(1, len(columns))
    step = max(1, BLOCK_NUMBERS // per_frame)
    for start in range(0, columns.shape[1], step):
        rows = slice(start, start + step)
        part = _Descent(targets, points[:, :, rows], known[:, rows], prior[:, rows], weight)
        result[:, rows], errors[rows] = part.run(columns[:, rows], most_steps)
    return result, errors


class _Descent:
    """Damped Gauss-Newton over a block of frames."""

    def __init__(
        self, targets: Targets, points: Floats, known: Floats, prior: Floats, weight: Floats
    ) -> None:
        self.targets, self.known, self.prior, self.weight = targets, known, prior, weight
        self.points = np.where(known[:, None] > 0, points, 0.0)
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
            factor = np.where(better, LESS_DAMPING, MORE_DAMPING)
            damping[active] = np.maximum(damping[active] * factor, LEAST_DAMPING)
            near = np.abs(before - cost) <= CONVERGED * before + self._floor()
            active = active[~(near | (damping[active] > GIVE_UP))]
            if not len(active):
                break
        return columns, errors

    def _floor(self) -> float:
        """Costs that differ by less are equal up to rounding."""
        return len(self.targets) * (NEGLIGIBLE * self.targets.lever) ** 2

    def _objectives(self, columns: Floats, frames: Ints) -> tuple[Floats, Floats]:
        """Objective of each frame, and the targets' share of it, (F,) each."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            positions = self.targets.positions(columns, self.targets.chain.pose(columns))
            missed = (positions - self.points[:, :, frames]) * self.known[:, None, frames]
            errors = (missed * missed).sum(axis=(0, 1))
        away = self._steps_from_prior(columns, frames)
        costs = errors + (self.weight[self.free] * away * away).sum(axis=0)
        return np.where(np.isfinite(costs), costs, np.inf), errors

    def _steps_from_prior(self, columns: Floats, frames: Ints) -> Floats:
        """The steps from the prior, (n_free, F)."""
        return (columns[self.free] - self.prior[self.free][:, frames]) / self.units

    def _steps(self, columns: Floats, frames: Ints, damping: Floats) -> Floats:
        """The damped Gauss-Newton step of each frame, (n_free, F)."""
        targets = self.targets
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            pose = targets.chain.pose(columns)
            positions = targets.positions(columns, pose)
            known = self.known[:, None, frames]
            slopes = targets.jacobian(columns, pose, positions)[self.free] * known
            missed = (self.points[:, :, frames] - positions) * known
        n_frames = len(frames)
        matrix = np.ascontiguousarray(
            slopes.reshape(len(self.free), -1, n_frames).transpose(2, 0, 1)
        )
        normal = matrix @ matrix.transpose(0, 2, 1)
        slope = (matrix @ missed.reshape(-1, n_frames).T[:, :, None])[:, :, 0]
        slope -= (self.weight[self.free] * self._steps_from_prior(columns, frames)).T
        diagonal = np.einsum("fcc->fc", normal)
        level = damping * diagonal.mean(axis=1) + DIAGONAL_FLOOR
        diagonal += self.weight[self.free].T + level[:, None]
        return np.array(np.linalg.solve(normal, slope[:, :, None])[:, :, 0].T, np.float64)
