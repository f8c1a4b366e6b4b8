"""ASF (Acclaim skeleton file): bytes -> Skeleton, and back.

The template of the source is the file itself.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, field, replace
from math import isfinite, sqrt

from mcz.errors import FormatError, MotionError, SourceError
from mcz.model.motion import ORIGIN, Channel, Joint, Skeleton, Source, Vector
from mcz.sources.text.source import (
    MOST_JOINTS,
    check_count,
    check_first_line,
    check_text,
    text_encoding,
)


def read(data: bytes, name: str = "skeleton") -> Skeleton:
    """The skeleton in an ASF file; ``name`` is its name if the file gives none.

    Joint 0 is the root. Raises SourceError, with the number of the line if there is one.
    """
    check_text(data)
    check_first_line(data, (b"#", b":version"))
    return _read(data, name)


def _read(data: bytes, name: str) -> Skeleton:
    """Read an ASF without the checks of its text, as every decoder does."""
    skeleton = read_text(data.decode(text_encoding(data)), name)
    digest = hashlib.sha256(data).digest()
    return replace(skeleton, source=Source("asf", data, size=len(data), sha256=digest))


def write(skeleton: Skeleton) -> bytes:
    """The ASF file of ``skeleton``: its own source if that still describes it, or a plain one.

    Raises MotionError if ASF cannot hold it. Only CMU's length unit is kept.
    """
    source = skeleton.source
    if source is not None and source.format == "asf":
        try:
            original = _read(source.template, skeleton.name)
        except SourceError as error:
            raise FormatError(f"source template: {error}") from None
        if replace(original, unit_cm=skeleton.unit_cm, base=skeleton.base) == skeleton:
            return source.template
    return _plain_text(skeleton).encode()


def _plain_text(skeleton: Skeleton) -> str:
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
            f"    axis {_short_text(joint.axis)}  {joint.axis_order}",
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


def _short_text(vector: Vector) -> str:
    """A vector with whole numbers as integers, the usual form of axis angles."""
    return " ".join(repr(x).removesuffix(".0") for x in vector)


def _polar(vector: Vector) -> tuple[Vector, float]:
    """A direction and a length with the exact product ``vector``."""
    x, y, z = vector
    length = sqrt(x * x + y * y + z * z)
    if length:
        direction = (x / length, y / length, z / length)
        if tuple(part * length for part in direction) == vector:
            return direction, length
    return vector, 1.0


def _check_joints(skeleton: Skeleton) -> tuple[Joint, ...]:
    """The joints; MotionError if ASF cannot hold them."""
    joints = skeleton.joints
    if not joints or joints[0].name != "root" or joints[0].tails or skeleton.intrinsic:
        raise MotionError("ASF needs a first joint 'root' without tails, and fixed rotation axes")
    names = {joint.name for joint in joints}
    if len(names) < len(joints):
        raise MotionError("ASF needs unique joint names")
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


INCH_UNITS = 0.45  # CMU: a length of 0.45 units is one inch
INCH_UNIT_CM = 2.54 / INCH_UNITS

_DOFS = ("tx", "ty", "tz", "rx", "ry", "rz")
_LINE_END = re.compile(r"\r?\n|\r")
WORDS = re.compile(r"[^\x00-\x20()]+")
_BLANK = "".join(map(chr, range(0x21)))


@dataclass(slots=True)
class _Bone:
    name: str = ""
    direction: Vector = ORIGIN
    length: float = 0.0
    axis: Vector = ORIGIN
    axis_order: str = "XYZ"
    dofs: tuple[str, ...] = ()
    parent: str | None = None


@dataclass(slots=True)
class _Parser:
    """Parser state; ``section`` and ``bone`` are the context of the next line."""

    section: str = ""
    name: str = ""
    length: str = ""
    angle: str = "deg"
    root: _Bone = field(default_factory=lambda: _Bone("root", dofs=_DOFS))
    position: Vector = ORIGIN
    bones: dict[str, _Bone] = field(default_factory=dict)
    bone: _Bone | None = None
    links: list[tuple[str, str]] = field(default_factory=list)  # (parent, child)

    def line(self, text: str) -> None:
        words = WORDS.findall(text)
        if not words or words[0].startswith("#"):
            return
        key = words[0].lower()
        if key.startswith(":"):
            self.section = key
            if key == ":name":
                self.name = text.strip(_BLANK)[len(key) :].strip(_BLANK)
        elif self.section == ":units":
            self._units(key, words)
        elif self.section == ":root":
            self._root(key, words)
        elif self.section == ":bonedata":
            self._bone(key, words)
        elif self.section == ":hierarchy" and key not in ("begin", "end"):
            self.links += [(words[0], child) for child in words[1:]]

    def _units(self, key: str, words: list[str]) -> None:
        if key == "length":
            self.length = words[1] if len(words) > 1 else ""
        elif key == "angle":
            self.angle = words[1].lower()[:3] if len(words) > 1 else ""
            if self.angle not in ("deg", "rad"):
                raise SourceError(f"angle unit {' '.join(words[1:])!r} is invalid")

    def _root(self, key: str, words: list[str]) -> None:
        if key == "order":
            self.root.dofs = tuple(word.lower() for word in words[1:])
        elif key == "axis":
            self.root.axis_order = _order(words[1:])
        elif key == "position":
            self.position = _vector(words[1:])
        elif key == "orientation":
            self.root.axis = _vector(words[1:])

    def _bone(self, key: str, words: list[str]) -> None:
        if key == "begin":
            self.bone = _Bone()
            return
        bone = self.bone
        if bone is None:
            raise SourceError(f"{words[0][:40]!r} is outside of begin and end")
        if key == "end":
            if not bone.name or bone.name in self.bones or bone.name == "root":
                raise SourceError(f"a bone needs a unique name, not {bone.name!r}")
            self.bones[bone.name] = bone
            check_count("bones", len(self.bones), MOST_JOINTS - 1)
            self.bone = None
        elif key == "name":
            bone.name = words[1] if len(words) > 1 else ""
        elif key == "direction":
            bone.direction = _vector(words[1:])
        elif key == "length":
            bone.length = _number(words[1:2])
        elif key == "axis":
            bone.axis, bone.axis_order = _vector(words[1:]), _order(words[4:])
        elif key == "dof":
            bone.dofs = tuple(word.lower() for word in words[1:])


def _number(words: list[str]) -> float:
    try:
        number = float(words[0])
    except (ValueError, IndexError):
        number = float("nan")
    # float also takes 1_0, digits of other scripts, and blanks of Unicode around them.
    if not isfinite(number) or "_" in words[0] or not words[0].isascii():
        raise SourceError(f"expected a number, not {' '.join(words)[:40]!r}")
    return number


def _vector(words: list[str]) -> Vector:
    x, y, z = (_number(words[k : k + 1]) for k in range(3))
    return x, y, z


def _order(words: list[str]) -> str:
    order = words[0].upper() if words else "XYZ"
    if sorted(order) != ["X", "Y", "Z"]:
        raise SourceError(f"axis order {order[:40]!r} is invalid")
    return order


def read_text(text: str, name: str) -> Skeleton:
    """The skeleton, without its source; ``name`` is its name if the file gives none.

    Joint 0 is the root. A bone becomes a joint at its parent's tail, with its own vector, in the
    file's length unit, as its tail. Raises SourceError, with the number of the line if it can.
    """
    reader = _Parser()
    for number, line in enumerate(_LINE_END.split(text), 1):
        try:
            reader.line(line)
        except SourceError as error:
            error.add(line=number)
            raise
    if not reader.bones and reader.section not in (":bonedata", ":hierarchy", ":root"):
        raise SourceError("no :root or :bonedata section; not an ASF file", line=1)
    unit_cm = INCH_UNIT_CM if _is_inch_unit(reader.length) else None
    try:
        joints = _joints(reader)
    except MotionError as error:  # a length times a direction that is too large
        raise SourceError(str(error)) from None
    return Skeleton(joints, reader.name or name, unit_cm, reader.angle, intrinsic=False)


def _is_inch_unit(length: str) -> bool:
    try:
        return float(length) == INCH_UNITS
    except ValueError:
        return False


def _joints(reader: _Parser) -> tuple[Joint, ...]:
    """The root, then the bones in definition order, but none before its parent."""
    for parent, child in reader.links:
        bone = reader.bones.get(child)
        if bone is None or (parent != "root" and parent not in reader.bones):
            raise SourceError(f"hierarchy: {parent} {child}: no bone has this name")
        if bone.parent is not None:
            raise SourceError(
                f"hierarchy: bone {child} has two parents, {bone.parent} and {parent}"
            )
        bone.parent = parent
    root = reader.root
    channels = tuple(dof_channel(dof) for dof in root.dofs)
    joints = [Joint("root", -1, reader.position, (), root.axis, root.axis_order, channels)]
    indices = {"root": 0}
    for bone in _parents_first(list(reader.bones.values())):
        parent_index = indices[bone.parent] if bone.parent is not None else -1
        offset = joints[parent_index].tails[0] if parent_index > 0 else ORIGIN
        x, y, z = bone.direction
        tail = (x * bone.length, y * bone.length, z * bone.length)
        channels = tuple(dof_channel(dof) for dof in bone.dofs)
        indices[bone.name] = len(joints)
        joints.append(
            Joint(bone.name, parent_index, offset, (tail,), bone.axis, bone.axis_order, channels)
        )
    return tuple(joints)


def _parents_first(bones: list[_Bone]) -> list[_Bone]:
    """The bones; one whose parent comes later moves right after it. SourceError on a cycle."""
    waiting: dict[str, list[_Bone]] = {}
    placed = {"root", None}
    result: list[_Bone] = []
    for bone in bones:
        if bone.parent not in placed:
            waiting.setdefault(bone.parent or "", []).append(bone)
            continue
        ready = [bone]
        while ready:
            bone = ready.pop()
            result.append(bone)
            placed.add(bone.name)
            ready += reversed(waiting.pop(bone.name, []))
    if waiting:
        raise SourceError(f"hierarchy: these bones form a cycle: {', '.join(list(waiting)[:8])}")
    return result


def dof_channel(dof: str) -> Channel:
    """The channel of a word of ``dof`` or ``order``; an unknown one is a plain scalar."""
    if dof in _DOFS:
        return Channel(dof)
    return Channel("length") if dof == "l" else Channel("", dof)
