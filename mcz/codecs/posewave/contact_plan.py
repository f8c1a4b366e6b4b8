"""Limbs: points that contacts hold, and the channels above them that give way.

SPEC.md, "Held contacts", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from construct import ExprValidator, Float32l, Int8ul, Struct

from mcz.codecs.posewave.skeleton_plan import Floats, Ints, limited, orientation
from mcz.codecs.posewave.turns import RULES
from mcz.errors import FormatError
from mcz.motion import POSITION_KINDS, ROTATION_KINDS, Skeleton
from mcz.schema import UVARINT, counted

MAX_LIMBS = 16
MAX_CHAIN = 12  # channels of a limb
MAX_JOINTS = 64  # from the root to the point of a limb
MAX_ROUNDS = 16

# Of a contact: its first frame, how many there are; frames that lead in and out; whether its
# anchor is on the fine grid, and the anchor.
FIRST, N_FRAMES, LEAD, FADE, FINE, X, Y, Z, N_FIELDS = range(9)
USUAL_FADE = 8  # frames

LIMB = Struct(
    "joint" / UVARINT * "whose point it is",
    "tail" / UVARINT * "0: the origin of the joint; else the number of a tail, from 1",
    "step"
    / ExprValidator(Float32l, lambda x, ctx: 2.0**-60 <= x <= 2.0**60)
    * "grid of its displacements, in length units, 2^-60 to 2^60",
    "columns" / counted(UVARINT, MAX_CHAIN) * "of the rotation channels that give way, ascending",
)
CONTACTS = Struct(
    "rounds"
    / ExprValidator(Int8ul, lambda n, ctx: 1 <= n <= MAX_ROUNDS)
    * "in which a pose is found, 1 to 16",
    "limbs" / counted(LIMB, MAX_LIMBS) * "in the order in which they are corrected",
)


class Limb(NamedTuple):
    """A point and what is above it, as the kernels want it.

    ``joints`` (n_path,) from the root to the point's; ``base`` (3,), where the root is but for its
    position channels; ``tail`` (3,), the point along the B of its joint; ``columns`` (n_chain,) of
    the channels that give way, ``order`` (n_channels,) each one's number among them or -1;
    ``fixed``, how many joints of the path come before the first that gives way.
    """

    joints: Ints
    base: Floats
    tail: Floats
    columns: Ints
    order: Ints
    fixed: int


@dataclass(frozen=True, slots=True)
class Contacts:
    """The fields of CONTACTS, checked against a skeleton."""

    rounds: int
    limbs: tuple[Limb, ...]
    steps: tuple[float, ...]


def parse_contacts(fields: Sequence[Any], skeleton: Skeleton, where: str) -> Contacts | None:
    """Raises FormatError where the fields do not fit the skeleton."""
    for found in fields:
        limbs = [make_limb(skeleton, x.joint, x.tail, list(x.columns), where) for x in found.limbs]
        return Contacts(found.rounds, tuple(limbs), tuple(x.step for x in found.limbs))
    return None


def path_of(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints from the root down to ``joint``."""
    path = [joint]
    while skeleton.joints[path[0]].parent >= 0:
        path.insert(0, skeleton.joints[path[0]].parent)
    return path


def make_limb(skeleton: Skeleton, joint: int, tail: int, columns: list[int], where: str) -> Limb:
    """Raises FormatError where a skeleton has no such limb."""
    if joint >= skeleton.n_joints or tail > len(skeleton.joints[joint].tails):
        raise FormatError(f"{where}: no point {tail} of joint {joint}")
    path = path_of(skeleton, joint)
    if len(path) > MAX_JOINTS:
        raise FormatError(f"{where}: {len(path)} joints above a point, {MAX_JOINTS} at most")
    turning = [
        [c for c in skeleton.columns(j) if skeleton.channels[c].kind in ROTATION_KINDS]
        for j in path
    ]
    allowed = {column for own in turning for column in own}
    if sorted(set(columns)) != columns or not allowed.issuperset(columns):
        raise FormatError(f"{where}: channels {columns} do not turn joint {joint}")
    order = np.full(skeleton.n_channels, -1, np.int64)
    order[columns] = np.arange(len(columns))
    touched = [n for n, own in enumerate(turning) if not set(own).isdisjoint(columns)]
    return Limb(
        joints=np.array(path, np.int64),
        base=_base(skeleton, path[0]),
        tail=_tail(skeleton, joint, tail),
        columns=np.array(columns, np.int64),
        order=order,
        fixed=min(touched, default=len(path)),
    )


def _base(skeleton: Skeleton, root: int) -> Floats:
    joint = skeleton.joints[root]
    replaced = set() if joint.adds_to_offset else {channel.kind for channel in joint.channels}
    pairs = zip(POSITION_KINDS, joint.offset, strict=True)
    return np.array([0.0 if kind in replaced else limited(x) for kind, x in pairs])


def _tail(skeleton: Skeleton, joint: int, tail: int) -> Floats:
    if not tail:
        return np.zeros(3)
    x, y, z = (limited(x) for x in skeleton.joints[joint].tails[tail - 1])
    m = orientation(skeleton.joints[joint], RULES[skeleton.angle_unit])
    return np.array([m[0][k] * x + m[1][k] * y + m[2][k] * z for k in range(3)])
