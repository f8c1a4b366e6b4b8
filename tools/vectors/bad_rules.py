"""Invalid, one fault each: rules of the container that no other vector shows by itself."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.codecs import raw
from mcz.container import payloads
from mcz.container.chunks import build_chunk, build_foot
from mcz.container.packets import END, FRAME, Packet, build_packet
from mcz.container.segments import GROUP_NOTES, SegmentHeader
from mcz.files.digest import value_hash
from mcz.numbers import Grid, GridKind
from mcz.schema import build, varint
from tools.vectors.bad_bounds import _Nth
from tools.vectors.bad_clips import indexed
from tools.vectors.bad_notes import _masked
from tools.vectors.craft import Broken, Crafter, Vector, file_of, finished, rehash
from tools.vectors.edits import Edit, Made, both, framed, headed, put, raw_stream, stream
from tools.vectors.motions import HUNDREDTHS, column, dance, puppet
from tools.vectors.sources import PLAIN, take

BEYOND = b"\x80" * 7 + b"\x10"  # 2^53 as a varint
SEGMENT_ROWS = 2**23  # binary64 of the limit of a segment in the base profile


def vectors() -> Iterable[Vector]:
    names = "chunks grammar index shared clip data packets notes numbers".split()
    chunks, grammar, index, shared, clip, data, packets, notes, numbers = (
        Broken(f"invalid/{name}") for name in names
    )
    _chunks(chunks)
    _order(grammar)
    _index(index)
    _shared(shared)
    _clip(clip)
    _segments(data)
    _packets(packets)
    _notes(notes)
    _numbers(numbers)
    shelves = chunks, grammar, index, shared, clip, data, packets, notes, numbers
    return [vector for shelf in shelves for vector in shelf.vectors]


def _chunks(shelf: Broken) -> None:
    good = file_of(dance())
    purpose = "A signature whose last byte alone is another."
    shelf.add("signature-last", "Chunks", purpose, good[:7] + b"\x0b" + good[8:])
    long = framed(length=struct.pack("<Q", 2**30))
    purpose = "A length of 2^30, which the profile allows, in a file of a few hundred bytes."
    shelf.edited("length-past-end", "Chunks; Strict reading", purpose, DATA_frame=long)
    header = framed(length=b"\xff" * 8)(build_chunk(b"xtra", b"", 1))[:16]
    opened = header + build_packet(Packet(END, 0, b""))
    purpose = "An open chunk of an ancillary type, with an end packet."
    data = file_of(dance(), CEND_frame=lambda chunk: opened + chunk, index=False)
    shelf.add("open-ancillary", "Chunks; Open DATA and packets", purpose, data)


def _order(shelf: Broken) -> None:
    """Things that come behind what refers to them."""
    crafter = Crafter()
    crafter.clip(take(PLAIN, "plain"))
    rows = list(crafter.directory.shared.items())
    place = next(chunk for (kind, _), chunk in rows if kind == b"SRCE")
    start, stop = place.offset, place.offset + place.size
    data = crafter.data
    moved = data[:start] + data[stop:] + data[start:stop]
    shelf.add("SRCE-after-CLIP", "Grammar", "The template comes after its clip.", moved + _foot())
    crafter = Crafter()
    before = len(crafter.data)
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    alias = crafter.data[before:]
    crafter = Crafter(ATTA_frame=lambda chunk: alias + chunk)
    crafter.parts("b.txt", b"content")
    data = finished(crafter, index=False)
    shelf.add("ALIA-before-target", "Grammar; ALIA", "A name of an attachment behind it.", data)

    crafter = Crafter()
    crafter.clip(dance())
    del crafter.directory.clips["dance"]
    data = finished(crafter, dance(2), index=False)
    purpose = "Two clips of one name, in a file without INDX."
    shelf.add("same-clip-name-no-index", "Grammar; CLIP", purpose, data)
    crafter = Crafter(FOOT=_Nth(0, lambda foot: build_chunk(b"xtra", b"", 1) + foot))
    crafter.finish()
    purpose = "A chunk between an INDX that lists nothing and its FOOT."
    data = finished(crafter, dance())
    shelf.add("INDX-of-nothing-not-before-FOOT", "Grammar; FOOT", purpose, data)
    purpose = "The end magic is that of the beginning, under a right crc."
    shelf.edited("FOOT-magic-alone", "FOOT", purpose, FOOT=_other_magic)


def _foot() -> bytes:
    return build_foot(0, 0)


def _other_magic(foot: bytes) -> bytes:
    rest = foot[8:24] + b"\x89MCZ" + foot[28:]
    return foot[:4] + struct.pack("<I", zlib.crc32(foot[:4] + rest)) + rest


def _index(shelf: Broken) -> None:
    """Lists of INDX in another order than the chunks; all else is right."""
    swaps = {
        "order-of-clips": ("The clips", "clips"),
        "order-of-shared": ("The shared chunks", "shared"),
        "order-of-attachments": ("The attachments", "attachments"),
        "order-of-aliases": ("The aliases", "aliases"),
    }
    for name, (what, rows) in swaps.items():

        def edit(fields: Any, rows: str = rows) -> Any:
            found = getattr(fields, rows)
            found[0], found[1] = found[1], found[0]
            return fields

        crafter = Crafter(table=edit)
        for path in ("a.txt", "b.txt"):
            crafter.parts(path, path.encode())
            crafter.alias(f"copy/{path}", payloads.OF_ATTACHMENT, path.encode())
        twin = replace(puppet(), name="twin")
        data = finished(crafter, dance(), dance(3, name="encore", skeleton=twin))
        shelf.add(name, "INDX", f"INDX: {what} are listed in another order.", data)


def _shared(shelf: Broken) -> None:
    def renumbered(payload: bytes) -> bytes:
        """Parts 0 and 1 of two become 1 and 2; the number is the seventh byte."""
        return payload[:6] + bytes((payload[6] + 1,)) + payload[7:]

    def second(payload: bytes) -> bytes:
        return put(payloads.ATTA, "size", b"\7")(payload) if payload[6] else payload

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("part-first", "The parts are numbered from 1.", renumbered),
        ("sizes-differ", "The parts state different sizes.", second),
    )
    for name, purpose, edit in cases:
        crafter = Crafter(ATTA=edit)
        crafter.parts("a.txt", b"one", b"two")
        shelf.add(f"ATTA-{name}", "ATTA", purpose, finished(crafter, index=False))
    joints = varint(4097) + b"\0" * 5 * 4097
    crafter = Crafter()
    empty = build(payloads.SKEL, _SKELETON, "SKEL")
    crafter.shared(b"SKEL", put(payloads.SKEL, "joints", joints)(empty))
    purpose = "A skeleton of 4,097 joints in the base profile, and no clip."
    shelf.add("joints-limit", "SKEL; Limits and profiles", purpose, finished(crafter))


_SKELETON: dict[str, Any] = {
    "name": "crowd",
    "flags": 0,
    "unit_cm": [],
    "angle_unit": 0,
    "up_axis": 0,
    "base": [],
    "source": [],
    "joints": [],
    "extension": b"",
}


def _clip(shelf: Broken) -> None:
    edit = put(payloads.CLIP, "rate_numerator", BEYOND)
    purpose = "A frame rate of 2^53 over 1."
    shelf.edited("rate-2-53", "CLIP; Conventions", purpose, CLIP=edit, index=False)
    wrong = {"CEND": put(payloads.CEND, "value_sha256", b"\1" + b"v" * 32)}
    crafter = Crafter()
    crafter.clip(dance(), codec=replace(raw.CODEC, id=2**20))
    crafter.edits |= wrong
    data = finished(crafter, dance(3, name="encore"))
    purpose = "A clip of an unknown codec, which is legal, before one with a wrong value hash."
    shelf.add("value-hash-behind-unknown-codec", "HEAD; CEND", purpose, data)
    good = value_hash(dance().signals[0].values, None)
    more = put(payloads.CEND, "value_sha256", b"\2" + good + b"v" * 32)
    purpose = "A hash more than there are signals; the first is right."
    shelf.edited("value-hash-more", "CEND", purpose, CEND=more)
    _signals(shelf)


def _signals(shelf: Broken) -> None:
    """Clips that a reader could go on with."""
    none = {
        "CLIP": put(payloads.CLIP, "signals", b"\0"),
        "CEND": put(payloads.CEND, "value_sha256", b"\0"),
        "segments": lambda made: [],
    }
    purpose = "A clip of 4 frames without a signal, a segment and a hash."
    shelf.edited("no-signal-at-all", "CLIP", purpose, index=False, **none)
    edit = put(payloads.CLIP, "signals.0.samples_per_frame", b"\0")
    data = file_of(dance(0), CLIP=edit, index=False)
    shelf.add("samples-0-of-no-frames", "CLIP", "No rows a frame, of no frames.", data)
    joints = put(payloads.CLIP, "signals.0.groups", b"\1")
    own = dance(signals=(replace(dance().signals[0], channels=dance().skeleton.channels),))

    def merged(made: Made) -> Made:
        ((header, streams),) = made
        return [(header, [b"".join(streams[:4]), b"".join(streams[4:])])]

    data = file_of(own, grouping="channel", CLIP=joints, segments=merged)
    purpose = "Groups as if its own channels were those of the skeleton's joints."
    shelf.add("groups-of-no-joints", "CLIP", purpose, data)
    five = put(payloads.CLIP, "signals.0.groups", b"\3\2\4\1")

    def shorter(made: Made) -> Made:
        """The second group, of two channels, loses one, of 4 rows and width 1."""
        ((header, (first, second)),) = made
        return [(header, [first, second[:13]])]

    hashed = rehash(dance().signals[0].values[:, :5])
    purpose = "Groups of 5 of 6 channels; the hash is of these."
    shelf.edited("groups-of-fewer", "CLIP", purpose, CLIP=five, segments=shorter, CEND=hashed)


def _segments(shelf: Broken) -> None:
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
        CLIP=put(payloads.CLIP, "n_frames", varint(n_rows)),
        CEND=both(put(payloads.CEND, "n_frames", varint(n_rows)), rehash(zeros)),
        row=indexed(n_frames=n_rows),
    )
    crafter.clip(column([0.0], Grid(GridKind.FIXED, 0)))
    if padding:
        crafter.ancillary(b"xtra", bytes(padding))
    return finished(crafter)


def _packets(shelf: Broken) -> None:
    found: list[bytes] = []

    def kept(made: Made) -> Made:
        found.extend(made[1][1])
        return made

    def second(packet: bytes) -> bytes:
        return build_packet(Packet(FRAME, 1, found[0]))

    edits = {"segments": kept, "packet": _Nth(1, second)}
    data = file_of(dance(2), packets=True, index=False, segment_frames=1, **edits)
    purpose = "Kind 2, with the stream of the first of two groups."
    shelf.add("frame-of-first-group", "Open DATA and packets", purpose, data)


def _notes(shelf: Broken) -> None:
    """Group notes of a segment that is crafted whole."""

    def noted(**fields: Any) -> Callable[[Made], Made]:
        data = build(payloads.GROUP_NOTES, {"grid_changes": [], "exceptions": []} | fields, "notes")

        def edit(made: Made) -> Made:
            ((header, streams),) = made
            notes = [data, *(b"" for _ in streams[1:])]
            return [(replace(header, flags=header.flags | GROUP_NOTES), [*notes, *streams])]

        return edit

    later = [{"channel": 1, "grid": HUNDREDTHS}, {"channel": 0, "grid": HUNDREDTHS}]
    purpose = "Changes of grid, to what they are, with descending channels."
    edit = noted(grid_changes=later)
    shelf.edited("change-order", "Group notes", purpose, segments=edit)
    floats = column([5.0, 6.0, 7.0], Grid(GridKind.FIXED, 0))
    change = [{"channel": 0, "grid": Grid(GridKind.BINARY64)}]
    nine = [{"row": 0, "channel": 0, "text": b"9"}]

    def stored(made: Made) -> Made:
        header, _ = made[0]
        words = np.array([9.0, 6.0, 7.0]).view(np.int64).tolist()
        return noted(grid_changes=change, exceptions=nine)([(header, [raw_stream([words], [8])])])

    data = file_of(floats, segments=stored, CEND=rehash(np.array([[9.0], [6.0], [7.0]])))
    purpose = "An exception on a grid that has text in CLIP and none in this segment."
    shelf.add("exception-of-changed", "Group notes; Number grids", purpose, data)
    values = dance().signals[0].values.copy()
    values[0, :2] = 8, 9
    two = [(1, b"9"), (0, b"8")]
    again = [(0, b"8"), (1, b"9"), (1, b"9")]
    for name, purpose, places in (
        ("descending", "Exceptions with descending channels, whose values are hashed.", two),
        ("again", "The same exception twice, whose value is hashed.", again),
    ):
        listed = [{"row": 0, "channel": c, "text": text} for c, text in places]
        edit = noted(exceptions=listed)
        shelf.edited(
            f"exception-{name}", "Group notes", purpose, segments=edit, CEND=rehash(values)
        )
    values = dance().signals[0].values.copy()
    values[0, 0] = 8
    edit = noted(exceptions=[{"row": 0, "channel": 0, "text": b"8.0"}])
    cut = both(edit, stream(0, lambda data: data[:-1]))
    purpose = "Group notes that end before the last zero of an exception."
    shelf.edited("exception-zero-cut", "Group notes", purpose, segments=cut, CEND=rehash(values))
    shelf.edited(
        "exception-far-ordinal",
        "Group notes",
        "The ordinal at an exception is beyond the grid; all values are those hashed.",
        segments=both(stream(0, _far), noted(exceptions=[{"row": 0, "channel": 0, "text": b"8"}])),
        CEND=rehash(values),
    )
    edit = noted(exceptions=[{"row": 4, "channel": 0, "text": b"9"}])
    purpose = "An exception behind the last row, which no value shows."
    shelf.edited("exception-behind", "Group notes", purpose, segments=edit)
    purpose = "A run of no invalid values between two of valid ones."
    data = file_of(_masked(), segments=stream(0, _parted))
    shelf.add("mask-empty-run-between", "Masks", purpose, data)


def _far(data: bytes) -> bytes:
    """The first ordinal of the first channel, of 4 rows and width 1, becomes 2^51."""
    assert data[8] == 1
    least = int.from_bytes(data[:8], "little", signed=True)
    others = [least + offset for offset in data[10:13]]
    return raw_stream([[2**51, *others]], [8]) + data[13:]


def _parted(data: bytes) -> bytes:
    """The third run, of two values, as two of one with nothing between."""
    assert data[:3] == b"\1\1\2"
    return data[:2] + b"\1\0\1" + data[3:]


def _numbers(shelf: Broken) -> None:
    motion = column([0.0, 0.0], Grid(GridKind.FIXED, 2))
    cases = {
        "trimmed-23-digits": ("A TRIMMED grid of 23 digits.", b"\2\x17\0"),
        "text64-63-digits": ("A TEXT64 grid of 63 digits.", b"\4\x3f\0"),
        "text64-105-digits": ("A TEXT64 grid of 105 digits.", b"\4\x69\0"),
        "text64-18-digits": ("A TEXT64 grid of 18 digits.", b"\4\x12\0"),
        "fixed-upper": ("A FIXED grid with UPPER.", b"\1\2\x40"),
        "trimmed-exponent": ("A TRIMMED grid with EXPONENT1.", b"\2\2\x20"),
        "integer-flags": ("An INTEGER grid with flags.", b"\6\0\x08"),
        "vax-digits": ("A VAX_F grid with digits.", b"\x0a\1\0"),
    }
    for name, (purpose, grid) in cases.items():
        edit = put(payloads.CLIP, "signals.0.grids", b"\1\1" + grid)
        shelf.add(name, "The grid structure", purpose, file_of(motion, CLIP=edit))
