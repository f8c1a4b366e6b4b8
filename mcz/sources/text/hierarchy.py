"""The HIERARCHY section of a BVH file: text -> joints, and back.

Source: "BVH File Specification" of Biovision, as M. Meredith and S. Maddock retell it in "Motion
Capture File Formats Explained" (2001). Read leniently: keywords in any case, several roots, any
channels, names with blanks, any number of end sites.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from math import isfinite

from mcz.errors import MotionError, SourceError
from mcz.model.motion import ORIGIN, Channel, Joint, Skeleton, Vector
from mcz.model.text_format import quote
from mcz.sources.text.rows import line_of
from mcz.sources.text.source import MOST_CHANNELS, MOST_DEPTH, MOST_JOINTS, check_count, text_start

_KINDS = {"position": "t", "rotation": "r", "scale": "s"}
_NAMES = {f"{k}{a}": f"{a.upper()}{name}" for name, k in _KINDS.items() for a in "xyz"}
_WORD = re.compile(rb"(?:[\x00-\x20]++|#[^\n]*+)*+([{}]|[^\x00-\x20{}]+)")
# The usual text after a keyword, in one match; other text is read word by word.
_NUMBERS = re.compile(rb"[\t ]+([^\x00-\x20{}#][^\x00-\x20{}]*)" * 3 + rb"(?=[\x00-\x20{}])")
_KNOWN_CHANNELS = re.compile(
    rb"[\t ]+([0-9]{1,9})((?:[\t ]+[XYZxyz](?:position|rotation))+)(?=[\t\r\n ])"
)
_JOINT_LINE = re.compile(rb"(?im)^[\t ]*(?:ROOT|JOINT)\b")
_MOTION_LINE = re.compile(rb"(?im)^[\t ]*MOTION\b")
_REST = re.compile(rb"[^\n{]*")
_NO_CHANNELS = (b"", b"{", b"}", b"ROOT", b"JOINT", b"END", b"OFFSET", b"MOTION")
BLANKS = bytes(range(0x21))
MAX_INDENT = 64  # tabs; joints may lie deeper


@dataclass(slots=True)
class _Node:
    """A joint while it is read; ``end``: an end site, whose offset becomes a tail."""

    name: bytes
    parent: int
    end: bool = False
    offset: Vector = ORIGIN
    channels: tuple[Channel, ...] = ()
    tails: list[Vector] = field(default_factory=list)


@dataclass(slots=True)
class _Parser:
    data: bytes
    at: int = 0
    joints: list[_Node] = field(default_factory=list)
    strays: int = 0
    n_channels: int = 0

    def word(self) -> bytes:
        """The next word or brace, b"" at the end."""
        match = _WORD.match(self.data, self.at)
        if match is None:
            self.at = len(self.data)
            return b""
        self.at = match.end()
        return match[1]

    def error(self, message: str) -> SourceError:
        return SourceError(message, line=line_of(self.data, self.at))

    def check(self, noun: str, number: int, most: int) -> None:
        """Raise SourceError, with the number of the line, for more than there may be."""
        try:
            check_count(noun, number, most)
        except SourceError as error:
            error.add(line=line_of(self.data, self.at))
            raise

    def read(self) -> None:
        """Read up to and including the word MOTION."""
        if self.word().upper() != b"HIERARCHY":
            raise self.error("no HIERARCHY section at the start; not a BVH file, or a part of one")
        open_nodes: list[tuple[int, _Node]] = []  # with the joint's index, or its parent's
        while (word := self.word().upper()) != b"MOTION" or open_nodes:
            if word in (b"ROOT", b"JOINT", b"END"):
                open_nodes.append(self._begin(word, open_nodes[-1][0] if open_nodes else -1))
                self.check("joints inside each other", len(open_nodes), MOST_DEPTH)
            elif word == b"OFFSET" and open_nodes:
                open_nodes[-1][1].offset = self._vector()
            elif word == b"CHANNELS" and open_nodes and not open_nodes[-1][1].end:
                open_nodes[-1][1].channels = tuple(self._known_channels() or self._channels())
                self.n_channels += len(open_nodes[-1][1].channels)
                self.check("channels", self.n_channels, MOST_CHANNELS)
            elif word == b"}" and open_nodes:
                index, node = open_nodes.pop()
                if node.end and index >= 0:
                    self.joints[index].tails.append(node.offset)
            elif self._is_alone(word):
                self.strays += 1
            else:
                raise self.error(f"unexpected {quote(word)} in the HIERARCHY section")

    def _is_alone(self, word: bytes) -> bool:
        """Return True if the word just read is alone on its line, and so has no meaning."""
        line = self.data.rfind(b"\n", 0, self.at) + 1
        end = self.data.find(b"\n", self.at)
        return end >= 0 and self.data[line:end].strip(BLANKS).upper() == word != b""

    def _begin(self, word: bytes, parent: int) -> tuple[int, _Node]:
        rest = _REST.match(self.data, self.at)
        assert rest is not None  # it matches the empty string
        self.at = rest.end()
        node = _Node(rest[0].strip(BLANKS), parent, word == b"END")
        if self.word() != b"{":
            raise self.error(f"expected {{ after {word.decode()} {quote(node.name)}")
        if node.end:
            return parent, node
        self.joints.append(node)
        self.check("joints", len(self.joints), MOST_JOINTS)
        return len(self.joints) - 1, node

    def _vector(self) -> Vector:
        match = _NUMBERS.match(self.data, self.at)
        if match is None:
            x, y, z = (self._number(self.word()) for _ in range(3))
            return x, y, z
        self.at = match.end()
        return self._number(match[1]), self._number(match[2]), self._number(match[3])

    def _number(self, word: bytes) -> float:
        try:
            number = float(word)
        except ValueError:
            number = float("nan")
        if not isfinite(number) or b"_" in word:
            raise self.error(f"expected a number, not {quote(word)}")
        return number

    def _known_channels(self) -> list[Channel]:
        """The channels if all are known and as many as are counted, and no word follows."""
        match = _KNOWN_CHANNELS.match(self.data, self.at)
        names = match[2].split() if match else []
        if match is None or len(names) != int(match[1]):
            return []
        self.at = match.end()
        self._refuse_another(len(names))
        return [channel(name.decode()) for name in names]

    def _channels(self) -> Iterator[Channel]:
        count = self.word()
        if not count.isdigit() or len(count) > 9:
            raise self.error(f"CHANNELS {quote(count)} is not a count")
        for k in range(int(count)):
            word = self.word()
            if word.upper() in _NO_CHANNELS:
                raise self.error(f"CHANNELS {int(count)}, but {k} channels are named")
            yield channel(word.decode("latin-1"))
        self._refuse_another(int(count))

    def _refuse_another(self, count: int) -> None:
        """Raise SourceError if another channel follows."""
        after = self.at
        if channel(self.word().decode("latin-1")).kind:
            raise self.error(f"CHANNELS {count}, but more channels are named")
        self.at = after


@lru_cache(256)
def channel(name: str) -> Channel:
    """The channel of a BVH name: "Xrotation" is rx; an unknown one is a plain scalar."""
    kind = _KINDS.get(name[1:].lower(), "") + name[:1].lower()
    return Channel(kind) if kind in _NAMES else Channel("", name)


def read_hierarchy(data: bytes, encoding: str) -> tuple[list[Joint], int, int]:
    """The joints, in definition order, the offset after MOTION, and the number of stray words.

    Stray words are alone on their line, remains of another file that was written over. Position
    channels are taken to add to the offset: only the values can tell.
    """
    reader = _Parser(data, text_start(data))
    _refuse_early(reader)
    reader.read()
    joints = [
        Joint(
            node.name.decode(encoding),
            node.parent,
            node.offset,
            tuple(node.tails),
            channels=node.channels,
        )
        for node in reader.joints
    ]
    return joints, reader.at, reader.strays


def _refuse_early(reader: _Parser) -> None:
    """Raise SourceError for far too many joints before the first one is looked at more closely.

    That takes moments; only joints that begin a line are counted.
    """
    at = _joint_line(reader.data, MOST_JOINTS)
    if at is not None:
        reader.at = at
        reader.check("joints", MOST_JOINTS + 1, MOST_JOINTS)


def has_more_joints(data: bytes, most: int) -> bool:
    """Return True if a quick scan finds more joints than ``most`` in a BVH."""
    return _joint_line(data, most) is not None


def _joint_line(data: bytes, number: int) -> int | None:
    """Offset of the line of joint ``number``, or None."""
    motion = _MOTION_LINE.search(data)
    stop = len(data) if motion is None else motion.start()
    line = next(islice(_JOINT_LINE.finditer(data, 0, stop), number, None), None)
    return None if line is None else line.start()


def write_hierarchy(skeleton: Skeleton) -> tuple[str, list[int]]:
    """The HIERARCHY section, and the joints in its order (depth first).

    Raises MotionError for what BVH cannot say: axes, fixed-axis or radian rotations, channels
    other than position, rotation, scale and plain scalars, and names with line ends or braces.
    """
    children: dict[int, list[int]] = {}
    for index, joint in enumerate(skeleton.joints):
        children.setdefault(joint.parent, []).append(index)
        _check(skeleton, joint)
    lines = ["HIERARCHY"]
    order: list[int] = []
    stack = [(root, 0) for root in reversed(children.get(-1, []))]
    while stack:
        index, depth = stack.pop()
        if index < 0:
            lines.append("\t" * min(depth, MAX_INDENT) + "}")
            continue
        order.append(index)
        lines += _opening_lines(skeleton.joints[index], depth)
        stack.append((-1, depth))
        stack += [(child, depth + 1) for child in reversed(children.get(index, []))]
    return "\n".join([*lines, ""]), order


def _opening_lines(joint: Joint, depth: int) -> list[str]:
    """The lines of a joint up to its first child; its end sites come before."""
    indent = "\t" * min(depth, MAX_INDENT)
    names = [_NAMES.get(c.kind, c.name) for c in joint.channels]
    lines = [
        f"{indent}{'JOINT' if depth else 'ROOT'} {joint.name}",
        f"{indent}{{",
        f"{indent}\tOFFSET {_vector(joint.offset)}",
        f"{indent}\tCHANNELS {' '.join([str(len(names)), *names])}",
    ]
    for tail in joint.tails:
        lines += [f"{indent}\tEnd Site", f"{indent}\t{{"]
        lines += [f"{indent}\t\tOFFSET {_vector(tail)}", f"{indent}\t}}"]
    return lines


def _vector(vector: Vector) -> str:
    return " ".join(repr(float(x)) for x in vector)


def _check(skeleton: Skeleton, joint: Joint) -> None:
    name = joint.name
    if any(letter in name for letter in "\n{") or name != name.strip(BLANKS.decode()):
        raise MotionError(f"BVH cannot hold the joint name {name!r}")
    if any(joint.axis):
        raise MotionError(f"BVH cannot hold the rotation axis {joint.axis} of joint {name!r}")
    for c in joint.channels:
        word = _NAMES.get(c.kind, c.name)
        if channel(word) != c or _WORD.fullmatch(word.encode()) is None:
            raise MotionError(f"BVH cannot hold channel {c.label!r} of joint {name!r}")
    turns = sum(c.kind in ("rx", "ry", "rz") for c in joint.channels)
    if (turns and skeleton.angle_unit == "rad") or (turns > 1 and not skeleton.intrinsic):
        raise MotionError(
            f"BVH needs intrinsic rotations in degrees, which joint {name!r} does not have"
        )
