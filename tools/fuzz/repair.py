"""A file taken apart, and put together again with every number around a change made right.

So a mutation gets past checksums, ids, packet numbers and the index, and, where that is wanted,
past the hashes of values and sources, to what is behind them.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from unittest import mock

import mcz
from mcz.container import payloads
from mcz.container.chunks import (
    CRC,
    END,
    FOOT,
    FRAME,
    OPEN_LENGTH,
    SEGMENT,
    SIGNATURE,
    Chunk,
    ChunkFlag,
    Packet,
    build_chunk,
    build_foot,
    build_header,
    build_packet,
    implied_by,
    parse_foot,
    read_chunk,
)
from mcz.container.directory import Directory, Indx
from mcz.container.index import build_index
from mcz.container.model_records import value_hash
from mcz.container.parser_drivers import packets
from mcz.container.scan import scan
from mcz.container.segments import SegmentHeader, mask_of, parse_segment_header
from mcz.container.source import open_source
from mcz.errors import FormatError, MczError
from mcz.files.reading.clip import Clip
from mcz.model.schema import build, deflate, inflate, parse, read_varint, varint
from tools.records import id_of

SHARED = (b"SKEL", b"SRCE", b"MODL")  # chunks with an id
MOST_TABLE = 4096  # bytes of a stream table that is looked for


@dataclass(frozen=True, slots=True)
class Piece:
    """A chunk: its payload, or its packets where it is open.

    INDX is not kept but made anew: before a FOOT, a piece of that type, where ``payload`` is not
    empty.
    """

    type: bytes
    flags: int = 0
    payload: bytes = b""
    packets: tuple[Packet, ...] | None = None


Pieces = list[Piece]


def pieces_of(data: bytes) -> Pieces:
    """The chunks of a file, whose checksums are checked no further; raises FormatError."""
    source, at = open_source(data), len(SIGNATURE)
    pieces: Pieces = []
    indexed = False
    while at < len(data):
        if not data[at : at + 1].isalpha():
            if parse_foot(data[at : at + FOOT.size], at) is None:
                raise FormatError(f"neither a chunk nor a FOOT begins at {at}")
            pieces.append(Piece(b"FOOT", 0, b"indexed" if indexed else b""))
            at += FOOT.size
            continue
        chunk = read_chunk(source, at)
        indexed = chunk.type == b"INDX"
        if chunk.length is None:
            found = list(packets(source, chunk))
            inner = tuple(event.packet for event in found[:-1])
            pieces.append(Piece(chunk.type, chunk.flags, b"", inner))
            at = found[-1].end
        else:
            payload = _payload(data, chunk)
            if not indexed:
                pieces.append(Piece(chunk.type, chunk.flags, payload))
            at += chunk.size
    return pieces


def join_pieces(
    pieces: Sequence[Piece], change_index: Callable[[bytes], bytes] | None = None
) -> bytes:
    """The file of these pieces. ``change_index`` changes the inflated content of its last INDX."""
    out, due, index_end = SIGNATURE, 0, 0
    last = max((n for n, piece in enumerate(pieces) if piece.type == b"FOOT"), default=-1)
    for n, piece in enumerate(pieces):
        if piece.type == b"CLIP":
            due = 0
        if piece.type == b"FOOT":
            index = _index_of(out) if piece.payload else b""
            if index and change_index is not None and n == last:
                index = changed_index(index, change_index)
            index_end = len(out) + len(index)
            out += index + build_foot(index_end - len(index) if index else 0, len(index))
        elif piece.packets is None:
            out += build_chunk(piece.type, piece.payload, piece.flags)
            due = _due(piece.payload, due) if piece.type == b"DATA" else due
        else:
            body, due = _open(piece, due)
            out += body
    return out


def _due(segment: bytes, due: int) -> int:
    """The frame of signal 0 that follows a segment."""
    try:
        header, _ = parse_segment_header(segment)
    except FormatError:
        return due
    return due if header.signal else header.stop


def _open(piece: Piece, due: int) -> tuple[bytes, int]:
    """An open DATA whose packets are numbered anew, and the frame that follows it."""
    out = build_header(piece.type, piece.flags, OPEN_LENGTH)
    assert piece.packets is not None
    told = b""
    for number, packet in enumerate(piece.packets):
        implied = b""
        if packet.kind == FRAME:
            implied, due = implied_by(due, _mask(told)), due + 1
        elif packet.kind == SEGMENT:
            due, told = _due(packet.body, due), packet.body
        out += build_packet(replace(packet, sequence=number, implied=implied))
    return out + build_packet(Packet(END, len(piece.packets), b"")), due


def _mask(segment: bytes) -> bytes:
    """The mask that frames behind a segment imply, as far as it can be read."""
    try:
        return mask_of(segment)
    except FormatError:
        return b""


def _index_of(data: bytes) -> bytes:
    """The INDX of what is in ``data``, as far as it can be listed."""
    whole = open_source(data + build_foot(0, 0))
    directory: Directory
    try:
        directory = scan(whole).directory
    except MczError:
        try:
            found = scan(whole, salvage=True)
            directory = found.directory
            for name in [n for n, row in directory.clips.items() if row.cend is None]:
                del directory.clips[name]
            head = next((chunk for chunk in found.chunks if chunk.type == b"HEAD"), None)
            directory.head = _payload(data, head) if head else directory.head
        except MczError:
            return b""
    try:
        return build_index(directory)
    except MczError:
        return b""


def _payload(data: bytes, chunk: Chunk) -> bytes:
    return data[chunk.payload_offset :][: chunk.length]


def changed_index(index: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """The INDX chunk with its inflated content passed through ``change``."""
    outer = parse(Indx, index[16 : -CRC.size], "INDX")
    content = change(inflate(outer.data, outer.size, "INDX"))
    outer.size, outer.data = len(content), deflate(content)
    return build_chunk(b"INDX", build(outer, "INDX"), ChunkFlag.ANCILLARY)


def with_payload(pieces: Sequence[Piece], which: int, payload: bytes) -> Pieces:
    """``pieces`` with one payload exchanged, and its id wherever another piece names it."""
    old = pieces[which]
    changed = [*pieces[:which], replace(old, payload=payload), *pieces[which + 1 :]]
    if old.type not in SHARED:
        return changed
    before, after = id_of(old.type, old.payload), id_of(old.type, payload)
    for n, piece in enumerate(changed):
        if n != which and before in piece.payload:
            # SKEL, MODL and SRCE may name each other, so that an id changes another.
            changed = with_payload(changed, n, piece.payload.replace(before, after))
    return changed


@dataclass(frozen=True, slots=True)
class Table:
    """The table of a DATA payload, found without CLIP: the streams that are present."""

    start: int  # offset of the bitmap
    n_bitmap: int
    streams: tuple[bytes, ...]


def table_of(payload: bytes) -> Table | None:
    """The stream table of a segment, found by its crc; None where there is none."""
    try:
        _, start = parse_segment_header(payload)
    except FormatError:
        return None
    crc = zlib.crc32(payload[:start])
    for size in range(start, min(len(payload) - 3, MOST_TABLE)):
        if struct.unpack_from("<I", payload, size)[0] == crc:
            table = _split_table(payload, start, size)
            if table is not None:
                return table
        crc = zlib.crc32(payload[size : size + 1], crc)
    return None


def _split_table(payload: bytes, start: int, end: int) -> Table | None:
    """The table from ``start`` to ``end``: a bitmap as long as makes the lengths come out even."""
    for n_bitmap in range(end - start + 1):
        present = int.from_bytes(payload[start : start + n_bitmap], "little").bit_count()
        at, lengths = start + n_bitmap, []
        try:
            for _ in range(present):
                length, at = read_varint(payload[:end], at)
                lengths.append(length)
        except FormatError:
            continue
        if at == end and sum(lengths) == len(payload) - end - 4:
            ends = [end + 4 + sum(lengths[: n + 1]) for n in range(present)]
            streams = (payload[e - n : e] for e, n in zip(ends, lengths, strict=True))
            return Table(start, n_bitmap, tuple(streams))
    return None


def with_streams(payload: bytes, table: Table, streams: Sequence[bytes]) -> bytes:
    """The segment with other streams, none of them empty, in the places of those that it has."""
    head = payload[: table.start + table.n_bitmap] + b"".join(varint(len(s)) for s in streams)
    return head + struct.pack("<I", zlib.crc32(head)) + b"".join(streams)


def with_header(payload: bytes, **fields: int) -> bytes:
    """The segment with other ``fields`` of its SegmentHeader; its table's checksum is right."""
    header, start = parse_segment_header(payload)
    table = table_of(payload)
    new: SegmentHeader = replace(header, **fields)
    numbers = (new.signal, new.first, new.n_frames, new.lead, new.tail)
    head = b"".join(map(varint, numbers)) + bytes((new.flags,))
    if table is None:
        return head + payload[start:]
    rest = payload[start : start + table.n_bitmap]
    whole = head + rest + b"".join(varint(len(s)) for s in table.streams)
    return whole + struct.pack("<I", zlib.crc32(whole)) + b"".join(table.streams)


def with_hashes(data: bytes, max_decoded: int | None = None) -> bytes:
    """The file with hashes of what its clips decode to and restore; raises MczError."""
    pieces = pieces_of(data)
    with mcz.open(data, max_decoded=max_decoded) as file:
        found = {name: _hashes(clip) for name, clip in file.clips.items()}
    pending: tuple[list[bytes], bytes | None] | None = None
    for n, piece in enumerate(pieces):
        if piece.type == b"CLIP":
            fields = parse(payloads.Clip, piece.payload, "CLIP")
            pending = found.get(fields.name)  # the index may list other clips, or in another order
            if pending is not None and pending[1] is not None and fields.source:
                fields.source.size = len(pending[1])
                pieces[n] = replace(piece, payload=build(fields, "CLIP"))
        elif piece.type == b"CEND" and pending is not None:
            fields = parse(payloads.Cend, piece.payload, "CEND")
            fields.value_sha256 = pending[0]
            if pending[1] is not None:
                fields.source_sha256 = hashlib.sha256(pending[1]).digest()
            pieces[n] = replace(piece, payload=build(fields, "CEND"))
    return join_pieces(pieces)


@contextmanager
def without_hash_checks() -> Iterator[None]:
    """Nobody compares the hashes of values and sources of clips."""
    with mock.patch.object(Clip, "_compare"), mock.patch.object(Clip, "_check_source"):
        yield


def _hashes(clip: Clip) -> tuple[list[bytes], bytes | None]:
    """The value hash of each signal, and the restored source where there is one."""
    with without_hash_checks():
        hashes = [value_hash(*clip.read_masked(signal=info.index)) for info in clip.signals]
        if clip.source is None or not all(info.codec.lossless for info in clip.signals):
            return hashes, None
        try:
            return hashes, clip.source_bytes()
        except MczError:
            return hashes, None
