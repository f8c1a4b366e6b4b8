"""Damage behind the checksums: change a payload and make every checksum around it right again."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace

import mcz
from mcz.container import payloads
from mcz.container.chunks import FOOT, HEADER, SIGNATURE, Chunk, build_chunk, build_foot
from mcz.container.packets import END, FRAME, NUMBERED, Packet, build_packet, read_packets
from mcz.container.scan import scan
from mcz.container.segments import StreamCounts, parse_table
from mcz.container.source import open_source
from mcz.container.writer import payload_id
from mcz.schema import build, deflate, inflate, parse

Parts = list[tuple[Chunk, bytes]]


def parts_of(data: bytes) -> Parts:
    """The closed chunks of a valid file and their payloads; INDX and FOOT left out."""
    found = scan(open_source(data))
    chunks = [chunk for chunk in found.chunks if chunk.type != b"INDX" and chunk.length is not None]
    return [(chunk, data[chunk.payload_offset :][: chunk.length]) for chunk in chunks]


def joined(parts: Parts) -> bytes:
    """The file of these chunks, without an index."""
    body = b"".join(build_chunk(chunk.type, payload, chunk.flags) for chunk, payload in parts)
    return SIGNATURE + body + build_foot(0, 0)


def replaced(parts: Parts, which: int, payload: bytes) -> Parts:
    """``parts`` with one payload exchanged, its table_crc and the ids that name it put right."""
    chunk, old = parts[which]
    if chunk.type == b"DATA":
        payload = _with_table_crc(parts, which, payload)
    changed = [*parts[:which], (chunk, payload), *parts[which + 1 :]]
    if chunk.type not in (b"SKEL", b"SRCE", b"MODL"):
        return changed
    before, after = payload_id(old), payload_id(payload)
    return [(c, p if i == which else p.replace(before, after)) for i, (c, p) in enumerate(changed)]


def _with_table_crc(parts: Parts, which: int, payload: bytes) -> bytes:
    size = _table_size(parts, which)
    if size > len(payload):
        return payload
    crc = struct.pack("<I", zlib.crc32(payload[: size - 4]))
    return payload[: size - 4] + crc + payload[size:]


def _table_size(parts: Parts, which: int) -> int:
    """Bytes of the stream table of an unharmed DATA."""
    data = joined(parts)
    with mcz.open(data) as file:
        offset = len(SIGNATURE) + sum(20 + len(p) for _, p in parts[:which]) + HEADER.size
        for clip in file.clips.values():
            for signal in clip.signals:
                for row in signal.rows:
                    if row.offset == offset:
                        counts: StreamCounts = signal.counts
                        return parse_table(parts[which][1], counts).size
    raise AssertionError(f"no segment at {offset}")


def with_index_content(data: bytes, change: object) -> bytes:
    """The file with the inflated content of its INDX passed through ``change``."""
    foot = FOOT.unpack(data[-FOOT.size :])
    start = foot[2]
    outer = parse(payloads.INDX, data[start + HEADER.size : -FOOT.size - 4], "INDX")
    content = change(inflate(outer.data, outer.size, "INDX"))  # type: ignore[operator]
    fields = {"size": len(content), "data": deflate(content)}
    chunk = build_chunk(b"INDX", build(payloads.INDX, fields, "INDX"))
    return data[:start] + chunk + build_foot(start, len(chunk))


def with_packets(data: bytes, change: Callable[[Packet], Packet]) -> bytes:
    """The file, without an index, with every packet passed through ``change``."""
    out, at = b"", 0
    for chunk in scan(open_source(data)).chunks:
        if chunk.length is None:
            stream = io.BytesIO(data)
            stream.seek(chunk.payload_offset)
            packets = [change(packet) for packet in read_packets(stream.read, 2**20)]
            end = Packet(END, len(packets), b"")
            out += data[at : chunk.payload_offset] + b"".join(map(build_packet, [*packets, end]))
            at = stream.tell()
    return out + data[at : FOOT.unpack(data[-FOOT.size :])[2]] + build_foot(0, 0)


def as_kind_2(data: bytes) -> bytes:
    """The file as format 0.3 has it: packets of frames do not check the frame's number."""

    def change(packet: Packet) -> Packet:
        if packet.kind != NUMBERED:
            return packet
        return replace(packet, kind=FRAME, check=None)

    return with_packets(data, change)


def use(data: bytes, *, salvage: bool = False) -> None:
    """Do with a file all that a reader can do; raises only MczError, whatever the bytes."""
    with mcz.open(data, salvage=salvage) as file:
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


def flips(size: int, at_most: int, seed: int) -> Iterator[tuple[int, int]]:
    """(byte, bit) of every bit, or of ``at_most`` of them drawn by ``seed``."""
    import random

    every = range(size * 8)
    chosen = every if len(every) <= at_most else sorted(random.Random(seed).sample(every, at_most))
    return ((n // 8, n % 8) for n in chosen)


def flipped(data: bytes, byte: int, bit: int) -> bytes:
    changed = bytearray(data)
    changed[byte] ^= 1 << bit
    return bytes(changed)
