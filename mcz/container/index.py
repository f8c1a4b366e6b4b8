"""INDX: the Directory of a file as bytes, and back.

Both ways are written by hand, for an archive has tens of thousands of rows; the schema ``INDEX`` of
``payloads.py`` states the same structure, and a test compares the two. The segments of a clip stay
packed until somebody asks for them. SPEC.md, "INDX", is normative.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mcz.container import payloads
from mcz.container.chunks import Chunk, build_chunk
from mcz.container.cursor import Cursor
from mcz.container.directory import (
    AttachmentRow,
    ClipRow,
    Directory,
    PackedClipRow,
    SegmentRow,
    SignalRow,
)
from mcz.container.limits import check
from mcz.container.packets import FRAME, NUMBERED, SEGMENT, SHORT
from mcz.container.segments import FRESH, SegmentHeader
from mcz.errors import FormatError
from mcz.schema import build, deflate, inflate, parse, varint
from mcz.types import Settings

# Set in the indexed flags of a segment that is a packet of an open DATA, by the packet's kind.
PACKETS = {SEGMENT: 128, FRAME: 64, NUMBERED: 32}

# Each segment in the "segments" field of an indexed clip: (name, type, meaning).
INDEXED_SEGMENT_FIELDS = (
    ("gap", "varint", "bytes from the end of CLIP, or of the payload before, to this payload"),
    ("size", "varint", "bytes of the payload"),
    ("signal", "varint", "index of the signal"),
    ("n_frames", "varint", "frames"),
    ("lead", "varint", "as in DATA"),
    ("tail", "varint", "as in DATA"),
    (
        "flags",
        "varint",
        "as in DATA; more where it is a packet: 128 of kind 1, 64 of kind 2, 32 of 3",
    ),
)
ALIASED = (payloads.OF_CLIP, payloads.OF_SKELETON, payloads.OF_ATTACHMENT)


def build_index(directory: Directory) -> bytes:
    """The whole INDX chunk."""
    content = index_content(directory)
    record = payloads.Indx(size=len(content), data=deflate(content))
    return build_chunk(b"INDX", build(record, "INDX"))


def index_content(directory: Directory) -> bytes:
    """The index, not deflated yet."""
    out = bytearray(_sized(directory.head))
    out += varint(len(directory.shared))
    for (kind, id_), chunk in directory.shared.items():
        out += kind + id_ + _place(chunk)
    out += varint(len(directory.attachments))
    for held in directory.attachments.values():
        out += _text(held.name) + varint(held.size) + varint(len(held.parts))
        out += b"".join(map(_place, held.parts))
    out += varint(len(directory.aliases))
    for name, (of, target) in directory.aliases.items():
        out += _text(name) + bytes((of,)) + _sized(target)
    out += varint(len(directory.clips))
    for clip in directory.clips.values():
        out += _clip(clip)
    return bytes(out)


def _sized(data: bytes) -> bytes:
    return varint(len(data)) + data


def _text(text: str) -> bytes:
    return _sized(text.encode("utf-8"))


def _varints(values: Iterable[int]) -> bytes:
    return b"".join(map(varint, values))


def _place(chunk: Chunk) -> bytes:
    assert chunk.length is not None
    return varint(chunk.offset) + varint(chunk.length)


def _clip(clip: ClipRow) -> bytes:
    segments, gap, length = clip.packed or packed_segments(clip)
    rate = clip.rate_numerator, clip.rate_denominator
    out = _text(clip.name) + clip.skeleton + _varints((clip.n_frames, *rate, len(clip.signals)))
    for s in clip.signals:
        kinds = s.n_channels, s.samples_per_frame, s.skip, s.spare, s.codec, s.codec_version
        out += _varints(kinds)
    out += _place(clip.clip) + _sized(segments) + _varints((gap, length, len(clip.ancillary)))
    return out + b"".join(chunk.type + _place(chunk) for chunk in clip.ancillary)


def packed_segments(clip: ClipRow) -> tuple[bytes, int, int]:
    """The fields ``segments``, ``cend_gap`` and ``cend_length`` of a clip."""
    if clip.cend is None or clip.cend.length is None:
        raise FormatError(f"clip {clip.name!r} has no CEND and cannot be indexed")
    out, end = bytearray(), clip.clip.offset + clip.clip.size
    for row in clip.segments:
        header = row.header
        fields = (row.offset - end, row.size, header.signal, header.n_frames)
        flags = header.flags | PACKETS.get(row.packet, 0)
        out += _varints((*fields, header.lead, header.tail, flags))
        end = row.stop
    return bytes(out), clip.cend.offset - end, clip.cend.length


def parse_index(payload: bytes, limit: int) -> Directory:
    """The Directory in the payload of an INDX; ``limit`` bounds its inflated size."""
    outer = parse(payloads.Indx, payload, "INDX")
    check("INDX: inflated size", outer.size, limit)
    return parse_content(inflate(outer.data, outer.size, "INDX"))


def parse_content(content: bytes) -> Directory:
    """The Directory in an index that was inflated."""
    read = Cursor(content, "INDX")
    directory = Directory(head=read.sized())
    for _ in range(read.varint()):
        key = read.take(4), read.take(16)
        if key in directory.shared:
            raise FormatError(f"INDX: two entries of {key[0]!r} have the id {key[1].hex()}")
        directory.shared[key] = Chunk(key[0], 0, read.varint(), read.varint())
    for _ in range(read.varint()):
        name, size, n_parts = read.text(), read.varint(), read.varint()
        parts = [Chunk(b"ATTA", 0, read.varint(), read.varint()) for _ in range(n_parts)]
        if not parts:
            raise FormatError(f"INDX: attachment {name!r} has no part")
        _add(directory.attachments, name, AttachmentRow(name, size, parts))
    for _ in range(read.varint()):
        name, of = read.text(), read.take(1)[0]
        if of not in ALIASED:
            raise FormatError(f"INDX: alias {name!r} is one of {of}, not of 0, 1 or 2")
        _add(directory.aliases, name, (of, read.sized()))
    seen: dict[tuple[int, ...], SignalRow] = {}  # those of an archive are few
    for _ in range(read.varint()):
        row = _parse_clip(read, seen)
        _add(directory.clips, row.name, row)
    return directory


def _add(table: Settings, name: str, row: object) -> None:
    if name in table:
        raise FormatError(f"INDX: two entries are named {name!r}")
    table[name] = row


def _parse_clip(read: Cursor, seen: dict[tuple[int, ...], SignalRow]) -> ClipRow:
    number = read.varint
    name, skeleton = read.text(), read.take(16)
    n_frames, numerator, denominator = number(), number(), number()
    signals = tuple(_parse_signal(number, seen) for _ in range(number()))
    if not signals:
        raise FormatError(f"INDX: clip {name!r} has no signal")
    clip = Chunk(b"CLIP", 0, number(), number())
    packed = read.sized(), number(), number()
    ancillary = [Chunk(read.take(4), 1, number(), number()) for _ in range(number())]
    row = PackedClipRow(name, skeleton, n_frames, numerator, denominator, signals, clip)
    row.ancillary = ancillary
    row.keep_packed(packed, parse_segments)
    return row


def _parse_signal(number: Any, seen: dict[tuple[int, ...], SignalRow]) -> SignalRow:
    key = number(), number(), number(), number(), number(), number()
    if key not in seen:
        n_channels, samples, skip, spare, codec, version = key
        seen[key] = SignalRow(n_channels, samples, codec, version, skip, spare)
    return seen[key]


def parse_segments(clip: ClipRow, packed: tuple[bytes, int, int]) -> tuple[list[SegmentRow], Chunk]:
    """The segments of a clip, and its CEND."""
    data, gap, length = packed
    segments: list[SegmentRow] = []
    at, first, where = 0, [0] * len(clip.signals), f"INDX: clip {clip.name!r}"
    end = clip.clip.offset + clip.clip.size  # INDX-01
    read = Cursor(data, where)
    while read.at < len(data):
        at, size, signal, n_frames, lead, tail, flags = (read.varint() for _ in range(7))
        if signal >= len(first):
            raise FormatError(f"{where} has a segment of signal {signal}")
        kind = next((kind for kind, bit in PACKETS.items() if flags & bit), 0)
        flags &= ~PACKETS.get(kind, 0)
        header = SegmentHeader(signal, first[signal], n_frames, lead, tail, flags)
        if kind in SHORT and header != SegmentHeader(0, first[0], 1, flags=flags & FRESH):
            raise FormatError(f"{where} has {header} as a packet of kind {kind}")
        segments.append(SegmentRow(end + at, size, header, kind))
        first[signal] += n_frames
        end += at + size
    return segments, Chunk(b"CEND", 0, end + gap, length)
