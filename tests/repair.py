"""Damage behind the checksums: change a payload and make every checksum around it right again."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace

import mcz
from mcz.container.chunks import FOOT, FRAME, Packet, build_foot, build_packet, implied_by
from mcz.container.parser_drivers import packets
from mcz.container.scan import scan
from mcz.container.segments import mask_of, parse_segment_header
from mcz.container.source import open_source
from tests.amounts import amount
from tools.fuzz import repair
from tools.fuzz.repair import Piece, pieces_of, table_of, with_payload

Parts = list[tuple[Piece, bytes]]


def parts_of(data: bytes) -> Parts:
    """The closed chunks of a valid file and their payloads; INDX and FOOT left out."""
    pieces = [piece for piece in pieces_of(data) if piece.packets is None and piece.type != b"FOOT"]
    return [(piece, piece.payload) for piece in pieces]


def join_parts(parts: Parts) -> bytes:
    """The file of these chunks, without an index."""
    return repair.join_pieces(
        [*(replace(piece, payload=data) for piece, data in parts), Piece(b"FOOT")]
    )


def replace_payload(parts: Parts, which: int, payload: bytes) -> Parts:
    """``parts`` with one payload exchanged, its table_crc and the ids that name it put right."""
    piece, old = parts[which]
    if piece.type == b"DATA":
        payload = _with_table_crc(old, payload)
    pieces = [replace(piece, payload=data) for piece, data in parts]
    return [(piece, piece.payload) for piece in with_payload(pieces, which, payload)]


def _with_table_crc(old: bytes, payload: bytes) -> bytes:
    """``payload`` with the checksum of a table as long as that of ``old``, which is unharmed."""
    table = table_of(old)
    assert table is not None
    size = len(old) - sum(map(len, table.streams))
    if size > len(payload):
        return payload
    crc = struct.pack("<I", zlib.crc32(payload[: size - 4]))
    return payload[: size - 4] + crc + payload[size:]


def with_index_content(data: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """The file with the inflated content of its INDX passed through ``change``."""
    start = FOOT.unpack(data[-FOOT.size :])[2]
    index = repair.changed_index(data[start : -FOOT.size], change)
    return data[:start] + index + build_foot(start, len(index))


def with_packets(data: bytes, change: Callable[[Packet], Packet]) -> bytes:
    """The file, without an index, with every packet passed through ``change``, and right checks."""
    out, at, source = b"", 0, open_source(data)
    for chunk in scan(source).chunks:
        if chunk.length is None:
            packets_of_chunk = list(packets(source, chunk))
            changed = imply_frames([change(event.packet) for event in packets_of_chunk[:-1]])
            out += data[at : chunk.payload_offset] + b"".join(map(build_packet, changed))
            at = packets_of_chunk[-1].offset
    return out + data[at : FOOT.unpack(data[-FOOT.size :])[2]] + build_foot(0, 0)


def imply_frames(packets: Iterable[Packet]) -> list[Packet]:
    """The packets of an open DATA, those of kind 2 with what they imply."""
    due, mask, implied = 0, b"", []
    for packet in packets:
        if packet.kind == FRAME:
            implied.append(replace(packet, implied=implied_by(due, mask)))
            due += 1
            continue
        with suppress(mcz.FormatError):
            header, _ = parse_segment_header(packet.body)
            if header.signal == 0:
                due, mask = header.stop, mask_of(packet.body)
        implied.append(packet)
    return implied


def use(data: bytes, *, salvage: bool = False) -> None:
    """Do with a file all that a reader can do; raises only MczError, whatever the bytes."""
    with mcz.open(data, salvage=salvage, verify=True) as file:
        _ = file.header, file.skeletons
        for attachment in file.attachments.values():
            attachment.read()
        for clip in file.clips.values():
            for signal in clip.signals:
                clip.read_masked(signal=signal.index)
                clip.read((0, min(1, clip.n_frames)), signal=signal.index)
            _ = clip.frame_numbers, clip.quality
            if clip.source is not None:
                clip.source_bytes()
        for id_, _skeleton in file.skeletons:
            if file.skeleton(id_, with_source=True).source is not None:
                file.skeleton_bytes(id_)


@contextmanager
def memory_below(most: int) -> Iterator[None]:
    """Fail where Python objects and arrays take more bytes at a time."""
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < most


def flips(size: int, at_most: int, seed: int) -> Iterator[tuple[int, int]]:
    """(byte, bit) of every bit, or of ``at_most`` of them drawn by ``seed``."""
    import random

    every, at_most = range(size * 8), amount(at_most, max(20, min(at_most // 3, 400)))
    chosen = every if len(every) <= at_most else sorted(random.Random(seed).sample(every, at_most))
    return ((n // 8, n % 8) for n in chosen)


def flip_bit(data: bytes, byte: int, bit: int) -> bytes:
    changed = bytearray(data)
    changed[byte] ^= 1 << bit
    return bytes(changed)
