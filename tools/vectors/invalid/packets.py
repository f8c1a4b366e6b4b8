"""Invalid, one fault each: packets of open DATA."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from mcz.container.index import PACKETS
from mcz.container.packets import (
    END,
    FRAME,
    NUMBERED,
    SEGMENT,
    Packet,
    build_packet,
    numbered_frame,
)
from mcz.container.segments import FRESH, SegmentHeader
from mcz.numbers import Grid, GridKind
from mcz.schema import read_varint, varint
from tools.vectors.build.edits import Edit, Made, Nth, at, flip, framed, raw_stream
from tools.vectors.build.files import Broken, Crafter, Vector, file_of, finished, live_file
from tools.vectors.build.motions import column, dance

MOST_BODY = 2**16  # bytes, of the base profile


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/packets")
    _packets(shelf)
    _open_data(shelf)
    _bodies(shelf)
    _first_group(shelf)
    return shelf.vectors


def _packets(shelf: Broken) -> None:
    def ended(sequence: int, body: bytes = b"") -> Edit:
        return lambda data: build_packet(Packet(END, sequence, body))

    cases: tuple[tuple[str, str, dict[str, Edit]], ...] = (
        (
            "sequence-gap",
            "The first packet is number 1.",
            {"packet": _packet(sequence=1), "end_packet": ended(2)},
        ),
        ("sequence-end", "The end packet repeats a number.", {"end_packet": ended(0)}),
        ("head-check", "A head_check of kind and sequence alone.", {"packet": _check_of_two}),
        ("body-damaged", "A flipped bit in the body_check of a packet.", {"packet": flip(-1)}),
        ("kind", "A segment in a packet of kind 3.", {"packet": _packet(kind=3)}),
        ("kind-4", "A packet of kind 4.", {"packet": _packet(kind=4)}),
        ("kind-bits", "A reserved bit of kind is set.", {"packet": _packet(kind=0x11)}),
        ("fresh", "Packet and segment differ on starting fresh.", {"packet": _packet(fresh=False)}),
        ("end-body", "An end packet with a body.", {"end_packet": ended(1, b"?")}),
        ("no-end", "No end packet.", {"end_packet": lambda data: b""}),
        ("varint", "A sequence number not in its shortest form.", {"packet": _overlong}),
    )
    for name, purpose, edits in cases:
        data = file_of(dance(), packets=True, index=False, **edits)
        shelf.add(name, "Open DATA and packets", purpose, data)
    spec = "Open DATA and packets"
    data = live_file(dance(3), index=False, frames=0)
    shelf.add("frame-first", spec, "A packet of kind 2 is the first of its DATA.", data)
    for name, made in (
        ("frame", Packet(FRAME, 1, b"")),
        ("numbered", numbered_frame(1, 1, b"", fresh=True)),
    ):
        second = _Second(lambda body, made=made: _of_body(made, body))
        data = file_of(dance(2), packets=True, index=False, segment_frames=1, packet=second)
        purpose = f"Kind {made.kind}, of a signal with two groups."
        shelf.add(f"{name}-of-two-groups", spec, purpose, data)
    data = live_file(dance(3), table=_flags(FRAME, PACKETS[FRAME]))
    shelf.add("frame-index", f"{spec}; INDX", "INDX says that a frame is not fresh.", data)
    _numbers(shelf)


def _of_body(made: Packet, body: bytes) -> Packet:
    """The packet of frame 1 with another body."""
    if made.kind == NUMBERED:
        return numbered_frame(made.sequence, 1, body, fresh=made.fresh)
    return replace(made, body=body)


def _numbers(shelf: Broken) -> None:
    """Packets of kind 3 that are not the frame that is due, or are not said to be of kind 3."""
    spec = "Open DATA and packets"
    purpose = "A packet of kind 3 is the first of its DATA."
    data = live_file(dance(3), index=False, frames=0, numbered=True)
    shelf.add("numbered-first", spec, purpose, data)
    for name, purpose, number in (
        ("number-next", "The check is that of the frame behind it.", lambda n: n + (n == 2)),
        ("number-before", "The check is that of the frame before it.", lambda n: n - (n == 2)),
        ("number-0", "All checks are those of frame 0.", lambda n: 0),
        ("number-u32", "The number has 2^32 more.", lambda n: n + 2**32 * (n == 2)),
    ):
        for ending, said, index in (("", "", True), ("-no-index", " Without INDX.", False)):
            data = live_file(dance(4), numbered=True, number=number, index=index)
            shelf.add(name + ending, f"{spec}; INDX", purpose + said, data)
    purpose = "A packet of kind 3 with the check of its body alone."
    alone = _Second(lambda body: Packet(NUMBERED, 1, body))
    shelf.add("number-none", spec, purpose, live_file(dance(3), numbered=True, packet=alone))
    swapped = _Second(lambda body: Packet(NUMBERED, 1, body, True, _check_ahead(body)))
    purpose = "A check of the number, 1, and then the body."
    shelf.add("number-ahead", spec, purpose, live_file(dance(3), numbered=True, packet=swapped))
    _indexed(shelf, spec)


def _indexed(shelf: Broken, spec: str) -> None:
    """INDX, which says other things of packets of kind 3; chunks of REPT with other flags."""
    said = (
        ("numbered-index-fresh", "not fresh", PACKETS[NUMBERED]),
        ("numbered-index-kind", "of kind 2", PACKETS[FRAME] | FRESH),
        ("numbered-index-kinds", "of kinds 2 and 3", PACKETS[FRAME] | PACKETS[NUMBERED] | FRESH),
    )
    for name, what, flags in said:
        data = live_file(dance(3), numbered=True, table=_flags(NUMBERED, flags))
        shelf.add(name, f"{spec}; INDX", f"INDX says that a packet of kind 3 is {what}.", data)

    for name, flags in (("critical", b"\0"), ("safe-to-copy", b"\3")):
        edits = {"repeat": (0,), "REPT_frame": framed(flags=flags), "index": False}
        data = live_file(dance(3), numbered=True, **edits)
        shelf.add(f"REPT-{name}", "Chunks; REPT", f"A REPT with flags {flags[0]}.", data)


def _check_ahead(body: bytes) -> bytes:
    return struct.pack("<H", zlib.crc32(struct.pack("<Q", 1) + body) & 0xFFFF)


class _Second:
    """Makes the second packet anew of its body."""

    def __init__(self, made: Callable[[bytes], Packet]) -> None:
        self.count, self.made = 0, made

    def __call__(self, packet: bytes) -> bytes:
        self.count += 1
        body = packet[_head_size(packet) + 2 : -2]
        return build_packet(self.made(body)) if self.count == 2 else packet


def _flags(kind: int, flags: int) -> Callable[[Any], Any]:
    """Give the last segment, a packet of this kind that starts fresh, these flags in INDX."""

    def edit(fields: Any) -> Any:
        row = fields.clips[0]
        assert row.segments[-1] == PACKETS[kind] | FRESH
        row.segments = row.segments[:-1] + varint(flags)
        return fields

    return edit


def _head_size(packet: bytes) -> int:
    """Bytes of kind, sequence (below 128) and length."""
    return 2 + len(varint(read_varint(packet, 2)[0]))


def _packet(**changes: Any) -> Edit:
    """The packet made anew, changed."""

    def edit(data: bytes) -> bytes:
        body = data[_head_size(data) + 2 : -2]
        assert build_packet(Packet(SEGMENT, 0, body)) == data
        return build_packet(replace(Packet(SEGMENT, 0, body), **changes))

    return edit


def _check_of_two(packet: bytes) -> bytes:
    size = _head_size(packet)
    check = struct.pack("<H", zlib.crc32(packet[:2]) & 0xFFFF)
    return packet[:size] + check + packet[size + 2 :]


def _overlong(packet: bytes) -> bytes:
    """The packet with its sequence number, 0, in two bytes."""
    size = _head_size(packet)
    head = packet[:1] + b"\x80\0" + packet[2:size]
    return head + struct.pack("<H", zlib.crc32(head) & 0xFFFF) + packet[size + 2 :]


def _open_data(shelf: Broken) -> None:
    def opened(flags: bytes) -> bytes:
        """The header of an open DATA."""
        blank = b"DATA" + b"\0" * 4 + b"\xff" * 8 + b"crc."
        return framed(flags=flags)(blank)[:16]

    crafter = Crafter()
    crafter._write(opened(b"\0") + build_packet(Packet(END, 0, b"")))
    spec = "Grammar; Open DATA and packets"
    shelf.add("outside", spec, "An open DATA outside a clip.", finished(crafter, index=False))
    good = file_of(dance(), packets=True, index=False)
    start = good.index(opened(b"\0"))
    flagged = good[:start] + opened(b"\1") + good[start + 16 :]
    shelf.add("flags", "Chunks; Open DATA and packets", "An open DATA with a flag.", flagged)


def _bodies(shelf: Broken) -> None:
    spec = "Open DATA and packets"
    for name, purpose, edits in (
        ("end-check", "An end packet whose body_check is not 0.", {"end_packet": at(-1, b"\1")}),
        ("end-kind-bits", "A reserved bit in the kind of an end packet.", {"end_packet": _bits}),
        (
            "length-beyond-end",
            "A packet of 60,000 bytes in a file of fewer.",
            {"packet": _header_of(60_000)},
        ),
        ("length-great", "A packet of 2^53 - 1 bytes.", {"packet": _header_of(2**53 - 1)}),
        ("segment-of-nothing", "A packet of kind 1 without a body.", {"packet": _header_of(0)}),
    ):
        data = file_of(dance(), packets=True, index=False, **edits)
        shelf.add(name, spec, purpose, data)
    long = column([0.0] * (MOST_BODY + 1 - 25), Grid(GridKind.FIXED, 0))
    rows = len(long.signals[0].values)
    header = SegmentHeader(0, 0, rows)
    wide = {"segments": lambda made: [(header, [_wide(rows)])]}
    data = file_of(long, packets=True, index=False, grouping="all", **wide)
    assert varint(MOST_BODY + 1) in data[:400]
    purpose = "A packet of 65,537 bytes in the base profile."
    shelf.add("body-limit", f"{spec}; Limits and profiles", purpose, data)
    for name, number, where in (("skipped", 3, "behind"), ("twice", 1, "before")):
        renumbered = Nth(2, _numbered(number))
        data = live_file(dance(4), numbered=True, index=False, packet=renumbered)
        purpose = f"A packet comes with the number of the one {where} it."
        shelf.add(f"sequence-{name}", spec, purpose, data)


def _wide(rows: int) -> bytes:
    """A stream of raw of so many rows of one byte."""
    return raw_stream([[0] * rows], [1])


def _bits(packet: bytes) -> bytes:
    head = b"\xc0" + packet[1:3]
    return head + struct.pack("<H", zlib.crc32(head) & 0xFFFF) + packet[5:]


def _header_of(length: int) -> Edit:
    """Another length in the head of the first packet, whose check is made anew."""

    def edit(packet: bytes) -> bytes:
        head = packet[:2] + varint(length)
        body = b"\0\0" if not length else packet[2 + len(varint(len(packet))) + 2 :]
        return head + struct.pack("<H", zlib.crc32(head) & 0xFFFF) + body

    return edit


def _numbered(sequence: int) -> Edit:
    """Another sequence number in the head of a short packet."""

    def edit(packet: bytes) -> bytes:
        size = _head_size(packet)
        head = packet[:1] + bytes((sequence,)) + packet[2:size]
        return head + struct.pack("<H", zlib.crc32(head) & 0xFFFF) + packet[size + 2 :]

    return edit


def _first_group(shelf: Broken) -> None:
    found: list[bytes] = []

    def kept(made: Made) -> Made:
        found.extend(made[1][1])
        return made

    def second(packet: bytes) -> bytes:
        return build_packet(Packet(FRAME, 1, found[0]))

    edits = {"segments": kept, "packet": Nth(1, second)}
    data = file_of(dance(2), packets=True, index=False, segment_frames=1, **edits)
    purpose = "Kind 2, with the stream of the first of two groups."
    shelf.add("frame-of-first-group", "Open DATA and packets", purpose, data)
