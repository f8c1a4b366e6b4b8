"""Invalid, one fault each: DATA, its segments, and packets of open DATA."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from mcz.container import payloads
from mcz.container.directory import PACKETS
from mcz.container.packets import (
    END,
    FRAME,
    NUMBERED,
    SEGMENT,
    Packet,
    build_packet,
    numbered_frame,
)
from mcz.container.segments import (
    FRAME_NOTES,
    FRESH,
    MASKS,
    SegmentHeader,
    StreamCounts,
    parse_table,
)
from mcz.numbers import Grid, GridKind
from mcz.schema import read_varint, varint
from tools.vectors.bad_clips import indexed
from tools.vectors.craft import Broken, Crafter, Vector, file_of, finished
from tools.vectors.edits import Edit, Made, flip, framed, headed, plus, put, raw_stream, table
from tools.vectors.motions import column, dance
from tools.vectors.uncommon import live_file

N_GROUPS = 2  # of a dance


def vectors() -> Iterable[Vector]:
    data, packets = Broken("invalid/data"), Broken("invalid/packets")
    _tables(data)
    _empty_stream(data)
    _headers(data)
    _segments(data)
    _bombs(data)
    _packets(packets)
    _open_data(packets)
    return [*data.vectors, *packets.vectors]


def _tables(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("table-crc", "A table_crc of table and streams.", crc_of_all),
        ("bit-beyond-streams", "A bit beyond the last stream.", table(N_GROUPS, present=b"\x07")),
        ("streams-too-short", "The streams end before the table says.", lambda data: data[:-1]),
        ("streams-too-long", "A byte follows the last stream.", plus(b"\0")),
        ("varint", "A varint not in its shortest form.", table(N_GROUPS, first_frame=b"\x80\0")),
        ("no-table", "A DATA of no bytes.", lambda data: b""),
        ("signal-beyond", "A segment of signal 1 of 1.", table(N_GROUPS, signal=b"\1")),
    )
    for name, purpose, edit in cases:
        shelf.edited(name, "DATA", purpose, DATA=edit)


def _empty_stream(shelf: Broken) -> None:
    def with_masks(made: Made) -> Made:
        ((header, streams),) = made
        return [(replace(header, flags=header.flags | MASKS), [b"", b"", *streams])]

    def marked(payload: bytes) -> bytes:
        found = parse_table(payload, StreamCounts(N_GROUPS, 1))
        lengths = b"\0" + b"".join(varint(length) for length in found.lengths if length)
        return table(N_GROUPS, present=b"\x0d", lengths=lengths)(payload)

    purpose = "A mask that is marked as present and has no bytes."
    shelf.edited("stream-of-nothing", "DATA", purpose, segments=with_masks, DATA=marked)


def _headers(shelf: Broken) -> None:
    def noted(made: Made) -> Made:
        ((header, streams),) = made
        return [(replace(header, flags=header.flags | FRAME_NOTES), [b"\0\0", *streams])]

    cases: tuple[tuple[str, str, str, Callable[[Made], Made]], ...] = (
        ("flag", "A reserved flag of a segment is set.", "DATA", headed(0, flags=0x11)),
        ("lead-before-0", "A lead beyond the first frame.", "DATA", headed(0, lead=1)),
        ("first-not-fresh", "The first segment needs another.", "DATA", headed(0, flags=0)),
        ("frame-notes-without-source", "Notes on no source.", "Frame notes", noted),
    )
    for name, purpose, spec, edit in cases:
        shelf.edited(name, spec, purpose, segments=edit)


def _segments(shelf: Broken) -> None:
    def empty_between(made: Made) -> Made:
        header, streams = made[1]
        return [made[0], (replace(header, n_frames=0), streams), made[1]]

    cases: tuple[tuple[str, str, Callable[[Made], Made]], ...] = (
        ("gap", "The second segment begins a frame late.", headed(1, first=5)),
        ("overlap", "The second segment begins a frame early.", headed(1, first=3)),
        ("order", "The segments come in the wrong order.", lambda made: made[::-1]),
        ("segment-missing", "The clip's second half is missing.", lambda made: made[:1]),
        ("no-frames", "A segment of no frames.", empty_between),
        (
            "frames-beyond",
            "A segment behind the clip's last frame.",
            lambda made: [*made, (SegmentHeader(0, 8, 4), made[1][1])],
        ),
    )
    for name, purpose, edit in cases:
        shelf.add(name, "DATA", purpose, file_of(dance(8), segment_frames=4, segments=edit))


def _bombs(shelf: Broken) -> None:
    spec = "Limits and profiles; DATA"
    shelf.add("memory-bomb", spec, "2^50 frames of a constant in one segment.", _bomb(2**50, 1))
    purpose = "12 GB of a constant, in segments that each keep the limit."
    shelf.add("memory-bomb-in-segments", spec, purpose, _bomb(2**20, 1500))


def _bomb(n_frames: int, n_segments: int) -> bytes:
    constant, total = raw_stream([[0]], [0]), n_frames * n_segments

    def many(made: Made) -> Made:
        return [(SegmentHeader(0, i * n_frames, n_frames), [constant]) for i in range(n_segments)]

    return file_of(
        column([0.0], Grid(GridKind.FIXED, 0)),
        segments=many,
        CLIP=put(payloads.CLIP, "n_frames", varint(total)),
        CEND=put(payloads.CEND, "n_frames", varint(total)),
        row=indexed(n_frames=total),
    )


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


def crc_of_all(payload: bytes) -> bytes:
    size = parse_table(payload, StreamCounts(N_GROUPS, 1)).size
    crc = struct.pack("<I", zlib.crc32(payload[: size - 4] + payload[size:]))
    return payload[: size - 4] + crc + payload[size:]


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
