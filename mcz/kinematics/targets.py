"""Targets of inverse kinematics, and the first pose that approaches them.

A target is a position fastened to a joint: a point, or a virtual marker near the joint's first
point. Arrays of a block of frames have the frames last.

The first pose turns joint after joint, from the roots down, all frames together, so that the
targets of each point in the given directions as nearly as its own channels allow: by the rotation
nearest to rest among the best (Kabsch's), or, if it lacks one of the three freedoms, angle by
angle, since the best of one angle is known in closed form.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mcz.kinematics.chain import Chain, Link, Pose, multiply_matrices, to_world
from mcz.kinematics.points import marker_distance, point_position, points_of, reach
from mcz.kinematics.rotation_fit import set_turns
from mcz.model.motion import Skeleton
from mcz.model.types import Floats, Ints

TYPICAL_LEVER = 0.125  # of the reach: a turn by one radian counts as a move by this length


@dataclass(frozen=True, slots=True)
class JointTarget:
    """A point of ``joint``: tail number ``tail``, or its origin if -1; ``axis`` of a marker."""

    joint: int
    tail: int
    axis: int = -1


class Targets:
    """The targets of a skeleton in the order of their positions: points, then virtual markers.

    ``units``, (n_channels,): the source units of each channel that count as one length unit, the
    measure of all steps; 0 for channels that move no target.
    """

    def __init__(self, skeleton: Skeleton, *, markers: bool) -> None:
        self.skeleton, self.chain = skeleton, Chain(skeleton)
        own = points_of(skeleton)
        self.list = [JointTarget(joint, tail) for joint, tails in enumerate(own) for tail in tails]
        self.distance = marker_distance(skeleton) if markers else 0.0
        if markers:
            firsts = [tails[0] for tails in own]
            self.list += [
                JointTarget(j, tail, k) for j, tail in enumerate(firsts) for k in range(3)
            ]
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
            for column, numbers_of_step, step in self._stretches(joint, link, columns, pose):
                jacobian[column, numbers_of_step] += step
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
                for numbers in moved:
                    yield column, numbers, step
        vectors = [
            (numbers, self.chain.apply_lengths(link, link.tails[tail][:, None], columns))
            for tail, numbers in tails.items()
        ]
        vectors += [(self.below[child], pose.arms[child]) for child in self.children[joint]]
        for component, column in link.scales:
            for numbers, vector in vectors:
                yield column, numbers, axes[:, component] * (vector[component] / self.lever)

    @staticmethod
    def _targets_by_tail(joint: int, link: Link) -> Iterator[tuple[int, set[JointTarget]]]:
        for tail in range(len(link.tails)):
            yield tail, {JointTarget(joint, tail, axis) for axis in (-1, 0, 1, 2)}


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


FARTHER = 0.01  # weight of targets below the next turning joint, if they count
# ratio of the second singular value to the first: below it targets lie on one line, the roll is
# open
LINE = 1e-3
FAR_LINE = 0.3  # ``LINE`` for targets that other joints may have bent
TO_REST = 1e-6  # keeps channels that no target determines at rest
LINE_TO_REST = 1e-2  # ``TO_REST`` for targets on a line


@dataclass(frozen=True, slots=True)
class AttachedTargets:
    """Targets attached to a joint: numbers, weights, positions along its axes (n, 3).

    ``origin`` is the target at the joint's own origin, -1 if there is none.
    """

    numbers: list[int]
    weights: Floats
    positions: Floats
    origin: int
    to_rest: float


class InitialPose:
    """The guess for a skeleton, prepared once; ``columns`` returns values for a block of frames."""

    def __init__(self, targets: Targets) -> None:
        self.targets, self.chain = targets, targets.chain
        neutral = targets.neutral(1)
        pose = self.chain.pose(neutral)
        positions = targets.positions(neutral, pose)[:, :, 0]
        self.fastened = [
            self._attach_targets(joint, pose, positions) for joint in range(len(self.chain.links))
        ]

    def _attach_targets(self, joint: int, pose: Pose, positions: Floats) -> AttachedTargets:
        """The targets that turn with the joint, and farther ones if those are on a line."""
        origin = pose.origins[joint][:, 0]
        axes = pose.axes[joint][:, :, 0]
        below = [int(number) for number in self.targets.below[joint]]
        steps = {number: self._steps(joint, number) for number in below}
        numbers, spread = self._choose_targets(joint, steps, positions - origin)
        own_targets = [
            n for n, t in enumerate(self.targets.list) if t.joint == joint and t.axis < 0
        ]
        at_origin = [n for n in own_targets if self.targets.list[n].tail < 0]
        if not at_origin:
            at_origin = self._at_parents_tail(joint)
        return AttachedTargets(
            numbers,
            np.array(
                [1.0 if steps[number] == steps[numbers[0]] else FARTHER for number in numbers]
            ),
            (positions[numbers] - origin).reshape(-1, 3) @ axes,
            at_origin[0] if at_origin else -1,
            TO_REST if spread else LINE_TO_REST,
        )

    def _choose_targets(
        self, joint: int, steps: dict[int, int], arms: Floats
    ) -> tuple[list[int], bool]:
        """The targets to turn by, and whether they spread to two sides.

        These are targets that no other joint bends, unless all lie at the joint's origin. A root
        whose own targets lie on one line may face anywhere: the nearest targets off the line
        decide. Any other joint stays as near to rest as possible.
        """
        nearest: list[int] = []
        for step in range(max(steps.values(), default=-1) + 1):
            farther = [number for number in steps if steps[number] == step]
            numbers = nearest + farther
            sizes = np.linalg.svd(arms[numbers], compute_uv=False)
            if len(sizes) > 1 and sizes[1] > (FAR_LINE if nearest else LINE) * sizes[0]:
                return numbers, True
            nearest = nearest or (farther if sizes.any() else [])
            if nearest and self.chain.links[joint].parent >= 0:
                break
        return nearest, False

    def _steps(self, joint: int, number: int) -> int:
        """Number of movable joints between ``joint`` and the target of that number."""
        steps, below = 0, self.targets.list[number].joint
        while below != joint:
            link = self.chain.links[below]
            at_origin = self.targets.list[number].joint == below and self._is_origin(number)
            steps += bool(link.moves or (link.turns and not at_origin))
            below = link.parent
        return steps

    def _is_origin(self, number: int) -> bool:
        target = self.targets.list[number]
        return target.tail < 0 and target.axis < 0

    def _at_parents_tail(self, joint: int) -> list[int]:
        """The target that is the joint's origin because its parent ends there (Acclaim)."""
        link, bone = self.chain.links[joint], self.targets.skeleton.joints[joint]
        if link.parent < 0 or link.moves:
            return []
        tails = self.targets.skeleton.joints[link.parent].tails
        return [
            number
            for number, target in enumerate(self.targets.list)
            if target.joint == link.parent
            and target.axis < 0
            and target.tail >= 0
            and tails[target.tail] == bone.offset
        ]

    def columns(self, targets: Floats, known: Floats) -> Floats:
        """Values (n_channels, F) for positions ``targets`` (n_targets, 3, F), where ``known`` is 1.

        A joint without a known target keeps the angles of the previous frame.
        """
        columns = self.targets.neutral(targets.shape[2])
        pose = Pose([], [], [], [])
        for joint, link in enumerate(self.chain.links):
            placement = self.chain.place_joint(pose, link, columns)
            if link.turns or link.moves:
                self._fit(joint, link, placement, targets, known, columns)
                placement = self._move_joint(joint, link, placement, targets, known, columns, pose)
            self.chain.add(pose, link, placement, columns)
        return columns

    def _fit(
        self,
        joint: int,
        link: Link,
        placement: tuple[Floats, Floats, Floats],
        targets: Floats,
        known: Floats,
        columns: Floats,
    ) -> None:
        """Set the joint's angles so that its targets lie in the given directions."""
        body = self.fastened[joint]
        if not link.turns or not len(body.numbers):
            return
        weights = known[body.numbers] * body.weights[:, None]
        moment = self._moment(joint, link, placement[1], targets, known, weights)
        axes = np.broadcast_to(placement[2], (3, 3, columns.shape[1]))
        local = multiply_matrices(np.swapaxes(axes, 0, 1), moment)
        size = np.sqrt((local * local).sum(axis=(0, 1)))
        local = local + np.eye(3)[:, :, None] * (body.to_rest * size + (size == 0))
        set_turns(link, local, columns, self.chain.radians)
        _fill_gaps(link, size > 0, columns)

    def _moment(
        self,
        joint: int,
        link: Link,
        origin: Floats,
        targets: Floats,
        known: Floats,
        weights: Floats,
    ) -> Floats:
        """Sum of w b a', (3, 3, F): b given and a at rest, from the origin or from the mean."""
        body = self.fastened[joint]
        a = np.broadcast_to(body.positions[:, :, None], (*body.positions.shape, weights.shape[1]))
        b = targets[body.numbers]
        if body.origin >= 0:
            own = known[body.origin] > 0
            base = np.where(own, targets[body.origin], origin)
        elif link.moves:  # at any position
            total = np.maximum(weights.sum(axis=0), 1e-300)
            a = a - (weights[:, None] * a).sum(axis=0) / total
            base = (weights[:, None] * b).sum(axis=0) / total
        else:
            base = origin
        weighted = weights[:, None] * (b - base)
        result: Floats = np.einsum("nif,njf->ijf", weighted, a)
        return result

    def _move_joint(
        self,
        joint: int,
        link: Link,
        placement: tuple[Floats, Floats, Floats],
        targets: Floats,
        known: Floats,
        columns: Floats,
        pose: Pose,
    ) -> tuple[Floats, Floats, Floats]:
        """Set the joint's position channels to where it was seen; return its placement."""
        body = self.fastened[joint]
        if not link.moves:
            return placement
        if body.origin >= 0:
            is_known, origin = known[body.origin] > 0, targets[body.origin]
        elif body.numbers:
            trial = Pose(list(pose.origins), list(pose.axes), list(pose.arms), list(pose.spins))
            self.chain.add(trial, link, placement, columns)
            arms = np.einsum("ijf,nj->nif", trial.axes[-1], body.positions)
            weights = known[body.numbers] * body.weights[:, None]
            total, is_known = weights.sum(axis=0), weights.sum(axis=0) > 0
            steps = weights[:, None] * (targets[body.numbers] - arms)
            origin = steps.sum(axis=0) / np.where(is_known, total, 1.0)
        else:
            return placement
        step = origin - placement[1]
        if link.parent >= 0:
            step = (np.swapaxes(pose.axes[link.parent], 0, 1) * step[None]).sum(axis=1)
            if link.parent_back is not None:
                step = link.parent_back.T @ step
        done: set[int] = set()
        for component, column in link.moves:
            if component not in done:
                columns[column] = np.where(is_known, step[component], 0.0)
                _interpolate_unknown(columns[column], is_known)
            done.add(component)
        return self.chain.place_joint(pose, link, columns)


def _fill_gaps(link: Link, known: Floats, columns: Floats) -> None:
    for column in link.turning:
        _interpolate_unknown(columns[column], known)


def _interpolate_unknown(track: Floats, known: Floats) -> None:
    """Interpolate linearly in time the frames that are not ``known``."""
    rows = np.flatnonzero(known)
    if 0 < len(rows) < len(track):
        track[:] = np.interp(np.arange(len(track)), rows, track[rows])
