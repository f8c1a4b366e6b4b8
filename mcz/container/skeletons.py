"""Skeleton <-> the payload of SKEL. SPEC.md, "SKEL", is normative."""

from __future__ import annotations

from collections.abc import Sequence

from mcz.container import payloads
from mcz.container.limits import Profile, check
from mcz.errors import FormatError, MotionError
from mcz.model.motion import CHANNEL_KINDS, ORIGIN, Channel, Joint, Skeleton
from mcz.model.schema import build, parse
from mcz.model.skeleton import AXES, HANDS

ANGLE_UNITS = ("", "deg", "rad")
MOST_KNOWN, MOST_BYTES = 64, 1 << 16  # number of kept skeletons, and greatest length of a payload
_known: dict[tuple[bytes, int], tuple[payloads.Skel, Skeleton]] = {}  # by payload and profile
AXIS_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


def build_skeleton(skeleton: Skeleton, source: payloads.SkeletonSource | None) -> bytes:
    """The payload of SKEL; ``source``: its source file."""
    record = payloads.Skel(
        name=skeleton.name,
        flags=int(skeleton.intrinsic),
        unit_cm=skeleton.unit_cm,
        angle_unit=ANGLE_UNITS.index(skeleton.angle_unit),
        up_axis=AXES.index(skeleton.up_axis),
        forward_axis=AXES.index(skeleton.forward_axis),
        handedness=HANDS.index(skeleton.handedness),
        base=skeleton.base or None,  # b"": derived from an unknown one
        source=source,
        joints=[_joint_record(joint) for joint in skeleton.joints],
    )
    return build(record, f"skeleton {skeleton.name!r}")


def _joint_record(joint: Joint) -> payloads.Joint:
    has_offset = _bits(joint.offset) != _bits(ORIGIN)
    has_axis = _bits(joint.axis) != _bits(ORIGIN) or joint.axis_order != "XYZ"
    return payloads.Joint(
        name=joint.name,
        parent=joint.parent + 1,
        flags=joint.adds_to_offset * payloads.ADDS_TO_OFFSET
        | has_offset * payloads.HAS_OFFSET
        | has_axis * payloads.HAS_AXIS,
        offset=joint.offset if has_offset else None,
        axis=joint.axis if has_axis else None,
        axis_order=AXIS_ORDERS.index(joint.axis_order) if has_axis else None,
        tails=list(joint.tails),
        channels=channel_records(joint.channels),
    )


def _bits(vector: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(map(repr, vector))  # -0.0 differs from 0.0 here


def channel_records(channels: tuple[Channel, ...]) -> list[payloads.Channel]:
    return [
        payloads.Channel(
            flags=bool(c.name) * payloads.HAS_NAME | bool(c.unit) * payloads.HAS_UNIT,
            kind=CHANNEL_KINDS.index(c.kind) + 1 if c.kind else 0,
            name=c.name or None,
            unit=c.unit or None,
        )
        for c in channels
    ]


def parse_channels(rows: Sequence[payloads.Channel], where: str) -> tuple[Channel, ...]:
    """Channels; a kind beyond the registry is a plain scalar, coded like any other."""
    channels = []
    for row in rows:
        known = 0 < row.kind <= len(CHANNEL_KINDS)
        kind = CHANNEL_KINDS[row.kind - 1] if known else ""  # SKEL-07
        unknown = f"kind-{row.kind}" if row.kind and not known else ""
        channels.append(Channel(kind, row.name or unknown, row.unit or ""))
    return tuple(channels)


def read_skeleton(
    payload: bytes, profile: Profile, label: str, where: str
) -> tuple[payloads.Skel, Skeleton]:
    """The fields of SKEL and its Skeleton; raises FormatError or LimitError.

    The last ones are kept, as the files of a data set often have one skeleton.
    """
    key = payload, profile.id
    entry = _known.get(key)
    if entry is None:
        fields = parse(payloads.Skel, payload, label, profile.counts)
        entry = fields, parse_skeleton(fields, profile, where)
        if len(payload) <= MOST_BYTES:
            while len(_known) >= MOST_KNOWN:
                _known.pop(next(iter(_known)), None)
            _known[key] = entry
    return entry


def parse_skeleton(fields: payloads.Skel, profile: Profile, where: str) -> Skeleton:
    """The Skeleton of the fields of SKEL; raises FormatError or LimitError."""
    check(f"{where}: joints", len(fields.joints), profile.joints)
    check(f"{where}: channels", sum(len(j.channels) for j in fields.joints), profile.channels)
    try:
        return Skeleton(
            joints=tuple(_parse_joint(row, where) for row in fields.joints),
            name=fields.name,
            unit_cm=fields.unit_cm,
            angle_unit=ANGLE_UNITS[fields.angle_unit],
            up_axis=AXES[fields.up_axis],
            forward_axis=AXES[fields.forward_axis],
            handedness=HANDS[fields.handedness],
            intrinsic=bool(fields.flags & 1),
            base=fields.base,
        )
    except MotionError as error:
        raise FormatError(str(error), where=where) from None


def _parse_joint(row: payloads.Joint, where: str) -> Joint:
    return Joint(
        name=row.name,
        parent=row.parent - 1,
        offset=_vector(row.offset),
        tails=tuple(map(_vector, row.tails)),
        axis=_vector(row.axis),
        axis_order=AXIS_ORDERS[row.axis_order] if row.axis_order is not None else "XYZ",
        channels=parse_channels(row.channels, where),
        adds_to_offset=bool(row.flags & payloads.ADDS_TO_OFFSET),
    )


def _vector(stored: payloads.Vector | None) -> tuple[float, float, float]:
    if stored is None:
        return ORIGIN
    x, y, z = stored
    return x, y, z
