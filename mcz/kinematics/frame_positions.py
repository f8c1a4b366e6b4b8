"""Point positions of a single frame, for live input."""

from __future__ import annotations

import numpy as np

from mcz.kinematics.chain import Chain, Floats
from mcz.kinematics.frame_kernels import position_points
from mcz.kinematics.kernel_tables import is_elaborate, tables_of
from mcz.kinematics.points import marker_distance, points_and_markers_of, points_of, positions_of
from mcz.motion import Skeleton

__all__ = ["FramePositions"]


class FramePositions:
    """Positions of the points of ``skeleton`` and, on request, its virtual markers.

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
        self._tables = None if is_elaborate(chain) else tables_of(chain, self._numbers, tails)

    def __call__(self, values: Floats) -> Floats:
        if self._tables is None:
            return self._from_batch(values)
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

    def _from_batch(self, values: Floats) -> Floats:
        if self._marked:
            both = points_and_markers_of(self._skeleton, values[None])
            positions: Floats = np.concatenate(both, axis=1)[0]
        else:
            positions = positions_of(self._skeleton, values[None])[0]
        return positions
