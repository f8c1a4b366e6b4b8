"""Header of a ``posewave`` signal: steps, the metric, the levels.

SPEC.md, "Codec 3: posewave", is normative; the names below are its field names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from construct import Float32l, Int8ul

from mcz.codecs.contract import Layout
from mcz.codecs.parameters import code_of, ratio_of
from mcz.codecs.posewave.contact_plan import Contacts, ContactsFields, parse_contacts
from mcz.codecs.posewave.model import Prior, Start, priors, start_tables
from mcz.codecs.posewave.orders import N_ORDERS, check_orders, vector_codes
from mcz.errors import FormatError
from mcz.model.motion import (
    ANGLE_KINDS,
    POSITION_KINDS,
    QUATERNION_KINDS,
    ROTATION_KINDS,
    VECTOR_KINDS,
    Skeleton,
)
from mcz.model.schema import (
    UVARINT,
    Checked,
    CheckedInRecord,
    Record,
    bounded,
    build,
    counted,
    field,
    parse,
)
from mcz.model.skeleton import first_columns
from mcz.model.types import Bools, Floats

NAME = "posewave"
MAX_LEVELS = 8
MAX_FINE = 24
WHOLE_SHARE, SPREADS = 16, 32  # of ``shell``
START_TABLES = 16  # of ``start``: reserved number
REFINING, WHOLE_TURNS, VECTORS, DEPENDENT = 1, 2, 4, 8  # of ``flags``


class AxisOrderFields(Record):
    """The axis order of a joint, in the header of posewave."""

    joint: int = field(UVARINT, "joint that has it")
    code: int = field(
        bounded(Int8ul, 0, N_ORDERS), "its axis order, 1 to 6; 7: a rotation vector; 0: none"
    )  # PWAVE-23


class PosewaveHeader(Record):
    """Header of posewave."""

    levels: int = field(bounded(Int8ul, 0, MAX_LEVELS), "levels, 0 to 8")  # PWAVE-05
    borrowing: int = field(
        CheckedInRecord(Int8ul, lambda n, fields: n <= fields.levels),
        "finest levels of details that take the metric of the next coarser one",
    )  # PWAVE-06
    start: int = field(
        Int8ul, "bits 0-3: start table of the model, 0 or 1; 4-7: number of the prior; 0: none"
    )
    flags: int = field(
        bounded(Int8ul, 0, 15),
        "bit 0: rows have steps of their own; 1: whole turns in the metric; "
        "2: rotation vectors stand for three angles; 3: dependent quantization",
    )  # PWAVE-08
    step: float = field(
        bounded(Float32l, 2.0**-60, 2.0**60),
        "quantizer step of a row in the metric, in length units, 2^-60 to 2^60",
    )  # PWAVE-09
    radius: float = field(
        bounded(Float32l, 0, 2.0**60), "of the shell, in length units, 0 to 2^60"
    )  # PWAVE-10
    shell: int = field(
        Checked(Int8ul, lambda n: n % SPREADS <= WHOLE_SHARE),
        "bits 0-4: share of the shell in the metric, in sixteenths; "
        "5-7: spread, in octaves; 0: none",
    )  # PWAVE-11
    rotation: int = field(Int8ul, "step code of the greatest step of a rotation channel")
    position: int = field(Int8ul, "step code of the greatest step of a position channel")
    first: int = field(
        bounded(Int8ul, 0, MAX_FINE),
        "halvings from the greatest step to that of a segment's first values, 0 to 24",
    )  # PWAVE-12
    constant: int = field(
        bounded(Int8ul, 0, MAX_FINE),
        "halvings from there to the step of constant channels, 0 to 24",
    )  # PWAVE-12
    plain: list[int] = field(
        counted(Int8ul, 2**14),
        "of each channel of another kind the step code of its step; none: each 128, a step of 1",
    )
    weights: list[int] = field(
        counted(Int8ul, 2**14), "of each joint the step code of its weight; none: all 1"
    )
    orders: list[AxisOrderFields] = field(
        counted(AxisOrderFields, 2**14),
        "axis orders of joints that are not coded as their channels say",
    )
    exact: list[int] = field(
        counted(UVARINT, 2**14), "numbers of the groups whose channels are exact, ascending"
    )
    contacts: list[ContactsFields] = field(
        counted(ContactsFields, 1), "at most one: the parameters of contacts"
    )


@dataclass(frozen=True, slots=True)
class Header:
    """The fields of PosewaveHeader, checked against a layout.

    Arrays are by channel, except ``weights`` (n_joints,): ``greatest`` steps and the step of the
    ``first`` value of a segment and of a ``constant``, in source units. ``whole``: quaternions and
    rotation vectors turn in the metric, and the latter's channels are rotations. ``orders``: codes
    by joint. ``exact`` (n_channels,): mask of exact channels; ``exact_groups`` are their groups.
    """

    levels: int
    borrowing: int
    start: Start
    prior: Prior | None
    refining: bool
    whole: bool
    dependent: bool
    step: float
    radius: float
    shell: float
    spread: float
    greatest: Floats
    first: Floats
    constant: Floats
    weights: Floats
    orders: Mapping[int, int]
    exact: Bools
    exact_groups: tuple[int, ...]
    contacts: Contacts | None = None

    @property
    def version(self) -> int:
        """The least version of the codec that has this."""
        return int(self.whole)

    @property
    def may_go_on(self) -> bool:
        """Return True if a segment may continue the state of the previous one."""
        rest = self.orders or self.exact_groups or self.contacts
        return self.levels == 0 and not rest  # PWAVE-28


def has_whole_turns(skeleton: Skeleton) -> bool:
    """Return True if a joint turns by a quaternion or a rotation vector."""
    return any(
        first_columns(joint.channels, kinds)
        for joint in skeleton.joints
        for kinds in (QUATERNION_KINDS, VECTOR_KINDS)
    )


def build_header(**fields: Any) -> bytes:
    return build(PosewaveHeader(**{"contacts": [], **fields}), f"{NAME} header")


def parse_posewave_header(header: bytes, layout: Layout) -> Header:
    """Parse a header; raises FormatError where it does not fit the skeleton of ``layout``."""
    fields = parse(PosewaveHeader, header, f"{NAME} header")
    skeleton = layout.skeleton
    if skeleton is None:  # PWAVE-04
        raise FormatError(f"{NAME}: the signal must have the channels of its skeleton, not its own")
    many = len(layout.groups) > 1 and not fields.exact
    if layout.samples_per_frame != 1 or many:  # PWAVE-01, PWAVE-02
        raise FormatError(
            f"{NAME}: {layout.samples_per_frame} samples a frame and {len(layout.groups)} "
            "groups are not allowed"
        )
    if layout.n_resolutions > fields.levels + 1:  # PWAVE-16
        raise FormatError(
            f"{NAME}: {layout.n_resolutions} resolutions exceed {fields.levels} levels"
        )
    number, start = divmod(fields.start, START_TABLES)
    last = len(start_tables()) - 1
    if start > last:  # PWAVE-07
        raise FormatError(f"{NAME}: start table {start} does not exist; the last is {last}")
    whole = bool(fields.flags & WHOLE_TURNS)
    turning = ANGLE_KINDS if whole else ROTATION_KINDS
    kinds = [channel.kind for channel in skeleton.channels]
    n_plain = sum(kind not in (*turning, *POSITION_KINDS) for kind in kinds)
    for name, codes, expected in (
        ("plain", fields.plain, n_plain),
        ("weights", fields.weights, skeleton.n_joints),
    ):
        if len(codes) not in (0, expected):  # PWAVE-13, PWAVE-14
            raise FormatError(f"{NAME}: {len(codes)} codes of {name}; expected {expected}")
    orders = joint_codes(fields.flags, fields.orders, skeleton)
    exact = _exact_mask(fields.exact, layout)
    if fields.exact and fields.contacts:  # PWAVE-39
        raise FormatError(f"{NAME}: contacts and exact channels exclude each other")
    plain = iter(fields.plain or [code_of(1.0)] * n_plain)
    rotation, position = ratio_of(fields.rotation), ratio_of(fields.position)
    greatest = np.array(
        [
            rotation
            if kind in turning
            else position
            if kind in POSITION_KINDS
            else ratio_of(next(plain))
            for kind in kinds
        ],
        np.float64,
    )
    first = greatest * 2.0**-fields.first
    return Header(
        levels=fields.levels,
        borrowing=fields.borrowing,
        start=start_tables()[start],
        prior=_prior(number, layout.n_channels),
        refining=bool(fields.flags & REFINING),
        whole=whole,
        dependent=bool(fields.flags & DEPENDENT),
        step=fields.step,
        radius=fields.radius,
        shell=fields.shell % SPREADS / WHOLE_SHARE,
        spread=_spread(fields.shell // SPREADS),
        greatest=greatest,
        first=first,
        constant=first * 2.0**-fields.constant,
        weights=np.array([ratio_of(s) for s in fields.weights] or [1.0] * skeleton.n_joints),
        orders=orders,
        exact=exact,
        exact_groups=tuple(fields.exact),
        contacts=parse_contacts(fields.contacts, skeleton, NAME),
    )


def _prior(number: int, n_channels: int) -> Prior | None:
    if not number:
        return None
    if number > len(priors()):  # PWAVE-41
        raise FormatError(f"{NAME}: prior {number} does not exist; the last is {len(priors())}")
    prior = priors()[number - 1]
    if len(prior.variances) != n_channels:  # PWAVE-42
        raise FormatError(
            f"{NAME}: prior {number} is for {len(prior.variances)} channels, not {n_channels}"
        )
    return prior


def joint_codes(
    flags: int, records: Sequence[AxisOrderFields], skeleton: Skeleton
) -> dict[int, int]:
    """Codes by joint; raises FormatError for joints that cannot have one."""
    joints = [record.joint for record in records]
    ends = [-1, *joints, skeleton.n_joints]
    if any(after <= before for before, after in pairwise(ends)):  # PWAVE-15
        raise FormatError(
            f"{NAME}: axis orders of joints {joints} are not ascending, or beyond the "
            f"{skeleton.n_joints} joints"
        )
    codes = {record.joint: record.code for record in records}
    check_orders(codes, skeleton, NAME)
    if flags & VECTORS:
        codes = vector_codes(skeleton) | codes  # PWAVE-43
    return {joint: code for joint, code in sorted(codes.items()) if code}


def order_settings(
    codes: Mapping[int, int], skeleton: Skeleton
) -> tuple[int, list[AxisOrderFields]]:
    """The flag of vectors, or 0, and the fewest records that give these ``codes`` by joint."""
    defaults = vector_codes(skeleton)
    others = {
        joint: codes.get(joint, 0)
        for joint in {*defaults, *codes}
        if codes.get(joint, 0) != defaults.get(joint, 0)
    }
    flag, records = (VECTORS, others) if len(others) < len(codes) else (0, codes)
    return flag, [AxisOrderFields(joint=j, code=records[j]) for j in sorted(records)]


def _spread(octaves: int) -> float:
    return 2.0 ** (octaves - 10) if octaves else 0.0


def _exact_mask(groups: Sequence[int], layout: Layout) -> Bools:
    exact, last = np.zeros(layout.n_channels, np.bool_), len(layout.groups) - 1
    for before, group in pairwise([-1, *groups]):
        if group <= before:  # PWAVE-32
            raise FormatError(
                f"{NAME}: exact group {group} follows {before}, but groups must ascend"
            )
        if group > last:  # PWAVE-33
            raise FormatError(f"{NAME}: exact group {group} does not exist; the last is {last}")
        exact[list(layout.groups[group])] = True
    return exact
