"""What a manifest row says of a file itself: the codecs of its clips, the version it belongs to."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.codecs import CODECS
from mcz.container import payloads
from mcz.container.chunks import (
    COPY,
    HEADER,
    META,
    RECOVERY,
    REPEAT,
    SIGNATURE,
    parse_header,
)
from mcz.container.limits import BASE
from mcz.container.packed import unpacked
from mcz.container.packets import CHECK_SIZE, END, FRAME, NUMBERED, body_check
from mcz.errors import MczError
from mcz.formats import FORMATS
from mcz.schema import parse, read_varint
from tools.vectors.build.files import Vector

FIRST = "0.2"  # 0.1 is no longer read
SINCE_03 = ("lsdt-frame", "lsdt-clip", "mdtt", "pca-rdo")
SINCE_04 = ("online",)
SINCE_09 = ("posewave",)
SINCE_09_CHUNKS = (COPY, META, RECOVERY)
BASES = b"\1"  # the kind of a MODL
# What the first bytes of a file do not tell, or tell only where they are not at fault.
SINCE = {"valid/filtered/": "0.4", "invalid/packets/REPT": "0.4", "invalid/packets/numbered": "0.4"}
SHORT_OF = {FRAME: "0.3", NUMBERED: "0.4"}  # packets of these kinds
OPEN = 2**64 - 1


def codecs_of(vector: Vector) -> list[str]:
    """The names of the codecs of the clips, sorted; of a folder where a CLIP cannot be parsed."""
    found: set[str] = set()
    for payload in _payloads(vector.data, b"CLIP"):
        try:
            fields = parse(payloads.Clip, payload, "CLIP")
        except MczError:
            continue
        found |= {CODECS[s.codec].name for s in fields.signals if s.codec in CODECS}
    folder = vector.name.split("/")[1]
    if not found and folder in {codec.name for codec in CODECS.values()}:
        found.add(folder)
    return sorted(found)


def formats_of(vector: Vector) -> list[str]:
    """The names of the source formats of the clips and skeletons that have a source, sorted."""
    names = {source_format.id: source_format.name for source_format in FORMATS.values()}
    found: set[str] = set()
    for kind, schema in ((b"CLIP", payloads.Clip), (b"SKEL", payloads.Skel)):
        for payload in _payloads(vector.data, kind):
            try:
                plain = unpacked(payload, "source", BASE) if kind == b"SKEL" else payload
                fields = parse(schema, plain, "source")
            except MczError:
                continue
            found |= {names[s.format] for s in [fields.source] if s and s.format in names}
    return sorted(found)


def since(vector: Vector) -> str:
    """The format version that first had what the file is about."""
    own = [version for start, version in SINCE.items() if vector.name.startswith(start)]
    names = codecs_of(vector)
    own += ["0.4"] * any(name in SINCE_04 for name in names)
    own += ["0.9"] * any(name in SINCE_09 for name in names)
    own += ["0.3"] * any(name in SINCE_03 for name in names)
    own += ["0.4"] * any(True for _ in _payloads(vector.data, REPEAT))
    for kind in SINCE_09_CHUNKS:
        own += ["0.9"] * any(True for _ in _payloads(vector.data, kind))
    own += ["0.3"] * any(p[:1] == BASES for p in _payloads(vector.data, b"MODL"))
    own += [SHORT_OF[kind] for kind in _kinds(vector.data) if kind in SHORT_OF]
    if vector.since:
        own.append(vector.since)
    return max(own, default=FIRST)


def _payloads(data: bytes, kind: bytes) -> Iterator[bytes]:
    """The payloads of chunks of this type, wherever a header of one is right."""
    at = data.find(kind)
    while at >= 0:
        length = _length(data, at)
        if length is not None and length < OPEN:
            yield data[at + HEADER.size :][:length]
        at = data.find(kind, at + 1)


def _length(data: bytes, at: int) -> int | None:
    """The length that a header says, all ones where it is open; None where it is no header."""
    try:
        chunk = parse_header(data[at : at + HEADER.size], at)
    except MczError:
        return None
    return OPEN if chunk.length is None else chunk.length


def _kinds(data: bytes) -> set[int]:
    """The kinds of the packets of open DATA, as far as their heads can be read."""
    found = set()
    at = data.find(b"DATA", len(SIGNATURE))
    while at >= 0:
        if _length(data, at) == OPEN:
            found |= set(_kinds_from(data, at + HEADER.size))
        at = data.find(b"DATA", at + 1)
    return found


def _kinds_from(data: bytes, at: int) -> Iterator[int]:
    while at < len(data):
        try:
            length, behind = read_varint(data, read_varint(data, at + 1)[1])
        except MczError:
            return
        if body_check(data[at:behind]) != data[behind : behind + CHECK_SIZE]:
            return
        yield data[at] & 15
        if data[at] & 15 == END:
            return
        at = behind + CHECK_SIZE + length + CHECK_SIZE
