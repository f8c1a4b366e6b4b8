"""Point positions and joint rotations: ``FramePoses`` of many frames, ``FramePositions`` of one.

Compiled where the skeleton only turns and moves, from ``Chain`` otherwise: equal to 1e-9.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from mcz.kinematics.chain import IDENTITY, Chain, SkeletonKey
from mcz.kinematics.frame_kernels import Joints, Points, place_frames, position_points, turn_frames
from mcz.kinematics.points import (
    discard_infinite,
    listed_points,
    marker_distance,
    point_position,
    points_and_markers_of,
    points_of,
    positions_of,
)
from mcz.model.motion import Skeleton
from mcz.model.types import Floats


class FramePoses:
    """The poses of a skeleton. Joints and points are given by index, values in source units.

    Values are (n_frames, n_channels); channels of joints that are neither requested nor above a
    requested one are ignored. A result that depends on an invalid value is NaN. Raises as
    ``Chain``.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self.chain = Chain(skeleton)
        self._points = list(listed_points(skeleton))
        tails = [
            np.zeros(3) if tail < 0 else self.chain.links[joint].tails[tail]
            for joint, tail in self._points
        ]
        self._tails = np.array(tails).reshape(len(tails), 3)
        self._tables: tuple[Joints, Points] | None = None
        if not is_elaborate(self.chain):
            self._tables = tables_of(self.chain, [joint for joint, _ in self._points], tails)

    def above(self, joints: Sequence[int]) -> list[int]:
        """These joints and all above them, parents before children."""
        ancestors: set[int] = set()
        for joint in joints:
            while joint >= 0 and joint not in ancestors:
                ancestors.add(joint)
                joint = self.chain.links[joint].parent
        return sorted(ancestors)

    def joints_of(self, points: Sequence[int]) -> list[int]:
        """The joints that the points are fastened to."""
        return [self._points[point][0] for point in points]

    def tails(self) -> Floats:
        """From each point's joint to the point at rest, in the world's axes, (n_points, 3)."""
        tails = self._tails.copy()
        for point, (joint, _) in enumerate(self._points):
            own = self.chain.turned[joint]
            if own is not None:
                tails[point] = own @ tails[point]
        return tails

    def positions(self, values: Floats, points: Sequence[int]) -> Floats:
        """Positions of the points, (n_frames, n_points, 3) in length units."""
        out = np.empty((len(values), len(points), 3))
        if self._tables is None:
            for rows, columns, pose in self.chain.poses(values):
                for number, point in enumerate(points):
                    joint, tail = self._points[point]
                    out[rows, number] = point_position(self.chain, joint, tail, columns, pose).T
        else:
            known = self._tables[1]
            chosen = Points(known.joints[list(points)], known.tails[list(points)])
            self._place(values, self.joints_of(points), chosen, out, np.empty((0, 0, 3, 3)))
        discard_infinite(out)
        return out

    def origins(self, values: Floats, joints: Sequence[int]) -> Floats:
        """Origins of the joints, (n_frames, n_chosen, 3) in length units."""
        out = np.empty((len(values), len(joints), 3))
        if self._tables is None:
            for rows, _, pose in self.chain.poses(values):
                for number, joint in enumerate(joints):
                    out[rows, number] = pose.origins[joint].T
        else:
            chosen = Points(np.array(joints, np.int64), np.zeros((len(joints), 3)))
            self._place(values, joints, chosen, out, np.empty((0, 0, 3, 3)))
        discard_infinite(out)
        return out

    def world(self, values: Floats, joints: Sequence[int]) -> Floats:
        """World rotations W of the joints, (n_frames, n_chosen, 3, 3)."""
        n_joints = len(self.chain.links)
        if self._tables is None:
            out = np.empty((len(values), len(joints), 3, 3))
            for rows, _, pose in self.chain.poses(values):
                for number, joint in enumerate(joints):
                    out[rows, number] = np.moveaxis(pose.axes[joint], 2, 0)
        else:
            kept = np.empty((len(values), n_joints, 3, 3))
            none = Points(np.empty(0, np.int64), np.empty((0, 3)))
            self._place(values, joints, none, np.empty((len(values), 0, 3)), kept)
            out = kept[:, list(joints)]
        for number, joint in enumerate(joints):
            own = self.chain.turned[joint]
            if own is not None:
                out[:, number] = out[:, number] @ own.T  # W = B C^-1
        return out

    def local(self, values: Floats, joints: Sequence[int]) -> Floats:
        """Local rotations of the joints, W_parent^-1 W, (n_frames, n_chosen, 3, 3).

        The identity in the rest pose.
        """
        out = np.empty((len(values), len(joints), 3, 3))
        if self._tables is not None:
            turn_frames(_rows(values), self._tables[0], np.array(joints, np.int64), out)
            return out
        columns = np.ascontiguousarray(values.T)
        for number, joint in enumerate(joints):
            own = self.chain.turned[joint]
            axes = IDENTITY if own is None else own[:, :, None]
            with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
                turned = self.chain.apply_turns(self.chain.links[joint], axes, columns, [])
            turned = np.moveaxis(turned, 2, 0)
            out[:, number] = turned if own is None else turned @ own.T
        return out

    def _place(
        self, values: Floats, joints: Sequence[int], points: Points, out: Floats, kept: Floats
    ) -> None:
        assert self._tables is not None
        indices = np.array(self.above(joints), np.int64)
        place_frames(_rows(values), self._tables[0], indices, points, out, kept)


def _rows(values: Floats) -> Floats:
    return np.ascontiguousarray(values, np.float64)


def frame_poses_of(skeleton: Skeleton) -> FramePoses:
    """``FramePoses(skeleton)``, prepared once for repeated calls."""
    return _frame_poses_of(SkeletonKey(skeleton))


@lru_cache(maxsize=8)
def _frame_poses_of(key: SkeletonKey) -> FramePoses:
    return FramePoses(key.skeleton)


class FramePositions:
    """Positions of the points of ``skeleton`` and, on request, its virtual markers.

    Maps the channels of a frame, (n_channels,), to (n_places, 3) in length units, NaN where
    unknown. Results equal ``positions_of`` and ``virtual_markers_of`` to 1e-9, with the same
    errors.
    """

    def __init__(self, skeleton: Skeleton, *, virtual_markers: bool = False) -> None:
        self._skeleton, self._has_markers = skeleton, virtual_markers
        self._distance = marker_distance(skeleton) if virtual_markers else 0.0
        chain = Chain(skeleton)
        own = points_of(skeleton)
        self._numbers = [joint for joint, tails in enumerate(own) for _ in tails]
        tails = [
            np.zeros(3) if tail < 0 else chain.links[joint].tails[tail]
            for joint, joint_tails in enumerate(own)
            for tail in joint_tails
        ]
        self._firsts = [self._numbers.index(joint) for joint in range(skeleton.n_joints)]
        self._tables = None if is_elaborate(chain) else tables_of(chain, self._numbers, tails)

    def __call__(self, values: Floats) -> Floats:
        if self._tables is None:
            return self._from_batch(values)
        n_points, n_joints = len(self._numbers), self._skeleton.n_joints
        out = np.empty((n_points + (3 * n_joints if self._has_markers else 0), 3))
        origins, axes = np.empty((n_joints, 3)), np.empty((n_joints, 3, 3))
        filled = out[:n_points], origins, axes
        position_points(values, *self._tables, *filled)
        if self._has_markers:
            points = out[self._firsts][:, None]
            markers = points + self._distance * np.swapaxes(axes, 1, 2)
            out[n_points:] = markers.reshape(3 * n_joints, 3)
        out[~np.isfinite(out).all(axis=1)] = np.nan
        return out

    def _from_batch(self, values: Floats) -> Floats:
        if self._has_markers:
            both = points_and_markers_of(self._skeleton, values[None])
            positions: Floats = np.concatenate(both, axis=1)[0]
        else:
            positions = positions_of(self._skeleton, values[None])[0]
        return positions


def is_elaborate(chain: Chain) -> bool:
    """Return True if a joint has channels other than rotations and positions, or a repeated one."""
    return any(
        link.is_whole
        or link.scales
        or link.lengths
        or len({component for component, _ in link.moves}) < len(link.moves)
        for link in chain.links
    )


def tables_of(chain: Chain, points: list[int], tails: list[Floats]) -> tuple[Joints, Points]:
    """Skeleton tables for the kernels."""
    links = chain.links
    n_joints = len(links)
    most = max((len(link.turns) for link in links), default=0)
    moves = np.full((n_joints, 3), -1, np.int64)
    turns = np.full((n_joints, max(1, most), 2), -1, np.int64)
    changes, backs, owns = (np.tile(np.eye(3), (n_joints, 1, 1)) for _ in range(3))
    for joint, link in enumerate(links):
        for component, column in link.moves:
            moves[joint, component] = column
        for turn, pair in enumerate(link.turns):
            turns[joint, turn] = pair
        if link.change is not None:
            changes[joint] = link.change[:, :, 0]
        if link.parent_back is not None:
            backs[joint] = link.parent_back
        own = chain.turned[joint]
        if own is not None:
            owns[joint] = own
    joints = Joints(
        np.array([link.parent for link in links], np.int64),
        changes,
        np.array([link.offset for link in links]).reshape(n_joints, 3),
        backs,
        owns,
        np.array([link.replaces for link in links], np.int64),
        moves,
        turns,
        float(chain.radians),
    )
    return joints, Points(np.array(points, np.int64), np.array(tails).reshape(len(points), 3))
