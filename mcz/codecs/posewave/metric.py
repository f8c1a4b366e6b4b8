"""The metric of a segment: rows of differences of poses, made into rows that one step suits.

SPEC.md, "Pose metric", is normative.
"""

from __future__ import annotations

from copy import copy
from functools import cache
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from mcz.codecs.posewave.header import Header
from mcz.codecs.posewave.skeleton_plan import bounded_regularization, make_plan
from mcz.model.motion import Skeleton

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALONE = np.zeros(1, np.int64)


@cache
def kernels() -> ModuleType:
    from mcz.codecs.posewave import metric_kernels

    return metric_kernels


@cache
def apply_kernels() -> ModuleType:
    from mcz.codecs.posewave import apply_kernels as found

    return found


class Metric:
    """Metric of the kept channels of a segment; its other channels are constant.

    ``still`` (n_channels,) has their values.
    """

    def __init__(
        self, header: Header, skeleton: Skeleton, kept: NDArray[np.bool_], still: Floats
    ) -> None:
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
        factors: Floats = kernels().factor(self.plan, values)
        return factors

    def empty(self) -> Floats:
        """Room for the factor of a single pose."""
        return np.empty((1, self.plan.n_entries))

    def to_metric(self, factors: Floats, rows: Floats, which: Ints = ALONE) -> Floats:
        """Differences of values, (n_rows, n_kept), in the metric, each at the pose ``which``."""
        coordinates: Floats = apply_kernels().into_metric(self.plan, factors, rows, which)
        return coordinates

    def from_metric(self, factors: Floats, rows: Floats, which: Ints = ALONE) -> Floats:
        """The inverse of ``into``."""
        channels: Floats = apply_kernels().out_of_metric(self.plan, factors, rows, which)
        return channels
