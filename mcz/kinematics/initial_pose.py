"""A first guess of inverse kinematics: joint after joint from the roots down, all frames together.

Each joint turns so that its targets point in the given directions, as nearly as its own channels
allow: by the rotation nearest to rest among the best (Kabsch's), or, where it lacks one of the
three freedoms, angle by angle, since the best of one angle is known in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcz.kinematics.chain import Link, Pose, multiply_matrices
from mcz.kinematics.rotation_fit import set_turns
from mcz.kinematics.targets import Targets
from mcz.model.types import Floats

FARTHER = 0.01  # the weight of targets below the next turning joint, if they count at all
# ratio of the second singular value to the first: below it targets lie on one line, the roll is
# open
LINE = 1e-3
FAR_LINE = 0.3  # the same where other joints may have bent the targets
TO_REST = 1e-6  # keeps channels that no target determines at rest
LINE_TO_REST = 1e-2  # the same for targets on a line


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
        """The targets that turn with the joint, and farther ones where those are on a line."""
        origin = pose.origins[joint][:, 0]
        axes = pose.axes[joint][:, :, 0]
        below = [int(number) for number in self.targets.below[joint]]
        steps = {number: self._steps(joint, number) for number in below}
        numbers, spread = self._choose_targets(joint, steps, positions - origin)
        own = [n for n, t in enumerate(self.targets.list) if t.joint == joint and t.axis < 0]
        at_origin = [n for n in own if self.targets.list[n].tail < 0]
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

        Targets that no other joint bends, unless they all lie at the joint's origin. A root whose
        own targets are on one line is turned about it by the nearest ones that are not, for it may
        face anywhere; any other joint stays as near to rest as possible.
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

    def columns(self, seen: Floats, known: Floats) -> Floats:
        """Values (n_channels, F) for positions seen, (n_targets, 3, F), where ``known`` is 1.

        A joint without a known target keeps the angles of the frame before.
        """
        columns = self.targets.neutral(seen.shape[2])
        pose = Pose([], [], [], [])
        for joint, link in enumerate(self.chain.links):
            hung = self.chain.place_joint(pose, link, columns)
            if link.turns or link.moves:
                self._fit(joint, link, hung, seen, known, columns)
                hung = self._move_joint(joint, link, hung, seen, known, columns, pose)
            self.chain.add(pose, link, hung, columns)
        return columns

    def _fit(
        self,
        joint: int,
        link: Link,
        hung: tuple[Floats, Floats, Floats],
        seen: Floats,
        known: Floats,
        columns: Floats,
    ) -> None:
        """Set the joint's angles so that its targets lie in the directions seen."""
        body = self.fastened[joint]
        if not link.turns or not len(body.numbers):
            return
        weights = known[body.numbers] * body.weights[:, None]
        moment = self._moment(joint, link, hung[1], seen, known, weights)
        axes = np.broadcast_to(hung[2], (3, 3, columns.shape[1]))
        local = multiply_matrices(np.swapaxes(axes, 0, 1), moment)
        size = np.sqrt((local * local).sum(axis=(0, 1)))
        local = local + np.eye(3)[:, :, None] * (body.to_rest * size + (size == 0))
        set_turns(link, local, columns, self.chain.radians)
        _fill_gaps(link, size > 0, columns)

    def _moment(
        self, joint: int, link: Link, origin: Floats, seen: Floats, known: Floats, weights: Floats
    ) -> Floats:
        """Sum of w b a', (3, 3, F): b as seen and a at rest, from the origin or from the mean."""
        body = self.fastened[joint]
        a = np.broadcast_to(body.positions[:, :, None], (*body.positions.shape, weights.shape[1]))
        b = seen[body.numbers]
        if body.origin >= 0:
            own = known[body.origin] > 0
            base = np.where(own, seen[body.origin], origin)
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
        hung: tuple[Floats, Floats, Floats],
        seen: Floats,
        known: Floats,
        columns: Floats,
        pose: Pose,
    ) -> tuple[Floats, Floats, Floats]:
        """Set the joint's position channels to where it was seen; return its placement."""
        body = self.fastened[joint]
        if not link.moves:
            return hung
        if body.origin >= 0:
            there, origin = known[body.origin] > 0, seen[body.origin]
        elif body.numbers:
            trial = Pose(list(pose.origins), list(pose.axes), list(pose.arms), list(pose.spins))
            self.chain.add(trial, link, hung, columns)
            arms = np.einsum("ijf,nj->nif", trial.axes[-1], body.positions)
            weights = known[body.numbers] * body.weights[:, None]
            total, there = weights.sum(axis=0), weights.sum(axis=0) > 0
            steps = weights[:, None] * (seen[body.numbers] - arms)
            origin = steps.sum(axis=0) / np.where(there, total, 1.0)
        else:
            return hung
        step = origin - hung[1]
        if link.parent >= 0:
            step = (np.swapaxes(pose.axes[link.parent], 0, 1) * step[None]).sum(axis=1)
            if link.parent_back is not None:
                step = link.parent_back.T @ step
        done: set[int] = set()
        for component, column in link.moves:
            if component not in done:
                columns[column] = np.where(there, step[component], 0.0)
                _interpolate_unknown(columns[column], there)
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
