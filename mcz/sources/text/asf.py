"""ASF (Acclaim skeleton file): bytes -> Skeleton, and back.

The template of the source is the file itself.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from math import sqrt

from mcz.errors import FormatError, MotionError, SourceError
from mcz.model.motion import ORIGIN, Channel, Joint, Skeleton, Source, Vector
from mcz.sources.text.acclaim import INCH_UNIT_CM, INCH_UNITS, WORDS, dof_channel, read_text
from mcz.sources.text.source import check_first_line, check_text, text_encoding


def read(data: bytes, name: str = "skeleton") -> Skeleton:
    """The skeleton in an ASF file; ``name`` is its name where the file gives none.

    Joint 0 is the root. Raises SourceError, with the number of the line where there is one.
    """
    check_text(data)
    check_first_line(data, (b"#", b":version"))
    return _read(data, name)


def _read(data: bytes, name: str) -> Skeleton:
    """``read`` as every decoder does it, who takes the text as it is."""
    skeleton = read_text(data.decode(text_encoding(data)), name)
    digest = hashlib.sha256(data).digest()
    return replace(skeleton, source=Source("asf", data, size=len(data), sha256=digest))


def write(skeleton: Skeleton) -> bytes:
    """The ASF file of ``skeleton``: its own source where that still describes it, or a plain one.

    Raises MotionError for what ASF cannot say. The length unit is kept only if it is CMU's.
    """
    source = skeleton.source
    if source is not None and source.format == "asf":
        try:
            original = _read(source.template, skeleton.name)
        except SourceError as error:
            raise FormatError(f"source template: {error}") from None
        if replace(original, unit_cm=skeleton.unit_cm, base=skeleton.base) == skeleton:
            return source.template
    return _plain(skeleton).encode()


def _plain(skeleton: Skeleton) -> str:
    root, *bones = _check_joints(skeleton)
    length = INCH_UNITS if skeleton.unit_cm == INCH_UNIT_CM else 1.0
    lines = [
        "# AST/ASF file written by mcz",
        ":version 1.10",
        f":name {skeleton.name or 'skeleton'}",
        ":units",
        "  mass 1.0",
        f"  length {length}",
        f"  angle {skeleton.angle_unit or 'deg'}",
        ":root",
        f"  order {' '.join(_dof(c).upper() for c in root.channels)}",
        f"  axis {root.axis_order}",
        f"  position {_text(root.offset)}",
        f"  orientation {_text(root.axis)}",
        ":bonedata",
    ]
    for index, joint in enumerate(bones, 1):
        direction, size = _polar(joint.tails[0])
        lines += [
            "  begin",
            f"    id {index}",
            f"    name {joint.name}",
            f"    direction {_text(direction)}",
            f"    length {size!r}",
            f"    axis {_whole(joint.axis)}  {joint.axis_order}",
        ]
        if joint.channels:
            lines.append(f"    dof {' '.join(_dof(c) for c in joint.channels)}")
        lines.append("  end")
    lines += [":hierarchy", "  begin"]
    for index, joint in enumerate(skeleton.joints):
        children = [child.name for child in bones if child.parent == index]
        if children:
            lines.append(f"    {joint.name} {' '.join(children)}")
    return "\n".join([*lines, "  end", ""])


def _dof(channel: Channel) -> str:
    return "l" if channel.kind == "length" else channel.label


def _text(vector: Vector) -> str:
    return " ".join(f"{x!r}" for x in vector)


def _whole(vector: Vector) -> str:
    """The same with whole numbers as such, as angles of axes are usually written."""
    return " ".join(repr(x).removesuffix(".0") for x in vector)


def _polar(vector: Vector) -> tuple[Vector, float]:
    """A direction and a length whose product is ``vector`` exactly."""
    x, y, z = vector
    length = sqrt(x * x + y * y + z * z)
    if length:
        direction = (x / length, y / length, z / length)
        if tuple(part * length for part in direction) == vector:
            return direction, length
    return vector, 1.0


def _check_joints(skeleton: Skeleton) -> tuple[Joint, ...]:
    """The joints; MotionError where ASF cannot hold them."""
    joints = skeleton.joints
    if not joints or joints[0].name != "root" or joints[0].tails or skeleton.intrinsic:
        raise MotionError("ASF needs a first joint 'root' without tails, and fixed rotation axes")
    names = {joint.name for joint in joints}
    if len(names) < len(joints):
        raise MotionError("ASF needs joint names that differ")
    for joint in joints:
        if WORDS.fullmatch(joint.name) is None or joint.name[0] in "#:":
            raise MotionError(f"ASF cannot hold the joint name {joint.name!r}")
        if any(dof_channel(_dof(c).lower()) != c for c in joint.channels):
            raise MotionError(f"ASF cannot hold a channel of joint {joint.name!r}")
    for joint in joints[1:]:
        tails = joints[joint.parent].tails if joint.parent > 0 else (ORIGIN,)
        if len(joint.tails) != 1 or joint.offset != tails[0]:
            raise MotionError(
                f"ASF needs joint {joint.name!r} at its parent's tail, with one of its own"
            )
    return joints
