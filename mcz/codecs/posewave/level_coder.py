"""Levels of a segment: from rows in the metric to values, level by level, coarse to fine.

SPEC.md, "Codec 3: posewave", is normative. Encoder and decoder do the same: each level's rows are
coded at the pose that a decoder has by then, so an encoder decodes its own output.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy, deepcopy
from typing import Any, TypeAlias

import numpy as np

from mcz.codecs.posewave import metric_kernels
from mcz.codecs.posewave.contact_plan import Contacts, HeldPoints, make_held_points
from mcz.codecs.posewave.header import Header
from mcz.codecs.posewave.metric_kernels import Course
from mcz.codecs.posewave.pose_kernels import Lanes, lanes_of
from mcz.codecs.posewave.skeleton_plan import Plan, bounded_regularization, make_plan
from mcz.codecs.transforms import lifting
from mcz.model.motion import Skeleton
from mcz.model.types import Bools, Floats, Ints

Code = Callable[[Floats], Floats]  # rows to code -> rows as a decoder has them
CourseMetric: TypeAlias = tuple[Plan, Lanes, Course]
# of the rows, their steps, and the approximations to fill
CodeCourse: TypeAlias = Callable[[CourseMetric, Floats, Floats, Floats], None]

BLOCK_ENTRIES = 2**21  # numbers of factors that are in memory at a time


def midpoints(approx: Floats, n_rows: int) -> Floats:
    """Midpoints of consecutive approximations: the poses of the details."""
    after = np.concatenate([approx[1:], approx[-1:]])
    result: Floats = (approx[:n_rows] + after[:n_rows]) * 0.5  # PWAVE-22
    return result


class LevelCoder:
    """Codes the levels of a segment, coarse to fine, from rows in the metric."""

    def __init__(
        self, header: Header, skeleton: Skeleton, pyramid: Pyramid, kept: Bools, first: Floats
    ) -> None:
        """``first`` (n_channels,) is the pose before the first; channels not ``kept`` keep it."""
        self.header, self.pyramid, self.still = header, pyramid, first
        self.kept = np.flatnonzero(kept)
        self.usual = Metric(header, skeleton, kept, first)
        self.metric = self._metric_of(0)  # of the present level
        self.poses = self.approx = np.zeros((0, len(self.kept)))
        self._factors: Floats | None = None  # of all poses, where both ways through them are due
        self.lanes = lanes_of(self.metric.plan, 1)
        self.course = metric_kernels.course_of(first, self.kept, header.greatest[self.kept])

    def copy(self) -> LevelCoder:
        """Return an independent copy."""
        clone = copy(self)
        clone.course = deepcopy(self.course)
        return clone

    def values(self) -> Floats:
        """The frames, (n_frames, n_channels), after the last level."""
        values = np.repeat(self.still[None], len(self.approx), axis=0)
        values[:, self.kept] = self.approx
        return values

    def held_points(self, contacts: Contacts) -> HeldPoints:
        """Held points of the contacts, with the kept channels that move them."""
        greatest = self.header.greatest[self.kept]
        return make_held_points(contacts, self.usual.plan, self.kept, greatest)

    def _metric_of(self, level: int) -> Metric:
        """Metric of a level; coarse ones are stiffer, since their poses are less certain."""
        if not self.header.spread:
            return self.usual
        return self.usual.with_stiffness(self.pyramid.root(level))  # PWAVE-21, PWAVE-22

    def steps(self, level: int, exponents: Ints) -> Floats:
        """The step of each row, (n_rows, 1)."""
        halved: Floats = np.ldexp(1.0, -exponents).astype(np.float64)
        return self.header.step / self.pyramid.root(level) * halved[:, None]

    def code_coarsest(self, level: int, code: CodeCourse, rows: Floats, exponents: Ints) -> None:
        """Encode level 0, one row after the other."""
        self.approx = np.empty((len(rows), len(self.kept)))
        steps = self.steps(level, exponents)[:, 0]
        code((self.metric.plan, self.lanes, self.course), rows, steps, self.approx)

    def take_coarsest(self, level: int, rows: Floats, exponents: Ints) -> None:
        """Level 0 from all of its rows in the metric, in steps."""
        self.approx = np.empty((len(rows), len(self.kept)))
        scaled = rows * self.steps(level, exponents)
        metric_kernels.take_rows(self.metric.plan, self.lanes, self.course, scaled, self.approx)

    def code_details(self, level: int, code: Code, rows: Floats, exponents: Ints) -> None:
        """Encode a level of details, all rows at once; ``code`` returns the decoded rows."""
        which = self._poses_of(level)
        if len(self.poses) * self.metric.plan.n_entries <= BLOCK_ENTRIES:
            self._factors = self.metric.factors(self.poses)
        coefficients = self._map_rows(self.metric.to_metric, which, rows)
        self._add(level, which, code(coefficients / self.steps(level, exponents)), exponents)
        self._factors = None

    def take_details(self, level: int, rows: Floats, exponents: Ints) -> None:
        """A level of details from its rows in the metric, in steps."""
        self._add(level, self._poses_of(level), rows, exponents)

    def skip(self, level: int) -> None:
        """A level without details."""
        nothing = np.zeros((self.pyramid.rows(level), len(self.kept)))
        self.approx = lifting.join(self.approx, nothing)

    def _poses_of(self, level: int) -> Ints:
        """Pose number of each row, a coarser level's if borrowed."""
        pyramid = self.pyramid
        n_rows = pyramid.rows(level)
        if pyramid.depth(level) > pyramid.borrowing:  # PWAVE-22
            self.poses, self.level = midpoints(self.approx, n_rows), level
        self.metric = self._metric_of(level)
        result: Ints = np.minimum(np.arange(n_rows) >> (level - self.level), len(self.poses) - 1)
        return result

    def _add(self, level: int, which: Ints, rows: Floats, exponents: Ints) -> None:
        live = np.flatnonzero(rows.any(axis=1)) if rows.size else np.zeros(0, np.int64)
        detail = np.zeros(rows.shape)
        scaled = rows[live] * self.steps(level, exponents)[live]
        detail[live] = self._map_rows(self.metric.from_metric, which[live], scaled)
        self.approx = lifting.join(self.approx, detail)

    def _map_rows(self, way: Any, which: Ints, rows: Floats) -> Floats:
        """Rows one way through the metric, each at the pose of number ``which``."""
        if self._factors is not None:
            result: Floats = way(self._factors, rows, which)
            return result
        mapped = np.empty_like(rows)
        n_rows = min(max(BLOCK_ENTRIES // max(1, self.metric.plan.n_entries), 8), 512)
        for start in range(0, len(rows), n_rows):
            block = slice(start, start + n_rows)
            numbers, at = np.unique(which[block], return_inverse=True)
            mapped[block] = way(
                self.metric.factors(self.poses[numbers]), rows[block], at.astype(np.int64)
            )
        return mapped


ROOT_2 = 1.4142135623730951
N_KINDS = 6  # of levels


class Pyramid:
    """Wavelet levels of a segment: level 0 are approximations, then details, finest last."""

    def __init__(self, n_frames: int, levels: int, borrowing: int) -> None:
        self.lengths = lifting.lengths(n_frames, levels)
        self.n_details = len(self.lengths) - 1
        self.borrowing = min(borrowing, max(self.n_details - 1, 0))

    def depth(self, level: int) -> int:
        """Number of halvings of a level: 1 for the finest details."""
        return self.n_details if level == 0 else self.n_details + 1 - level

    def kind(self, level: int) -> int:
        """Kind of a level in the row model: 0 approximations, 5 the finest details."""
        return 0 if level == 0 else max(1, N_KINDS - self.depth(level))

    def rows(self, level: int) -> int:
        lengths, depth = self.lengths, self.depth(level)
        return lengths[-1] if level == 0 else lengths[depth - 1] // 2

    def root(self, level: int) -> float:
        """Root of the number of frames a coefficient affects, which weights all levels equally."""
        octaves = self.depth(level) - (level > 0)
        return float(2 ** (octaves // 2)) * (ROOT_2 if octaves % 2 else 1.0)

    def exponents(self, level: int, refinement: Ints) -> Ints:
        """The exponent of each row: the greatest ``refinement`` of the frames that it affects.

        ``refinement`` (n_frames,).
        """
        reach = 1 << self.depth(level)
        first = reach >> 1 if level else 0
        padded = np.pad(refinement, reach)
        greatest = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
        result: Ints = greatest[first::reach][: self.rows(level)]
        return result


ALONE = np.zeros(1, np.int64)


class Metric:
    """Metric of the kept channels of a segment; its other channels are constant.

    ``still`` (n_channels,) has their values.
    """

    def __init__(self, header: Header, skeleton: Skeleton, kept: Bools, still: Floats) -> None:
        self.kept, self.still = np.flatnonzero(kept), still
        ratios = header.step / header.greatest[kept]
        self.regularization: Floats = ratios * ratios
        self.plan = make_plan(
            skeleton,
            kept,
            self.regularization,
            radius=header.radius,
            kappa=header.shell,
            joint_weights=header.weights,
            orders=header.orders,
            whole=header.whole,
        )._replace(spread=header.spread)

    def with_stiffness(self, factor: float) -> Metric:
        """Copy with ``factor`` times the diagonal terms of the greatest steps."""
        clone = copy(self)
        stiffer = bounded_regularization(self.regularization * factor)
        clone.plan = self.plan._replace(regularization=stiffer)
        return clone

    def factors(self, poses: Floats) -> Floats:
        """Factors of ``poses``, (n_poses, n_kept): (n_poses, n_entries)."""
        values = np.repeat(self.still[None], len(poses), axis=0)
        values[:, self.kept] = poses
        result: Floats = metric_kernels.factor(self.plan, values)
        return result

    def to_metric(self, factors: Floats, rows: Floats, which: Ints = ALONE) -> Floats:
        """Differences of values, (n_rows, n_kept), in the metric, each at the pose ``which``."""
        result: Floats = metric_kernels.into_metric(self.plan, factors, rows, which)
        return result

    def from_metric(self, factors: Floats, rows: Floats, which: Ints = ALONE) -> Floats:
        """The inverse of ``to_metric``."""
        result: Floats = metric_kernels.out_of_metric(self.plan, factors, rows, which)
        return result
