"""Encoder weights of the channels of a skeleton.

Source: Khan 2016, eq. 2, and its successors here, which ask how far the points move.

A rotation moves a point p by a x (p - o): its axis a, the joint's origin o. The sum of the squares
over points is a' (tr(M) - M) a, M the second moment of the points below about o. Moments are added
up from the leaves, so that the cost is one matrix a joint and not one vector a channel and point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mcz.errors import MczError, OptionError
from mcz.kinematics.chain import Chain, Link, Pose, to_world
from mcz.kinematics.points import depths, point_position, points_of, reach
from mcz.model.motion import ANGLE_KINDS, POSITION_KINDS, QUATERNION_KINDS, Skeleton
from mcz.model.types import Bools, Floats

RULES = ("sensitivity", "depth", "flat")
LEAST_SHARE = 1 / 16  # least weight of a channel, relative to the mean of rotations
SAMPLED_FRAMES = 128  # for measuring sensitivities


def weights_of(skeleton: Skeleton, sample: Floats, rule: str, *, unit_aware: bool) -> Floats:
    """The threshold of every channel at T_g = 1, (n_channels,), in source units.

    ``sample``: frames of the signal, unwrapped. ``rule`` is one of ``RULES``; ``unit_aware``
    converts the T_g of a position channel from degrees to the length that the farthest point moves.
    """
    kinds = [channel.kind for channel in skeleton.channels]
    degree = math.pi / 180 if skeleton.angle_unit == "rad" else 1.0
    is_rotation = np.array([kind in ANGLE_KINDS for kind in kinds], np.bool_)
    is_part = np.array([kind in QUATERNION_KINDS for kind in kinds], np.bool_)
    degrees = np.where(is_rotation, degree, np.where(is_part, math.pi / 360, 1.0))
    if rule == "sensitivity":
        return _by_sensitivity(skeleton, sample, is_rotation | is_part, degrees)
    weights = np.ones(len(kinds))
    if rule == "depth":
        counts = [len(joint.channels) for joint in skeleton.joints]
        weights = np.sqrt(np.log2(np.repeat(depths(skeleton), counts) + 2))
    if not unit_aware:
        return weights
    weights = weights * degrees
    is_position = np.array([kind in POSITION_KINDS for kind in kinds], np.bool_)
    lever = reach(skeleton) * math.pi / 180
    return np.where(is_position, weights * (lever if 0 < lever < math.inf else 1.0), weights)


def _by_sensitivity(skeleton: Skeleton, sample: Floats, turns: Bools, degrees: Floats) -> Floats:
    """Thresholds with equal effect on the points; T_g is that of a rotation of average effect.

    ``degrees`` (n_channels,) is one degree in the unit of a channel that ``turns``.
    """
    try:
        effects = sensitivities(skeleton, sample, SAMPLED_FRAMES)
    except MczError:  # an unknown angle unit: no kinematics
        return degrees
    turning = (effects * degrees)[turns & (effects > 0)]
    average = float(np.sqrt(np.mean(turning**2))) if len(turning) else 1.0
    if not np.isfinite(average) or average <= 0:
        return degrees
    floor = average / degrees * LEAST_SHARE
    return np.where(effects > 0, average / np.maximum(effects, floor), degrees)


def sensitivities(skeleton: Skeleton, values: Floats, max_frames: int | None = None) -> Floats:
    """The rms, over frames and all points, of |d position / d channel|, (n_channels,).

    The unit is length units per source unit of the channel; 0 for plain scalars. ``values`` are
    those of the frames, (n_frames, n_channels); at most ``max_frames`` of them are used, evenly
    spread. Frames in which a channel or a point below it is NaN do not count.
    """
    if max_frames is not None:
        if max_frames < 1:
            raise OptionError(f"max_frames is {max_frames}; it must be at least 1")
        values = values[:: max(1, -(-len(values) // max_frames))]
    chain = Chain(skeleton)
    points = points_of(skeleton)
    squares, counts = np.zeros(skeleton.n_channels), np.zeros(skeleton.n_channels)
    for _, columns, pose in chain.poses(values):
        for column, square in _Block(chain, points, columns, pose).squares():
            known = np.isfinite(square)
            squares[column] += square[known].sum()
            counts[column] += known.sum()
    n_points = max(1, sum(map(len, points)))
    return np.sqrt(np.maximum(squares, 0.0) / np.maximum(counts * n_points, 1.0))


class _Block:
    """The points of some frames and their moments, joint by joint.

    ``numbers`` (of points below a joint, its own included), ``sums`` (3, F) and ``moments``
    (3, 3, F): sums of p and of p p', with p counted from the root's origin for precision.
    """

    def __init__(self, chain: Chain, points: list[list[int]], columns: Floats, pose: Pose) -> None:
        self.chain, self.points, self.columns, self.pose = chain, points, columns, pose
        n_joints, n_frames = len(chain.links), columns.shape[1]
        self.roots = list(range(n_joints))
        for joint, link in enumerate(chain.links):
            if link.parent >= 0:
                self.roots[joint] = self.roots[link.parent]
        self.numbers = [len(own) for own in points]
        self.sums = [np.zeros((3, n_frames)) for _ in range(n_joints)]
        self.moments = [np.zeros((3, 3, n_frames)) for _ in range(n_joints)]
        for joint in reversed(range(n_joints)):
            for tail in points[joint]:
                p = (
                    point_position(chain, joint, tail, columns, pose)
                    - pose.origins[self.roots[joint]]
                )
                self.sums[joint] += p
                self.moments[joint] += p[:, None] * p[None]
            parent = chain.links[joint].parent
            if parent >= 0:
                self.numbers[parent] += self.numbers[joint]
                self.sums[parent] += self.sums[joint]
                self.moments[parent] += self.moments[joint]

    def squares(self) -> Iterator[tuple[int, Floats]]:
        """Sum of squares over points, (F,), for every channel that moves a point."""
        children: list[list[int]] = [[] for _ in self.chain.links]
        for joint, link in enumerate(self.chain.links):
            if link.parent >= 0:
                children[link.parent].append(joint)
        for joint, link in enumerate(self.chain.links):
            yield from self._turns(joint, link)
            yield from self._moves(joint, link)
            yield from self._stretches(joint, link, children[joint])

    def _turns(self, joint: int, link: Link) -> Iterator[tuple[int, Floats]]:
        """Rotations: a' (tr(M) - M) a, with M about the joint's origin."""
        if not link.turns:
            return
        o = self.pose.origins[joint] - self.pose.origins[self.roots[joint]]
        sums, number = self.sums[joint], self.numbers[joint]
        moment = self.moments[joint] - sums[:, None] * o[None] - o[:, None] * sums[None]
        moment = moment + number * o[:, None] * o[None]
        trace = moment[0, 0] + moment[1, 1] + moment[2, 2]
        for column, spin in zip(link.turning, self.pose.spins[joint], strict=True):
            a = spin if column in link.quaternion else spin * self.chain.radians
            yield column, trace * (a * a).sum(axis=0) - (a * to_world(moment, a)).sum(axis=0)

    def _moves(self, joint: int, link: Link) -> Iterator[tuple[int, Floats]]:
        """Position channels: all points below move together, scaled by the parent."""
        for component, column in link.moves:
            step = np.zeros((3, 1))
            step[component] = 1.0
            if link.parent_back is not None:
                step = link.parent_back @ step
            if link.parent >= 0:
                step = self.chain.apply_scales(self.chain.links[link.parent], step, self.columns)
            yield column, self._alike(step, self.numbers[joint])

    def _stretches(
        self, joint: int, link: Link, children: list[int]
    ) -> Iterator[tuple[int, Floats]]:
        """Lengths and scales: they move the joint's tails, and its children with all below."""
        ends = [tail for tail in self.points[joint] if tail >= 0]
        if link.direction is not None:
            step = self.chain.apply_scales(link, link.direction[:, None], self.columns)
            number = len(ends) + sum(self.numbers[child] for child in children)
            for column in link.lengths:
                yield column, self._alike(step, number)
        if not link.scales:
            return
        tails = (link.tails[tail][:, None] for tail in ends)
        vectors = [(1, self.chain.apply_lengths(link, tail, self.columns)) for tail in tails]
        vectors += [(self.numbers[child], self.pose.arms[child]) for child in children]
        for component, column in link.scales:
            total = sum((n * v[component] ** 2 for n, v in vectors), np.zeros(1))
            yield column, total + np.zeros(self.columns.shape[1])

    def _alike(self, step: Floats, number: int) -> Floats:
        """The sum of squares where ``number`` points move by ``step``, (3, F or 1), each."""
        square: Floats = number * (step * step).sum(axis=0)
        return square + np.zeros(self.columns.shape[1])
