"""Joints of body models: names and parents, as annex ``body_trees.json`` has them, and skeletons.

How long bones are is not in it: ``body_models`` finds that in a model file of the user's own, or
in positions that a data set has.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache

import numpy as np

from mcz.errors import OptionError
from mcz.model.annexes import annex_bytes
from mcz.model.motion import (
    ORIGIN,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    VECTOR_KINDS,
    Channel,
    Joint,
    Skeleton,
)
from mcz.model.types import Items

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
    raise OptionError(f"no body tree {which!r}: there are {known}")


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
        raise OptionError(f"joints turned by {turns!r}: one of {', '.join(filter(None, TURNS))}")
    if offsets is not None:
        offsets = np.asarray(offsets, np.float64)
        if offsets.shape != (body.n_joints, 3) or not np.isfinite(offsets).all():
            raise OptionError(
                f"offsets of shape {offsets.shape} for the {body.n_joints} joints of {body.title}: "
                f"({body.n_joints}, 3) finite numbers are wanted"
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
