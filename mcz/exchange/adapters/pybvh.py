"""``pybvh.Bvh``: Euler angles in radians, a root that moves, and end sites that are nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.exchange.conversion.hierarchy import is_bvh, to_bvh
from mcz.files.reading.source_files import SourceOptions
from mcz.model.checks import check_arguments
from mcz.model.extras import import_extra
from mcz.model.motion import (
    A_MOTION,
    POSITION_KINDS,
    ROTATION_KINDS,
    Channel,
    Joint,
    Motion,
    Signal,
    Skeleton,
    check_poses,
)
from mcz.model.types import Floats
from mcz.sources.tables.times import frame_rate

if TYPE_CHECKING:
    from pybvh import Bvh
    from pybvh.bvhnode import BvhJoint


def from_pybvh(bvh: Bvh, *, unit: str | None = None, up: str | None = None) -> Motion:
    """The motion in a ``pybvh.Bvh``, its numbers unchanged: angles in radians.

    The root's positions replace its offset, as in pybvh. ``unit`` ("cm", "m", ...) and ``up`` ("x"
    to "-z") state facts that it lacks. Raises OptionError for another object.
    """
    if not hasattr(bvh, "joint_angles"):
        raise OptionError(f"{type(bvh).__name__} is not a pybvh.Bvh; to read a file, use mcz.read")
    nodes = [node for node in bvh.nodes if not node.is_end_site()]
    ends = [node for node in bvh.nodes if node.is_end_site()]
    numbers = {id(node): number for number, node in enumerate(nodes)}
    joints = []
    for node in nodes:
        kinds = [*(POSITION_KINDS if node.parent is None else ())]
        kinds += [f"r{axis.lower()}" for axis in node.rot_channels]
        joints.append(
            Joint(
                node.name,
                -1 if node.parent is None else numbers[id(node.parent)],
                tuple(node.offset.tolist()),
                tuple(tuple(end.offset.tolist()) for end in ends if end.parent is node),
                channels=tuple(map(Channel, kinds)),
                adds_to_offset=node.parent is not None,
            )
        )
    values = np.concatenate([bvh.root_pos, bvh.joint_angles.reshape(len(bvh.root_pos), -1)], axis=1)
    rate, exact = frame_rate(repr(float(bvh.frame_time)))
    known = np.isfinite(values)
    signal = Signal(values, mask=None if known.all() else known)
    skeleton = Skeleton(tuple(joints), angle_unit="rad")
    name = Path(bvh.source_path).stem if bvh.source_path else "motion"
    motion = Motion(skeleton, (signal,), rate, exact, name)
    return SourceOptions(unit=unit, up=up).applied_to(motion)


@check_arguments(motion=A_MOTION)
def to_pybvh(motion: Motion) -> Bvh:
    """``motion`` as a ``pybvh.Bvh``; needs pybvh (``mcz[pybvh]``).

    Angles in radians are kept, those in degrees are converted; another skeleton becomes joints of
    BVH first, as in ``mcz.convert``. Raises MotionError if pybvh cannot hold it: unknown values,
    several roots, joints that move relative to their parent, markers, signals other than the
    motion.
    """
    pybvh = import_extra("pybvh", "pybvh")
    check_poses(motion.name, motion.signals[0])
    tree = _Tree(motion)
    order = list(tree.depth_first())
    nodes: list[BvhJoint] = []
    by_joint: dict[int, BvhJoint] = {}
    angles = np.empty((motion.n_frames, len(order), 3))
    for number, joint in enumerate(order):
        axes, angles[:, number] = tree.turns(joint)
        parent = by_joint.get(tree.joints[joint].parent)
        name = tree.names[joint]
        offset = np.array(tree.offsets[joint])
        if parent is None:
            by_joint[joint] = pybvh.bvhnode.BvhRoot(name, offset, rot_channels=axes)
        else:
            by_joint[joint] = pybvh.bvhnode.BvhJoint(name, offset, axes, parent=parent)
            parent.children = [*parent.children, by_joint[joint]]
        nodes.append(by_joint[joint])
        for at, tail in enumerate(tree.joints[joint].tails):
            end = f"EndSite{name}" + (f"#{at}" if at else "")  # the names that pybvh uses
            site = pybvh.bvhnode.BvhEndSite(end, np.array(tail), by_joint[joint])
            by_joint[joint].children = [*by_joint[joint].children, site]
            nodes.append(site)
    up = motion.skeleton.up_axis or "auto"
    return pybvh.Bvh(
        nodes,
        tree.root_places(),
        angles,
        float(1 / motion.frame_rate) if motion.frame_rate else 0,
        world_up=f"+{up}" if len(up) == 1 else up,
        warn_on_disagreement=False,
    )


class _Tree:
    """A motion whose joints have three angles and keep their offsets, except the root."""

    def __init__(self, motion: Motion) -> None:
        if not np.isfinite(motion.values).all():
            raise MotionError(
                "some values are missing, which pybvh does not support", clip=motion.name
            )
        skeleton = motion.skeleton
        in_degrees = replace(skeleton, angle_unit="deg")
        if skeleton.angle_unit == "rad" and len(motion.signals) == 1 and is_bvh(in_degrees):
            self.motion, self.to_radians = motion, False
        else:
            self.motion, self.to_radians = to_bvh(motion), True
        self.joints = self.motion.skeleton.joints
        self.names = self.motion.skeleton.addresses()
        self.values = np.asarray(self.motion.values, np.float64)
        self.starts = self.motion.skeleton.column_starts()
        if [joint.parent for joint in self.joints].count(-1) != 1:
            raise MotionError("pybvh supports exactly one root", clip=motion.name)
        self.offsets = [self._offset(joint) for joint in range(len(self.joints))]

    def depth_first(self) -> Iterator[int]:
        """Yield the joints in the order of a BVH file, that of pybvh's columns."""
        below, waiting = self.motion.skeleton.children, [0]
        while waiting:
            yield (joint := waiting.pop())
            waiting += reversed(below[joint])

    def turns(self, joint: int) -> tuple[list[str], Floats]:
        """The axes of a joint's three angles, and the angles in radians, (n_frames, 3).

        Axes that it does not turn about come last, with zeros.
        """
        kinds = [channel.kind for channel in self.joints[joint].channels]
        own = [kind for kind in kinds if kind in ROTATION_KINDS]
        rest = [kind for kind in kinds if kind not in (*ROTATION_KINDS, *POSITION_KINDS)]
        if rest or len(set(own)) < len(own):
            raise MotionError(
                f"joint {self.names[joint]!r}: pybvh does not support channels {' '.join(kinds)}"
            )
        angles = np.zeros((len(self.values), 3))
        columns = [self.starts[joint] + kinds.index(kind) for kind in own]
        angles[:, : len(own)] = self.values[:, columns]
        order = [*own, *(kind for kind in ROTATION_KINDS if kind not in own)]
        return [kind[1].upper() for kind in order], np.deg2rad(
            angles
        ) if self.to_radians else angles

    def root_places(self) -> Floats:
        """Positions of the root, (n_frames, 3): in pybvh they replace its offset."""
        return self._places(0)

    def _places(self, joint: int) -> Floats:
        """Positions of a joint relative to its parent, (n_frames, 3)."""
        positions = np.tile(np.array(self.joints[joint].offset), (len(self.values), 1))
        for number, channel in enumerate(self.joints[joint].channels):
            if channel.kind in POSITION_KINDS:
                axis = POSITION_KINDS.index(channel.kind)
                channel_values = self.values[:, self.starts[joint] + number]
                positions[:, axis] = (
                    positions[:, axis] + channel_values
                    if self.joints[joint].adds_to_offset
                    else channel_values
                )
        return positions

    def _offset(self, joint: int) -> Floats:
        """A joint's offset, or its constant position if it has position channels."""
        if joint == 0:
            return np.array(self.joints[0].offset)
        places = self._places(joint)
        if (places != places[:1]).any():
            raise MotionError(
                f"joint {self.names[joint]!r} moves relative to its parent, which pybvh "
                "supports only for the root"
            )
        return places[0] if len(places) else np.array(self.joints[joint].offset)
