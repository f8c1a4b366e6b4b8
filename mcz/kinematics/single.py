"""Where the points of a skeleton are in one frame, for those who have frames one by one."""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import Chain, Floats
from mcz.kinematics.points import marker_distance, points_and_markers_of, points_of, positions_of
from mcz.kinematics.single_kernels import Joints, Points, position_points
from mcz.motion import Skeleton

__all__ = ["FramePositions"]


class FramePositions:
    """Positions of the points of ``skeleton``, and of its virtual markers where they are wanted.

    Called with the channels of a frame, (n_channels,), it gives (n_places, 3) in length units, NaN
    where a position is not known: the same as ``positions_of`` and ``virtual_markers_of`` to 1e-9.
    Raises as they do.
    """

    def __init__(self, skeleton: Skeleton, *, virtual_markers: bool = False) -> None:
        self._skeleton, self._marked = skeleton, virtual_markers
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
        self._tables = None if _is_elaborate(chain) else _tables(chain, self._numbers, tails)

    def __call__(self, values: Floats) -> Floats:
        if self._tables is None:
            return self._one_of_many(values)
        n_points, n_joints = len(self._numbers), self._skeleton.n_joints
        out = np.empty((n_points + (3 * n_joints if self._marked else 0), 3))
        origins, axes = np.empty((n_joints, 3)), np.empty((n_joints, 3, 3))
        filled = out[:n_points], origins, axes
        position_points(values, *self._tables, *filled)
        if self._marked:
            points = out[self._firsts][:, None]
            markers = points + self._distance * np.swapaxes(axes, 1, 2)
            out[n_points:] = markers.reshape(3 * n_joints, 3)
        out[~np.isfinite(out).all(axis=1)] = np.nan
        return out

    def _one_of_many(self, values: Floats) -> Floats:
        if self._marked:
            both = points_and_markers_of(self._skeleton, values[None])
            found: Floats = np.concatenate(both, axis=1)[0]
        else:
            found = positions_of(self._skeleton, values[None])[0]
        return found


def _is_elaborate(chain: Chain) -> bool:
    """Whether a joint has channels that do more than turn and move it, or one of them twice."""
    return any(
        link.quaternion
        or link.scales
        or link.lengths
        or len({component for component, _ in link.moves}) < len(link.moves)
        for link in chain.links
    )


def _tables(chain: Chain, points: list[int], tails: list[Floats]) -> tuple[Joints, Points]:
    """What the compiled loop knows of a skeleton."""
    links = chain.links
    n_joints = len(links)
    most = max((len(link.turns) for link in links), default=0)
    moves = np.full((n_joints, 3), -1, np.int64)
    turns = np.full((n_joints, max(1, most), 2), -1, np.int64)
    changes, backs = (np.tile(np.eye(3), (n_joints, 1, 1)) for _ in range(2))
    for joint, link in enumerate(links):
        for component, column in link.moves:
            moves[joint, component] = column
        for turn, pair in enumerate(link.turns):
            turns[joint, turn] = pair
        if link.change is not None:
            changes[joint] = link.change[:, :, 0]
        if link.parent_back is not None:
            backs[joint] = link.parent_back
    joints = Joints(
        np.array([link.parent for link in links], np.int64),
        changes,
        np.array([link.offset for link in links]).reshape(n_joints, 3),
        backs,
        np.array([link.replaces for link in links], np.int64),
        moves,
        turns,
        float(chain.radians),
    )
    return joints, Points(np.array(points, np.int64), np.array(tails).reshape(len(points), 3))
