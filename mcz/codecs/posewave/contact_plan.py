"""Contact plan of a segment: the held points, and the channels that move them.

SPEC.md, "Held contacts", is normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from construct import Float32l, Int8ul

from mcz.codecs.posewave.skeleton_plan import PLAIN, Plan, limit_number, orientation
from mcz.codecs.posewave.trigonometry import RULES
from mcz.errors import FormatError
from mcz.kernels.types import Floats, Floats2, Ints
from mcz.model.motion import Skeleton
from mcz.model.schema import UVARINT, Record, bounded, counted, field

MAX_POINTS = 8
MAX_ROUNDS = 6
MAX_RAMP = 64
START_UNITS = 16  # of a step, for the place at which a contact begins
MOST_STEPS = 4.0  # limit of a channel's correction, in greatest steps


class PointFields(Record):
    """A point that is held in its place, in CONTACTS."""

    joint: int = field(UVARINT, "whose point it is")
    tail: int = field(UVARINT, "0: the origin of the joint; else the number of a tail, from 1")
    step: float = field(
        bounded(Float32l, 2.0**-60, 2.0**60),
        "grid of its displacements, in length units, 2^-60 to 2^60",
    )  # HOLD-04
    follows: int = field(UVARINT, "0, or the number of an earlier point that moves alike, from 1")


class ContactsFields(Record):
    """Contacts of posewave."""

    rounds: int = field(
        bounded(Int8ul, 1, MAX_ROUNDS), "in which a pose is corrected, 1 to 6"
    )  # HOLD-02
    ramp: int = field(
        bounded(Int8ul, 0, MAX_RAMP),
        "frames before and after a contact in which its correction comes and goes, 0 to 64",
    )  # HOLD-02
    points: list[PointFields] = field(
        counted(PointFields, MAX_POINTS), "that are held, 1 to 8"
    )  # HOLD-03


@dataclass(frozen=True, slots=True)
class Contacts:
    """The fields of ContactsFields, checked against a skeleton.

    ``joints`` and ``steps`` of the points, and their positions ``tails`` (n_points, 3) along the
    joint's B. ``follows``: the number of another point, from 1, or 0.
    """

    rounds: int
    ramp: int
    joints: tuple[int, ...]
    tails: Floats
    steps: tuple[float, ...]
    follows: tuple[int, ...]


class HeldPoints(NamedTuple):
    """The points of contacts in a segment, for the kernels.

    ``joints`` (n_points,) and ``tails`` (n_points, 3), along the joint's B; ``roots`` (n_points,)
    are their root joints. ``chains`` are the kept channels that move a point, ascending, those of
    point k from ``starts[k]`` on. ``limits`` (n_kept,): greatest correction of a channel;
    ``columns`` (n_kept,).
    """

    joints: Ints
    tails: Floats2
    roots: Ints
    chains: Ints
    starts: Ints
    limits: Floats
    columns: Ints


def parse_contacts(
    fields: Sequence[ContactsFields], skeleton: Skeleton, where: str
) -> Contacts | None:
    """Check the fields; raises FormatError where they do not fit the skeleton."""
    for record in fields:
        if not record.points:  # HOLD-03
            raise FormatError(f"{where}: contacts need at least one point")
        for number, point in enumerate(record.points):
            if point.follows > number:  # HOLD-06
                raise FormatError(
                    f"{where}: point {number + 1} cannot follow point {point.follows}"
                )
        return Contacts(
            rounds=record.rounds,
            ramp=record.ramp,
            joints=tuple(point.joint for point in record.points),
            tails=np.array([_rest_place(skeleton, p.joint, p.tail, where) for p in record.points]),
            steps=tuple(point.step for point in record.points),
            follows=tuple(point.follows for point in record.points),
        )
    return None


def _rest_place(
    skeleton: Skeleton, joint: int, tail: int, where: str
) -> tuple[float, float, float]:
    if joint >= skeleton.n_joints or tail > len(skeleton.joints[joint].tails):  # HOLD-05
        raise FormatError(
            f"{where}: contacts refer to point {tail} of joint {joint}, which does not exist"
        )
    if not tail:
        return 0.0, 0.0, 0.0
    x, y, z = (limit_number(x) for x in skeleton.joints[joint].tails[tail - 1])
    m = orientation(skeleton.joints[joint], RULES[skeleton.angle_unit])
    a, b, c = (m[0][k] * x + m[1][k] * y + m[2][k] * z for k in range(3))
    return a, b, c


def path_of(parents: Sequence[int] | Ints, joint: int) -> list[int]:
    """The joints from the root down to ``joint``."""
    path = [joint]
    while parents[path[-1]] >= 0:
        path.append(int(parents[path[-1]]))
    return path[::-1]


def make_held_points(contacts: Contacts, plan: Plan, columns: Ints, greatest: Floats) -> HeldPoints:
    """Build the held points on a plan; ``columns`` and ``greatest`` steps of the kept channels."""
    paths = [path_of(plan.parents, joint) for joint in contacts.joints]
    is_chained = plan.joints != PLAIN
    chains = [np.flatnonzero(is_chained & np.isin(plan.joints, path)) for path in paths]
    return HeldPoints(
        joints=np.array(contacts.joints, np.int64),
        tails=contacts.tails,
        roots=np.array([path[0] for path in paths], np.int64),
        chains=np.concatenate(chains).astype(np.int64),
        starts=np.cumsum([0, *map(len, chains)], dtype=np.int64),
        limits=MOST_STEPS * greatest,
        columns=columns.astype(np.int64),
    )
