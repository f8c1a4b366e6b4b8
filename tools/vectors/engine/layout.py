"""An MCZ file as a list of parts that can be edited, and as bytes again, with all repaired.

What is repaired: checks and lengths of chunks, packets and segments; ids of shared chunks where
others name them; offsets and lengths in INDX; FOOT.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

from mcz.container import payloads
from mcz.container.chunks import (
    CHECK_SIZE,
    CRC,
    END,
    FOOT,
    FRAME,
    FRAMING,
    HEADER,
    SEGMENT,
    SIGNATURE,
    Chunk,
    Packet,
    build_foot,
    build_packet,
    implied_by,
    packet_check,
    parse_chunk_header,
)
from mcz.container.directory import (
    CONTINUES,
    ClipRow,
    Directory,
    Indx,
    PreviousIndex,
    SegmentRow,
    signal_rows,
)
from mcz.container.index import Listing, end_of, segment_rows
from mcz.container.index_reader import ClipTables, directory_of, parse_index
from mcz.container.parser_drivers import packets
from mcz.container.segments import SegmentHeader, build_segment, mask_of, parse_segment_header
from mcz.container.source import open_source
from mcz.errors import FormatError, MczError, TruncatedError
from mcz.model.schema import EXTENDED, build, deflate, parse, read_varint
from tools.records import id_of

SHARED = (b"SKEL", b"MODL", b"SRCE")
REFER = (b"SKEL", b"CLIP", b"ALIA")  # chunks that name shared ones
OPEN = 2**64 - 1
LIMIT = 2**40


@dataclass
class Segment:
    """A segment taken apart; ``was`` is the header before edits."""

    header: SegmentHeader
    streams: list[bytes]
    extension: bytes = b""

    @classmethod
    def of(cls, payload: bytes) -> Segment:
        """The parts of ``payload``; streams at the end may be missing that are empty."""
        header, start = parse_segment_header(payload)
        for size in (*range(1, len(payload)), 0):  # most have streams
            with suppress(TruncatedError):
                lengths, extension, at = cls._table(payload, start, size, header.flags)
                if payload[at : at + 4] == struct.pack("<I", zlib.crc32(payload[:at])):
                    break
        else:
            raise ValueError("the payload is no segment")
        streams, at = [], at + 4
        for length in lengths:
            streams.append(payload[at : at + length])
            at += length
        return cls(header, streams, extension)

    @staticmethod
    def _table(payload: bytes, start: int, size: int, flags: int) -> tuple[list[int], bytes, int]:
        """Lengths of streams and extension, behind a bitmap of ``size``, and where they end."""
        at, bitmap = start + size, int.from_bytes(payload[start : start + size], "little")
        lengths = []
        for index in range(8 * size):
            length = 0
            if bitmap >> index & 1:
                length, at = read_varint(payload, at)
            lengths.append(length)
        extension = b""
        if flags & EXTENDED and at < len(payload):
            length, at = read_varint(payload, at)
            extension, at = payload[at : at + length], at + length
        return lengths, extension, at

    def build(self) -> bytes:
        return build_segment(self.header, self.streams, self.extension)


@dataclass(eq=False)
class Part:
    """A chunk, a packet of an open DATA or a FOOT; ``place`` is its payload in the base file.

    ``frame`` has fields of the header, and a packet's ``head``, ``number`` and ``check``, that are
    not repaired; ``outer`` are edits of its bytes as they are written.
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
            data = self._packet()
        else:
            data = self.payload if self.type == b"FOOT" else frame_chunk(self)
        for edit in self.outer:
            data = edit(data)
        return data

    @property
    def head_size(self) -> int:
        if self.packet is None:
            return 0 if self.type == b"FOOT" else HEADER.size
        return len(self._head(self.packet))

    def _head(self, packet: Packet) -> bytes:
        made = build_packet(replace(packet, body=self.payload))
        return self.frame.get("head", made[: -CHECK_SIZE - len(self.payload)])

    def _packet(self) -> bytes:
        assert self.packet is not None
        head, packet = self._head(self.packet), self.packet
        check = packet_check(head, self.payload, packet.implied)
        return head + self.payload + self.frame.get("check", check)


def frame_chunk(part: Part) -> bytes:
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
    at, source = len(SIGNATURE), open_source(data)
    while at < len(data):
        if not data[at : at + 1].isalpha():
            yield Part(b"FOOT", data[at : at + FOOT.size], place=at)
            at += FOOT.size
            continue
        chunk = parse_chunk_header(data[at : at + HEADER.size], at)
        if chunk.length is None:
            yield Part(chunk.type, b"", chunk.flags, place=at + HEADER.size, open=True)
            at += HEADER.size
            for event in packets(source, chunk):
                yield Part(b"packet", event.payload, place=event.body, packet=event.packet)
                at = event.end
            continue
        payload = data[chunk.payload_offset :][: chunk.length]
        yield Part(chunk.type, payload, chunk.flags, place=chunk.payload_offset)
        at += chunk.size


class Layout:
    """A file in parts. ``index`` is the content of its last INDX, to be edited after repair."""

    def __init__(self, data: bytes) -> None:
        self.parts = list(parts_of(data))
        self.data, self.signature = data, data[: len(SIGNATURE)]
        self.ids = {
            part: id_of(part.type, part.payload) for part in self.parts if part.type in SHARED
        }
        self.headers = {part: part.taken_apart().header for part in self.parts if has_segment(part)}
        self.payloads = {part: part.payload for part in self.parts}

    def find(self, type_: bytes, number: int = 0) -> Part:
        """The part of this type and number, from 0, or from the end where it is negative."""
        parts = [part for part in self.parts if part.type == type_]
        if not -len(parts) <= number < len(parts):
            raise ValueError(f"there is no {type_.decode()} {number}")
        return parts[number]

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
                new = id_of(part.type, part.payload)
                if new != self.ids[part]:
                    renamed[self.ids[part]] = new
        self.renamed = renamed
        self._imply()

    def _imply(self) -> None:
        """Derive the frame and mask of packets of kind 2 from the packets before them."""
        due, mask = 0, b""
        for part in self.parts:
            packet = part.packet
            if packet is None or "number" in part.frame:
                continue
            if packet.kind == FRAME:
                with suppress(MczError):
                    part.packet = replace(packet, implied=implied_by(due, mask_of(mask)))
                due += 1
            elif packet.kind == SEGMENT:
                with suppress(MczError):
                    header, _ = parse_segment_header(part.payload)
                    if header.signal == 0:
                        due, mask = header.stop, part.payload

    def place(self) -> None:
        """Offsets of all parts."""
        at = len(self.signature)
        for part in self.parts:
            part.offset = at + part.head_size
            at += len(part.build())

    def index_content(self, listing: Listing) -> Listing:
        """The content that an INDX needs where it had ``listing`` of the base file."""
        moved = {part.place: part for part in self.parts if part.place is not None}
        was, new = listing.new, Directory()
        for name, (kind, target) in was.aliases.items():
            new.aliases[name] = kind, self.renamed.get(target, target)
        heads = [part for part in self.parts if part.type == b"HEAD"]
        new.head = heads[0].payload if heads else was.head
        shared = [
            (chunk, (kind, self.renamed.get(id_, id_)))
            for (kind, id_), old in was.shared.items()
            if (chunk := _move_chunk(old, moved)) is not None
        ]
        new.shared = {key: chunk for chunk, key in sorted(shared, key=lambda row: row[0].offset)}
        for name, row in was.attachments.items():
            parts = [chunk for old in row.parts if (chunk := _move_chunk(old, moved)) is not None]
            new.attachments[name] = replace(row, parts=sorted(parts, key=lambda one: one.offset))
        for clip in was.clips.values():
            self._move_clip(clip, moved)
        for clip in sorted(was.clips.values(), key=lambda row: row.clip.offset):
            if clip.clip.offset:
                new.clips[str(len(new.clips))] = clip  # two may have a name
        behind = [chunk for old in listing.behind if (chunk := _move_chunk(old, moved)) is not None]
        return Listing(new, listing.start, behind)

    def _move_clip(self, clip: ClipRow, moved: Moved) -> None:
        clip.skeleton = self.renamed.get(clip.skeleton, clip.skeleton)
        start, end = _move_chunk(clip.clip, moved), clip.clip.stop
        if start is None:
            clip.clip = replace(clip.clip, offset=0)
            return
        cend, last = clip.cend, end_of(clip, segment_rows(clip))
        was = {row.offset: row for row in clip.segments}
        part = moved[clip.clip.payload_offset]
        if part.payload != self.payloads[part]:
            self._follow(clip, part)
        clip.clip, clip.segments = start, list(self._segment_rows(start, was))
        end = clip.segments[-1].stop if clip.segments else start.stop
        moved_end = None if cend is None else _move_chunk(cend, moved)
        assert cend is not None
        clip.cend = moved_end or replace(cend, offset=end + cend.offset - last)
        ancillary = (_move_chunk(chunk, moved) for chunk in clip.ancillary)
        clip.ancillary = sorted(
            (chunk for chunk in ancillary if chunk and chunk.offset >= clip.cend.stop),
            key=lambda chunk: chunk.offset,
        )

    def _follow(self, clip: ClipRow, part: Part) -> None:
        """Copy to a row the fields of the edited CLIP, as far as they can be read."""
        with suppress(MczError):
            fields = parse(payloads.Clip, part.payload, "CLIP")
            clip.name = fields.name
            clip.rate_numerator = fields.rate_numerator
            clip.rate_denominator = fields.rate_denominator
            clip.signals = signal_rows(fields, "CLIP") or clip.signals
            if not fields.flags & payloads.OPEN_CLIP:
                clip.n_frames = fields.n_frames

    def _segment_rows(self, clip: Chunk, was: Mapping[int, SegmentRow]) -> Iterator[SegmentRow]:
        """The segments between a CLIP and what ends the clip."""
        first = next(n for n, part in enumerate(self.parts) if part.offset > clip.payload_offset)
        for part in self.parts[first:]:
            if part.type in (b"CEND", b"CLIP", b"FOOT"):
                return
            row = was.get(part.place or -1)
            packet = 0 if part.packet is None else part.packet.kind
            if part.type not in (b"DATA", b"packet") or part.open or (packet == END and not row):
                continue
            header = row.header if row else SegmentHeader(0, 0, 1)
            if has_segment(part):
                with suppress(FormatError):
                    header = parse_segment_header(part.payload)[0]
            yield SegmentRow(part.offset, len(part.payload), header, packet)


Moved = Mapping[int | None, Part]


def _move_chunk(chunk: Chunk, moved: Moved) -> Chunk | None:
    """The place of a chunk of the base file now; None where it is not there any more."""
    part = moved.get(chunk.payload_offset)
    if part is None:
        return None
    return replace(chunk, offset=part.offset - HEADER.size, length=len(part.payload))


def has_segment(part: Part) -> bool:
    """Return whether the payload of ``part`` is a segment with its table."""
    if part.packet is not None:
        return part.packet.kind == SEGMENT
    return part.type == b"DATA" and not part.open


def listing_of(part: Part, data: bytes) -> tuple[Listing, PreviousIndex | None]:
    """The content of an INDX of the file ``data``, and the one that it continues."""
    at = (part.place or 0) - HEADER.size
    chunk = data[at : at + len(part.payload) + FRAMING]
    listed = parse_index(chunk, at, LIMIT)
    behind = ClipTables(listed).ancillary(0, listed.start)
    return Listing(directory_of([listed]), listed.start, behind), listed.previous


def index_payload(content: bytes, previous: PreviousIndex | None) -> bytes:
    flags = 0 if previous is None else CONTINUES
    record = Indx(flags=flags, previous=previous, size=len(content), data=deflate(content))
    return build(record, "INDX")


def stop_of(part: Part) -> int:
    """The offset after a chunk."""
    return part.offset - HEADER.size + len(part.build())


def previous_of(part: Part) -> PreviousIndex:
    """The name that an INDX has for this one, which it continues."""
    chunk = part.build()
    (crc,) = CRC.unpack(chunk[-CRC.size :])
    return PreviousIndex(offset=part.offset - HEADER.size, length=len(chunk), crc=crc)


def foot_of(index: Part | None) -> bytes:
    """The FOOT behind this INDX, or behind none."""
    if index is None:
        return build_foot(0, 0)
    return build_foot(index.offset - HEADER.size, len(index.build()))
