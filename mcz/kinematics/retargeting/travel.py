"""Position channels of a skeleton that is to move as another does: the root's way, and others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mcz.errors import OptionError
from mcz.kinematics import reach
from mcz.kinematics.chain import Floats, to_world
from mcz.kinematics.rest_pose import rest_positions
from mcz.kinematics.retargeting.channels import moves
from mcz.kinematics.retargeting.matching import nearest_above
from mcz.kinematics.retargeting.turns import back
from mcz.model.motion import POSITION_KINDS, Skeleton

ROUNDING = 1e-9  # of the skeleton's reach: no way at all


@dataclass(frozen=True, slots=True)
class Travel:
    """``values`` (n_frames, n_channels) of ``source`` and ``origins`` of its joints, for a target.

    ``pairs`` has joints of the source by joints of the target, ``scale`` is in length units of the
    target per length unit of the source.
    """

    source: Skeleton
    target: Skeleton
    pairs: Mapping[int, int]
    scale: float
    values: Floats
    origins: Floats

    def set(self, columns: Floats, rest: Mapping[int, Floats]) -> None:
        """Write all position channels of the target into ``columns``, (n_channels, F).

        ``rest`` has, of each joint of ``pairs`` and of -1, what its rest pose is turned by.
        """
        ways: dict[int, Floats] = {}  # of joints, from where they are at rest on their parent
        for joint, other in self.pairs.items():
            above = nearest_above(self.target, joint, self.pairs)
            if above < 0:
                carrier = self._carrier(joint, other)
                if carrier >= 0 and carrier not in ways:
                    ways[carrier] = self._way(joint, other)
            elif moves(self.target.joints[joint].channels):
                step = self.scale * self._step(other)
                ways[joint] = to_world(back(rest[above]), step)
        for joint, way in ways.items():
            self._check(joint, way)
        for joint in range(self.target.n_joints):
            self._write(joint, ways.get(joint), columns)

    def _carrier(self, joint: int, other: int) -> int:
        """The joint whose position channels carry ``joint``: itself or the nearest above it.

        -1 where none has any, and nothing has to be carried. Raises OptionError.
        """
        carrier = joint
        while carrier >= 0 and not moves(self.target.joints[carrier].channels):
            carrier = self.target.joints[carrier].parent
        place = self.origins[:, other]
        known = place[np.isfinite(place).all(axis=1)]
        if carrier < 0 and len(known) and (known != known[0]).any():
            raise OptionError(
                f"retarget: joint {self.source.joint_names[other]!r} moves about, and of the "
                f"skeleton neither {self.target.joint_names[joint]!r} nor a joint above it has "
                "position channels"
            )
        return carrier

    def _check(self, joint: int, way: Floats) -> None:
        """Raise OptionError where a joint has to go where no position channel leads."""
        kinds = {channel.kind for channel in self.target.joints[joint].channels}
        least = ROUNDING * reach(self.target)
        for kind, track in zip(POSITION_KINDS, way, strict=True):
            if kind not in kinds and (np.abs(track) > least).any():
                raise OptionError(
                    f"retarget: joint {self.target.joint_names[joint]!r} of the skeleton has no "
                    f"channel {kind}, along which the motion moves it"
                )

    def _way(self, joint: int, other: int) -> Floats:
        """Shift of ``joint`` from its rest, (3, F): all above it is at rest."""
        rest = rest_positions(self.target)[joint]
        way: Floats = self.scale * self.origins[:, other].T - rest[:, None]
        return way

    def _step(self, other: int) -> Floats:
        """Shift that position channels of the source's joint add to its offset, (3, F)."""
        joint = self.source.joints[other]
        step = np.zeros((3, len(self.values)))
        for channel, column in zip(joint.channels, self.source.columns(other), strict=True):
            if channel.kind in POSITION_KINDS:
                component = POSITION_KINDS.index(channel.kind)
                step[component] = self.values[:, column]
                if not joint.adds_to_offset:
                    step[component] -= joint.offset[component]
        return step

    def _write(self, index: int, way: Floats | None, columns: Floats) -> None:
        joint = self.target.joints[index]
        for channel, column in zip(joint.channels, self.target.columns(index), strict=True):
            if channel.kind in POSITION_KINDS:
                component = POSITION_KINDS.index(channel.kind)
                columns[column] = 0.0 if way is None else way[component]
                if not joint.adds_to_offset:
                    columns[column] += joint.offset[component]
