"""Skeletons of arrays: of body models (annex ``body_trees.json``), and of what callers name.

How long bones are is not in it: ``body_models`` finds that in a model file of the user's own, or
in positions that a data set has.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from mcz.errors import MotionError, OptionError
from mcz.model.extras import annex_bytes
from mcz.model.motion import (
    ORIGIN,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    VECTOR_KINDS,
    Channel,
    Joint,
    Motion,
    Skeleton,
)
from mcz.model.types import Items
from mcz.sources.robots import N_ROOT, robot_layouts, with_robot_layout

ANNEX = "body_trees.json"
METER_CM = 100.0
TURNS = {"rotvec": VECTOR_KINDS, "quat": QUATERNION_KINDS, "euler": ROTATION_KINDS, "": ()}


@dataclass(frozen=True, slots=True)
class BodyTree:
    """The joints of a body model: parents before children, -1 is the parent of the root."""

    name: str
    title: str
    names: tuple[str, ...]
    parents: tuple[int, ...]

    @property
    def n_joints(self) -> int:
        return len(self.names)


def tree(which: str | int) -> BodyTree:
    """The tree of a name, "smpl", "smplh", "smplx" or "humanml3d", or of a number of joints.

    Raises OptionError where there is none.
    """
    trees = _trees()
    for each in trees.values():
        if which in (each.name, each.n_joints):
            return each
    known = ", ".join(f"{each.name} ({each.n_joints} joints)" for each in trees.values())
    raise OptionError(f"unknown body tree {which!r}; the body trees are {known}")


def has_tree(which: str | int) -> bool:
    """Return True if there is a tree of that name or number of joints."""
    return any(which in (each.name, each.n_joints) for each in _trees().values())


@cache
def _trees() -> dict[str, BodyTree]:
    rows = json.loads(annex_bytes(ANNEX))
    trees = (
        BodyTree(
            row["name"],
            row["title"],
            tuple(joint["name"] for joint in row["joints"]),
            tuple(joint["parent"] for joint in row["joints"]),
        )
        for row in rows
    )
    return {each.name: each for each in trees}


def body_skeleton(
    body: BodyTree | str | int,
    offsets: Items | None = None,
    *,
    turns: str = "rotvec",
    moves: bool = True,
    unit_cm: float | None = METER_CM,
    angle_unit: str = "rad",
    up_axis: str = "",
) -> Skeleton:
    """A skeleton of the joints of ``body``, a tree or what ``tree`` takes, each with its turns.

    ``offsets`` (n_joints, 3), in length units, lead from each parent to its joint; that of the
    root is where the root is while its positions are 0. Without them all bones have no length.
    ``turns`` is "rotvec", "quat", "euler" (rx ry rz) or "" for none; with ``moves`` the root has
    tx ty tz before these. Raises OptionError where ``offsets`` do not match.
    """
    body = body if isinstance(body, BodyTree) else tree(body)
    if turns not in TURNS:
        raise OptionError(
            f"unknown turns {turns!r}; they must be one of {', '.join(filter(None, TURNS))}"
        )
    if offsets is not None:
        offsets = np.asarray(offsets, np.float64)
        if offsets.shape != (body.n_joints, 3) or not np.isfinite(offsets).all():
            raise OptionError(
                f"offsets have shape {offsets.shape}; the {body.n_joints} joints of "
                f"{body.title} need ({body.n_joints}, 3) finite numbers"
            )
    joints = []
    for index, (name, parent) in enumerate(zip(body.names, body.parents, strict=True)):
        kinds = (*POSITION_KINDS, *TURNS[turns]) if moves and parent < 0 else TURNS[turns]
        offset = ORIGIN if offsets is None else tuple(offsets[index].tolist())
        joints.append(Joint(name, parent, offset, channels=tuple(map(Channel, kinds))))
    return Skeleton(
        tuple(joints), body.title, unit_cm=unit_cm, angle_unit=angle_unit, up_axis=up_axis
    )


skeleton_of = body_skeleton


KINDS = {
    "positions": ("tx", "ty", "tz"),
    "rotation-vectors": ("vx", "vy", "vz"),
    "quaternions-wxyz": ("qw", "qx", "qy", "qz"),
    "quaternions-xyzw": ("qx", "qy", "qz", "qw"),
}


def kinds_of(name: str) -> tuple[str, ...]:
    """The channel kinds of a joint, () of a robot; raises OptionError for an unknown name."""
    if name not in KINDS and name not in robot_layouts():
        raise OptionError(
            f"arrays is {name!r}; it must be one of {', '.join((*KINDS, *robot_layouts()))}"
        )
    return KINDS.get(name, ())


def with_kinds(motion: Motion, name: str) -> Motion:
    """``motion``, one of plain numbers, as joints of what ``name`` says, named by their number.

    A robot layout names the columns of tables, too.

    A motion of anything else is returned as it is. Raises OptionError for an unknown name, and
    MotionError where the numbers of a frame are no such joints.
    """
    kinds = kinds_of(name)
    source, skeleton = motion.source, motion.skeleton
    if source is None or source.format not in ("npy", "npz", "pickle", "torch", "csv"):
        return motion
    if any(channel.kind for channel in skeleton.channels):
        return motion
    if not kinds:
        return _as_robot(motion, name)
    if source.format == "csv":
        return motion
    n_joints, rest = divmod(skeleton.n_channels, len(kinds))
    odd = {len(joint.channels) for joint in skeleton.joints} - {1, len(kinds)}
    if rest or odd:
        each = odd.pop() if odd else skeleton.n_channels
        raise MotionError(f"{name} have {len(kinds)} numbers a joint, but the array has {each}")
    channels = tuple(map(Channel, kinds))
    joints = tuple(Joint(str(number), channels=channels) for number in range(n_joints))
    angle_unit = "rad" if name == "rotation-vectors" else skeleton.angle_unit
    named = Skeleton(
        joints,
        skeleton.name,
        unit_cm=skeleton.unit_cm,
        angle_unit=angle_unit,
        up_axis=skeleton.up_axis,
        forward_axis=skeleton.forward_axis,
        handedness=skeleton.handedness,
    )
    return replace(motion, skeleton=named)


def _as_robot(motion: Motion, name: str) -> Motion:
    robot = with_robot_layout(motion, name)
    if robot is None:
        n = len(robot_layouts()[name].joints)
        raise MotionError(
            f"{name} has {n} columns, or {n + N_ROOT} with the root, but the array has "
            f"{motion.skeleton.n_channels}"
        )
    return robot
