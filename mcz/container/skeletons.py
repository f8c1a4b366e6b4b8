"""Skeleton <-> the payload of SKEL. SPEC.md, "SKEL", is normative."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mcz.container import payloads
from mcz.container.limits import Profile, check
from mcz.errors import FormatError, MotionError
from mcz.motion import CHANNEL_KINDS, ORIGIN, Channel, Joint, Skeleton
from mcz.schema import build

ANGLE_UNITS = ("", "deg", "rad")
UP_AXES = ("", "x", "y", "z")
AXIS_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


def build_skeleton(skeleton: Skeleton, source: Mapping[str, Any] | None) -> bytes:
    """The payload of SKEL; ``source`` has the fields of SKELETON_SOURCE."""
    fields = {
        "name": skeleton.name,
        "flags": int(skeleton.intrinsic),
        "unit_cm": [] if skeleton.unit_cm is None else [skeleton.unit_cm],
        "angle_unit": ANGLE_UNITS.index(skeleton.angle_unit),
        "up_axis": UP_AXES.index(skeleton.up_axis),
        "base": [skeleton.base] if skeleton.base else [],  # b"": derived, from what is not told
        "source": [] if source is None else [source],
        "joints": [_joint_fields(joint) for joint in skeleton.joints],
        "extension": b"",
    }
    return build(payloads.SKEL, fields, f"skeleton {skeleton.name!r}")


def _joint_fields(joint: Joint) -> dict[str, Any]:
    has_offset = _bits(joint.offset) != _bits(ORIGIN)
    has_axis = _bits(joint.axis) != _bits(ORIGIN) or joint.axis_order != "XYZ"
    return {
        "name": joint.name,
        "parent": joint.parent + 1,
        "flags": joint.adds_to_offset * payloads.ADDS_TO_OFFSET
        | has_offset * payloads.HAS_OFFSET
        | has_axis * payloads.HAS_AXIS,
        "offset": joint.offset if has_offset else None,
        "axis": joint.axis if has_axis else None,
        "axis_order": AXIS_ORDERS.index(joint.axis_order) if has_axis else None,
        "tails": joint.tails,
        "channels": channel_fields(joint.channels),
    }


def _bits(vector: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(map(repr, vector))  # -0.0 differs from 0.0 here


def channel_fields(channels: tuple[Channel, ...]) -> list[dict[str, Any]]:
    return [
        {
            "kind": CHANNEL_KINDS.index(c.kind) + 1 if c.kind else 0,
            "name": c.name,
            "unit": c.unit,
        }
        for c in channels
    ]


def parse_channels(rows: Any, where: str) -> tuple[Channel, ...]:
    """Channels; a kind beyond the registry is a plain scalar, coded like any other."""
    channels = []
    for row in rows:
        known = 0 < row.kind <= len(CHANNEL_KINDS)
        kind = CHANNEL_KINDS[row.kind - 1] if known else ""  # SKEL-07
        unknown = f"kind-{row.kind}" if row.kind and not known else ""
        channels.append(Channel(kind, row.name or unknown, row.unit))
    return tuple(channels)


def parse_skeleton(fields: Any, profile: Profile, where: str) -> Skeleton:
    """The Skeleton of the fields of SKEL; raises FormatError or LimitError."""
    check(f"{where}: joints", len(fields.joints), profile.joints)
    check(f"{where}: channels", sum(len(j.channels) for j in fields.joints), profile.channels)
    try:
        return Skeleton(
            joints=tuple(_parse_joint(row, where) for row in fields.joints),
            name=fields.name,
            unit_cm=fields.unit_cm[0] if fields.unit_cm else None,
            angle_unit=ANGLE_UNITS[fields.angle_unit],
            up_axis=UP_AXES[fields.up_axis],
            intrinsic=bool(fields.flags & 1),
            base=fields.base[0] if fields.base else None,
        )
    except MotionError as error:
        raise FormatError(f"{where}: {error}") from None


def _parse_joint(row: Any, where: str) -> Joint:
    return Joint(
        name=row.name,
        parent=row.parent - 1,
        offset=tuple(row.offset) if row.offset is not None else ORIGIN,
        tails=tuple(tuple(tail) for tail in row.tails),
        axis=tuple(row.axis) if row.axis is not None else ORIGIN,
        axis_order=AXIS_ORDERS[row.axis_order] if row.axis_order is not None else "XYZ",
        channels=parse_channels(row.channels, where),
        adds_to_offset=bool(row.flags & payloads.ADDS_TO_OFFSET),
    )
