"""An MCZ file as a list of parts that can be edited, and as bytes again, with all repaired.

What is repaired: checks and lengths of chunks, packets and segments; ids of shared chunks where
others name them; offsets and lengths in INDX; FOOT.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from mcz.container import payloads
from mcz.container.chunks import FOOT, HEADER, SIGNATURE, build_foot, parse_header
from mcz.container.index import PACKETS
from mcz.container.index_records import Index, IndexedClip
from mcz.container.packets import (
    CHECK_SIZE,
    END,
    SEGMENT,
    Packet,
    build_packet,
    read_packet,
)
from mcz.container.segments import SegmentHeader, build_segment
from mcz.container.segments import parse_header as parse_segment
from mcz.container.writer import payload_id
from mcz.schema import build, deflate, inflate, parse, read_varint, varint

SHARED = (b"SKEL", b"MODL", b"SRCE")
REFER = (b"SKEL", b"CLIP", b"ALIA")  # chunks that name shared ones
OPEN = 2**64 - 1
LIMIT = 2**40


@dataclass
class Segment:
    """A segment taken apart; ``was`` is the header before edits."""

    header: SegmentHeader
    streams: list[bytes]

    @classmethod
    def of(cls, payload: bytes) -> Segment:
        """The parts of ``payload``; streams at the end may be missing that are empty."""
        header, start = parse_segment(payload)
        for size in range(len(payload)):
            at, bitmap = start + size, int.from_bytes(payload[start : start + size], "little")
            lengths = []
            for index in range(8 * size):
                length = 0
                if bitmap >> index & 1:
                    length, at = read_varint(payload, at)
                lengths.append(length)
            if payload[at : at + 4] == struct.pack("<I", zlib.crc32(payload[:at])):
                break
        else:
            raise ValueError("the payload is no segment")
        streams, at = [], at + 4
        for length in lengths:
            streams.append(payload[at : at + length])
            at += length
        return cls(header, streams)

    def build(self) -> bytes:
        return build_segment(self.header, self.streams)


@dataclass(eq=False)
class Part:
    """A chunk, a packet of an open DATA or a FOOT; ``place`` is its payload in the base file.

    ``frame`` has fields of the chunk's header that are not repaired; ``outer`` are edits of its
    bytes as they are written.
    """

    type: bytes
    payload: bytes
    flags: int = 0
    place: int | None = None
    packet: Packet | None = None
    open: bool = False
    segment: Segment | None = None
    frame: dict[str, bytes] = field(default_factory=dict)
    outer: list[Callable[[bytes], bytes]] = field(default_factory=list)
    offset: int = 0  # of the payload, as it is written

    def taken_apart(self) -> Segment:
        if self.segment is None:
            self.segment = Segment.of(self.payload)
        return self.segment

    def build(self) -> bytes:
        if self.packet is not None:
            data = build_packet(replace(self.packet, body=self.payload))
        else:
            data = self.payload if self.type == b"FOOT" else framed(self)
        for edit in self.outer:
            data = edit(data)
        return data

    @property
    def head_size(self) -> int:
        if self.packet is None:
            return 0 if self.type == b"FOOT" else HEADER.size
        made = build_packet(replace(self.packet, body=self.payload))
        return len(made) - CHECK_SIZE - len(self.payload)


def framed(part: Part) -> bytes:
    """The bytes of a chunk, its checks made of what precedes them unless they are given."""
    length = OPEN if part.open else len(part.payload)
    fields = {
        "type": part.type,
        "flags": bytes((part.flags,)),
        "reserved": b"\0",
        "length": struct.pack("<Q", length),
    } | part.frame
    head = fields["type"] + fields["flags"] + fields["reserved"]
    check = struct.pack("<H", zlib.crc32(head + fields["length"]) & 0xFFFF)
    body = head + fields.get("header_check", check) + fields["length"]
    if part.open:
        return body
    body += part.payload
    return body + fields.get("crc", struct.pack("<I", zlib.crc32(body)))


def parts_of(data: bytes) -> Iterator[Part]:
    """The parts of a sound file."""
    at = len(SIGNATURE)
    while at < len(data):
        if not data[at : at + 1].isalpha():
            yield Part(b"FOOT", data[at : at + FOOT.size], place=at)
            at += FOOT.size
            continue
        chunk = parse_header(data[at : at + HEADER.size], at)
        if chunk.length is None:
            yield Part(chunk.type, b"", chunk.flags, place=at + HEADER.size, open=True)
            at += HEADER.size
            number = -1
            while number != END:
                packet, at = packet_at(data, at)
                number = packet.kind
                place = at - CHECK_SIZE - len(packet.body)
                yield Part(b"packet", packet.body, place=place, packet=packet)
            continue
        payload = data[chunk.payload_offset :][: chunk.length]
        yield Part(chunk.type, payload, chunk.flags, place=chunk.payload_offset)
        at += chunk.size


def packet_at(data: bytes, at: int) -> tuple[Packet, int]:
    """The packet at ``at``, and where it ends."""
    stop = at

    def read(size: int) -> bytes:
        nonlocal stop
        stop += size
        return data[stop - size : stop]

    return read_packet(read, LIMIT), stop


class Layout:
    """A file in parts. ``index`` is the content of its last INDX, to be edited after repair."""

    def __init__(self, data: bytes) -> None:
        self.parts = list(parts_of(data))
        self.signature = data[: len(SIGNATURE)]
        self.ids = {part: payload_id(part.payload) for part in self.parts if part.type in SHARED}
        self.headers = {part: part.taken_apart().header for part in self.parts if has_segment(part)}
        self.payloads = {part: part.payload for part in self.parts}

    def find(self, type_: bytes, number: int = 0) -> Part:
        """The part of this type and number, from 0, or from the end where it is negative."""
        found = [part for part in self.parts if part.type == type_]
        if not -len(found) <= number < len(found):
            raise ValueError(f"there is no {type_.decode()} {number}")
        return found[number]

    def settle(self) -> None:
        """Build segments that were edited, and give shared chunks their ids."""
        renamed: dict[bytes, bytes] = {}
        for part in self.parts:
            if part.segment is not None and has_segment(part):
                was = self.headers.get(part)
                untouched = part.segment.build()
                if was is None or untouched != self.payloads[part]:
                    part.payload = untouched
            if part.type in REFER:
                for old, new in renamed.items():
                    part.payload = part.payload.replace(old, new)
            if part in self.ids:
                new = payload_id(part.payload)
                if new != self.ids[part]:
                    renamed[self.ids[part]] = new
        self.renamed = renamed

    def place(self) -> None:
        """Offsets of all parts."""
        at = len(self.signature)
        for part in self.parts:
            part.offset = at + part.head_size
            at += len(part.build())

    def indexed(self, content: Index) -> None:
        """Make what an INDX says agree with the parts as they are placed."""
        moved = {part.place: part for part in self.parts if part.place is not None}
        self._move_shared(content, moved)
        heads = [part for part in self.parts if part.type == b"HEAD"]
        content.head = heads[0].payload if heads else content.head
        for clip in content.clips:
            self._move_clip(clip, moved)

    def _move_shared(self, content: Index, moved: dict[int | None, Part]) -> None:
        for row in [*content.shared, *(p for a in content.attachments for p in a.parts)]:
            part = moved.get(row.offset + HEADER.size)
            if part is not None:
                row.offset, row.length = part.offset - HEADER.size, len(part.payload)
        for row in content.shared:
            row.id = self.renamed.get(row.id, row.id)

    def _move_clip(self, clip: IndexedClip, moved: dict[int | None, Part]) -> None:
        clip.skeleton = self.renamed.get(clip.skeleton, clip.skeleton)
        start = clip.offset + HEADER.size
        was = start + clip.length + 4
        part = moved.get(start)
        if part is None:
            return
        clip.offset, clip.length = part.offset - HEADER.size, len(part.payload)
        end = part.offset + clip.length + 4
        rows, at = [], 0
        while at < len(clip.segments):
            numbers = []
            for _ in range(7):
                value, at = read_varint(clip.segments, at)
                numbers.append(value)
            was += numbers[0]
            found, was = moved.get(was), was + numbers[1]
            if found is not None:
                rows.append((found, numbers))
        listed = b""
        for found, numbers in sorted(rows, key=lambda row: row[0].offset):
            listed += self._segment_row(found, numbers, end)
            end = found.offset + len(found.payload)
        cend = moved.get(was + clip.cend_gap + HEADER.size)
        clip.segments = listed
        if cend is not None:
            clip.cend_gap = cend.offset - HEADER.size - end
            clip.cend_length = len(cend.payload)
        for row in clip.ancillary:
            other = moved.get(row.offset + HEADER.size)
            if other is not None:
                row.offset, row.length = other.offset - HEADER.size, len(other.payload)

    def _segment_row(self, part: Part, numbers: list[int], end: int) -> bytes:
        header = part.segment.header if part.segment else None
        if header is not None and header != self.headers.get(part):
            flags = header.flags | (PACKETS[SEGMENT] if part.packet else 0)
            numbers[2:] = [header.signal, header.n_frames, header.lead, header.tail, flags]
        numbers[:2] = [part.offset - end, len(part.payload)]
        return b"".join(map(varint, numbers))


def has_segment(part: Part) -> bool:
    """Return whether the payload of ``part`` is a segment with its table."""
    if part.packet is not None:
        return part.packet.kind == SEGMENT
    return part.type == b"DATA" and not part.open


def index_of(part: Part) -> Index:
    """The content of an INDX."""
    outer = parse(payloads.Indx, part.payload, "INDX")
    return parse(Index, inflate(outer.data, outer.size, "INDX"), "INDX")


def index_payload(content: bytes) -> bytes:
    return build(payloads.Indx(size=len(content), data=deflate(content)), "INDX")


def foot_of(index: Part | None) -> bytes:
    """The FOOT behind this INDX, or behind none."""
    if index is None:
        return build_foot(0, 0)
    return build_foot(index.offset - HEADER.size, len(index.build()))
