"""Targets of inverse kinematics: points, virtual markers, and their Jacobian.

A target is a position fastened to a joint: a point, or a virtual marker near the joint's first
point. Arrays of a block of frames have the frames last.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mcz.kinematics.chain import Chain, Link, Pose, to_world
from mcz.kinematics.points import marker_distance, point_position, points_of, reach
from mcz.model.motion import Skeleton
from mcz.model.types import Floats, Ints

TYPICAL_LEVER = 0.125  # of the reach: a turn by one radian counts as a move by this length


@dataclass(frozen=True, slots=True)
class Target:
    """A position of ``joint``: its tail of that number or, -1, its origin; ``axis`` of a marker."""

    joint: int
    tail: int
    axis: int = -1


class Targets:
    """The targets of a skeleton in the order of their positions: points, then virtual markers.

    ``units``, (n_channels,): the source units of each channel that count as one length unit, the
    measure of all steps; 0 of channels that move no target.
    """

    def __init__(self, skeleton: Skeleton, *, markers: bool) -> None:
        self.skeleton, self.chain = skeleton, Chain(skeleton)
        own = points_of(skeleton)
        self.list = [Target(joint, tail) for joint, tails in enumerate(own) for tail in tails]
        self.distance = marker_distance(skeleton) if markers else 0.0
        if markers:
            firsts = [tails[0] for tails in own]
            self.list += [Target(j, tail, k) for j, tail in enumerate(firsts) for k in range(3)]
        self.lever = TYPICAL_LEVER * reach(skeleton) or 1.0
        self.units = self._units()
        self.below = self._below()
        self.children: list[list[int]] = [[] for _ in self.chain.links]
        for joint, link in enumerate(self.chain.links):
            if link.parent >= 0:
                self.children[link.parent].append(joint)

    def __len__(self) -> int:
        return len(self.list)

    def _units(self) -> Floats:
        units = np.zeros(self.skeleton.n_channels)
        for link in self.chain.links:
            units[[c for _, c in link.moves]] = 1.0
            if link.direction is not None:
                units[list(link.lengths)] = 1.0
            units[[c for _, c in link.scales] + list(link.quaternion)] = 1.0 / self.lever
            units[link.angles + list(link.vector)] = 1.0 / (self.chain.radians * self.lever)
        return units

    def _below(self) -> list[Ints]:
        below: list[list[int]] = [[] for _ in self.chain.links]
        for number, target in enumerate(self.list):
            joint = target.joint
            while joint >= 0:
                below[joint].append(number)
                joint = self.chain.links[joint].parent
        return [np.array(numbers, np.int64) for numbers in below]

    def neutral(self, n_frames: int) -> Floats:
        """Values that turn, move and stretch no joint, (n_channels, F)."""
        columns = np.zeros((self.skeleton.n_channels, n_frames))
        for link in self.chain.links:
            columns[[c for _, c in link.scales]] = 1.0
            columns[list(link.quaternion[:1])] = 1.0
        return columns

    def positions(self, columns: Floats, pose: Pose) -> Floats:
        """Positions of the targets, (n_targets, 3, F)."""
        positions = np.empty((len(self.list), 3, columns.shape[1]))
        for number, target in enumerate(self.list):
            positions[number] = point_position(self.chain, target.joint, target.tail, columns, pose)
            if target.axis >= 0:
                positions[number] += self.distance * pose.axes[target.joint][:, target.axis]
        return positions

    def jacobian(self, columns: Floats, pose: Pose, positions: Floats) -> Floats:
        """d positions / d channels for a step of ``units``, (n_channels, n_targets, 3, F)."""
        jacobian = np.zeros((self.skeleton.n_channels, *positions.shape))
        for joint, link in enumerate(self.chain.links):
            numbers = self.below[joint]
            if not len(numbers):
                continue
            if link.turns:
                arms = positions[numbers] - pose.origins[joint]
                for column, spin in zip(link.turning, pose.spins[joint], strict=True):
                    jacobian[column, numbers] = _cross(spin / self.lever, arms)
            for column, step in self._moves(link, columns, pose):
                jacobian[column, numbers] = step
            for column, some, step in self._stretches(joint, link, columns, pose):
                jacobian[column, some] += step
        return jacobian

    def _moves(self, link: Link, columns: Floats, pose: Pose) -> Iterator[tuple[int, Floats]]:
        for component, column in link.moves:
            step = np.zeros((3, 1))
            step[component] = 1.0
            if link.parent >= 0:
                if link.parent_back is not None:
                    step = link.parent_back @ step
                step = self.chain.apply_scales(self.chain.links[link.parent], step, columns)
                step = to_world(pose.axes[link.parent], step)
            yield column, step

    def _stretches(
        self, joint: int, link: Link, columns: Floats, pose: Pose
    ) -> Iterator[tuple[int, Ints, Floats]]:
        """Lengths and scales: channel, targets, and their displacements a unit."""
        if not link.lengths and not link.scales:
            return
        axes = pose.axes[joint]
        tails = {
            tail: np.array([n for n in self.below[joint] if self.list[n] in fastened], np.int64)
            for tail, fastened in self._targets_by_tail(joint, link)
        }
        if link.direction is not None:
            step = to_world(axes, self.chain.apply_scales(link, link.direction[:, None], columns))
            moved = [*tails.values(), *(self.below[child] for child in self.children[joint])]
            for column in link.lengths:
                for some in moved:
                    yield column, some, step
        vectors = [
            (some, self.chain.apply_lengths(link, link.tails[tail][:, None], columns))
            for tail, some in tails.items()
        ]
        vectors += [(self.below[child], pose.arms[child]) for child in self.children[joint]]
        for component, column in link.scales:
            for some, vector in vectors:
                yield column, some, axes[:, component] * (vector[component] / self.lever)

    @staticmethod
    def _targets_by_tail(joint: int, link: Link) -> Iterator[tuple[int, set[Target]]]:
        for tail in range(len(link.tails)):
            yield tail, {Target(joint, tail, axis) for axis in (-1, 0, 1, 2)}


def _cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors (3, F or 1) and (n, 3, F)."""
    result = np.empty(np.broadcast_shapes(a[None].shape, b.shape))
    result[:, 0] = a[1] * b[:, 2] - a[2] * b[:, 1]
    result[:, 1] = a[2] * b[:, 0] - a[0] * b[:, 2]
    result[:, 2] = a[0] * b[:, 1] - a[1] * b[:, 0]
    return result


def unsolved_channels(skeleton: Skeleton) -> tuple[str, ...]:
    """The channels, ``joint.channel``, that inverse kinematics leaves at 0: they move no target."""
    units = Targets(skeleton, markers=False).units
    pairs = zip(skeleton.channel_addresses(), units, strict=True)
    return tuple(name for name, unit in pairs if not unit)
