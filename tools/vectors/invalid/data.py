"""Invalid, one fault each: DATA and its segments."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from mcz.codecs import raw
from mcz.container import payloads
from mcz.container.segments import FRAME_NOTES, MASKS, SegmentHeader, StreamCounts, parse_table
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.vectors.build.edits import (
    Edit,
    Made,
    both,
    headed,
    indexed,
    plus,
    put,
    raw_stream,
    table,
)
from tools.vectors.build.files import Broken, Crafter, Vector, file_of, finished, rehash
from tools.vectors.build.motions import column, dance

N_GROUPS = 2  # of a dance
SEGMENT_ROWS = 2**23  # binary64 of the limit of a segment in the base profile


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/data")
    _tables(shelf)
    _empty_stream(shelf)
    _headers(shelf)
    _segments(shelf)
    _bombs(shelf)
    _cut_tables(shelf)
    _one_by_one(shelf)
    _table_of_unknown(shelf)
    return shelf.vectors


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
        CLIP=put(payloads.Clip, "n_frames", varint(total)),
        CEND=put(payloads.Cend, "n_frames", varint(total)),
        row=indexed(n_frames=total),
    )


def crc_of_all(payload: bytes) -> bytes:
    size = parse_table(payload, StreamCounts(N_GROUPS, 1)).size
    crc = struct.pack("<I", zlib.crc32(payload[: size - 4] + payload[size:]))
    return payload[: size - 4] + crc + payload[size:]


def _table_of_unknown(data: Broken) -> None:
    """A fault in a clip whose motion is of an unknown codec, which is legal."""
    crafter = Crafter(DATA=crc_of_all)
    crafter.clip(dance(), codec=replace(raw.CODEC, id=2**20))
    purpose = "A table_crc of table and streams, of a codec that nobody knows."
    data.add("table-crc-unknown-codec", "DATA; Strict reading", purpose, finished(crafter))


def _cut_tables(shelf: Broken) -> None:
    """Stream tables that end early."""
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("cut-in-varint", "A DATA that ends within a varint.", lambda _: b"\0\x80"),
        ("cut-before-flags", "A DATA that ends before its flags.", lambda data: data[:5]),
        ("cut-before-bitmap", "A DATA that ends before its bitmap.", lambda data: data[:6]),
        ("cut-in-lengths", "A DATA that ends within its lengths.", lambda data: data[:8]),
        ("cut-in-table-crc", "A DATA that ends within its table_crc.", lambda data: data[:11]),
        ("length-of-stream", "A stream of 2^53 - 1 bytes.", _long_stream),
    )
    for name, purpose, edit in cases:
        shelf.edited(name, "DATA", purpose, DATA=edit, index=False)


def _long_stream(payload: bytes) -> bytes:
    return table(N_GROUPS, lengths=varint(2**53 - 1) + b"\1")(payload)


def _one_by_one(shelf: Broken) -> None:
    def swapped(made: Made) -> Made:
        return made[::-1]

    purpose = "The two segments come in the wrong order, in a file without INDX."
    data = file_of(dance(8), segment_frames=4, segments=swapped, index=False)
    shelf.add("order-no-index", "DATA", purpose, data)
    purpose = "A segment of signal 1 of 1 behind that of signal 0."
    edit = _and_another
    shelf.edited("signal-of-none", "DATA", purpose, segments=edit, index=False)
    edit = headed(0, tail=2**53 - 1)
    purpose = "A segment of 4 frames that bears upon 2^53 - 1 more."
    shelf.edited("tail-2-53", "DATA; Conventions", purpose, segments=edit, index=False)
    spec = "Limits and profiles; DATA"
    purpose = "A constant of 64 MiB and one value in one segment, in a file of 17 KB."
    shelf.add("memory-of-segment", spec, purpose, _constant(SEGMENT_ROWS + 1, 1, 17_000))
    purpose = "A constant of 64 MiB and one value in two segments, in a file of 0.5 KB."
    shelf.add("memory-of-signal", spec, purpose, _constant(SEGMENT_ROWS + 1, 2, 0))


def _and_another(made: Made) -> Made:
    ((header, streams),) = made
    return [(header, streams), (replace(header, signal=1), streams)]


def _constant(n_rows: int, n_segments: int, padding: int) -> bytes:
    """Zeros, with the hash of them, and an ancillary chunk of so many bytes."""
    stream, zeros = raw_stream([[0]], [0]), np.zeros((n_rows, 1))
    edges = [n_rows * i // n_segments for i in range(n_segments + 1)]

    def many(made: Made) -> Made:
        pairs = zip(edges, edges[1:], strict=False)
        return [(SegmentHeader(0, a, b - a), [stream]) for a, b in pairs]

    crafter = Crafter(
        segments=many,
        CLIP=put(payloads.Clip, "n_frames", varint(n_rows)),
        CEND=both(put(payloads.Cend, "n_frames", varint(n_rows)), rehash(zeros)),
        row=indexed(n_frames=n_rows),
    )
    crafter.clip(column([0.0], Grid(GridKind.FIXED, 0)))
    if padding:
        crafter.ancillary(b"xtra", bytes(padding))
    return finished(crafter)
