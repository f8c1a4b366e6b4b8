"""The part of a manifest row about the file itself: codecs and source formats of its clips."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.codecs import CODECS, bitstream_name
from mcz.container import payloads
from mcz.container.chunks import HEADER, parse_chunk_header
from mcz.container.encodings import unpack_skeleton
from mcz.container.limits import BASE
from mcz.errors import MczError
from mcz.model.schema import parse
from mcz.sources import FORMATS
from tools.vectors.build.files import Vector

OPEN = 2**64 - 1


def codecs_of(vector: Vector) -> list[str]:
    """The bitstreams of the clips, sorted; of a folder where a CLIP cannot be parsed."""
    found: set[str] = set()
    for payload in _payloads(vector.data, b"CLIP"):
        try:
            fields = parse(payloads.Clip, payload, "CLIP")
        except MczError:
            continue
        found |= {name for s in fields.signals if (name := bitstream_name(s.codec))}
    folder = vector.name.split("/")[1]
    if not found and folder in CODECS:
        found.add(bitstream_name(CODECS[folder].id) or "")
    return sorted(found)


def formats_of(vector: Vector) -> list[str]:
    """The names of the source formats of the clips and skeletons that have a source, sorted."""
    names = {source_format.id: source_format.name for source_format in FORMATS.values()}
    found: set[str] = set()
    for kind, schema in ((b"CLIP", payloads.Clip), (b"SKEL", payloads.Skel)):
        for payload in _payloads(vector.data, kind):
            try:
                plain = unpack_skeleton(payload, "source", BASE) if kind == b"SKEL" else payload
                fields = parse(schema, plain, "source")
            except MczError:
                continue
            found |= {names[s.format] for s in [fields.source] if s and s.format in names}
    return sorted(found)


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
        chunk = parse_chunk_header(data[at : at + HEADER.size], at)
    except MczError:
        return None
    return OPEN if chunk.length is None else chunk.length
