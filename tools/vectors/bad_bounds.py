"""Invalid, one fault each: structures that end early, and the bounds of the container."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from typing import Any

from mcz.container import payloads
from mcz.container.chunks import FOOT, build_chunk, build_foot
from mcz.container.segments import SegmentHeader
from mcz.files.encoding import write_skeleton
from mcz.numbers import Grid, GridKind
from mcz.schema import build, deflate, varint
from tools.vectors.bad_data import N_GROUPS, _head_size
from tools.vectors.craft import Broken, Crafter, Vector, file_of, finished
from tools.vectors.edits import Edit, at, plus, put, raw_stream, span, table
from tools.vectors.motions import column, dance, puppet
from tools.vectors.sources import PLAIN, take
from tools.vectors.uncommon import live_file

MOST_BODY = 2**16  # bytes, of the base profile
BOMB = 2**17  # bytes of zeros


def vectors() -> Iterable[Vector]:
    names = "chunks grammar data packets index shared clip".split()
    chunks, grammar, data, packets, index, shared, clip = (Broken(f"invalid/{n}") for n in names)
    _cut(chunks)
    _grammar(grammar)
    _tables(data)
    _packets(packets)
    _index(index)
    _index_bounds(index)
    _shared(shared)
    _attachments(shared)
    _text(shared)
    _clip(clip)
    shelves = chunks, grammar, data, packets, index, shared, clip
    return [vector for shelf in shelves for vector in shelf.vectors]


def _less(payload: bytes) -> bytes:
    return payload[:-1]


def _cut(shelf: Broken) -> None:
    """Payloads without their last byte, under right checksums."""
    for kind in ("SKEL", "CLIP", "CEND"):
        purpose = f"A {kind} without its last byte."
        shelf.edited(f"cut-{kind}", kind, purpose, index=False, **{kind: _less})
    purpose = "A HEAD of four bytes."
    shelf.edited("cut-HEAD", "HEAD", purpose, index=False, HEAD=lambda payload: payload[:4])
    crafter = Crafter(ATTA=lambda payload: payload[:20])
    crafter.parts("a.txt", b"content")
    shelf.add("cut-ATTA", "ATTA", "An ATTA that ends in its hash.", finished(crafter, index=False))
    for name, purpose, edit in (
        ("cut-ALIA", "An ALIA that ends within its target.", _less),
        ("tail-ALIA", "A byte behind the fields of an ALIA, which is closed.", plus(b"\0")),
    ):
        crafter = Crafter(ALIA=edit)
        crafter.parts("b.txt", b"")
        crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
        shelf.add(name, "ALIA; Conventions", purpose, finished(crafter, index=False))
    data = file_of(take(PLAIN, "plain"), SRCE=lambda payload: payload[:2], index=False)
    shelf.add("cut-SRCE", "SRCE", "A SRCE of two bytes.", data)


def _grammar(shelf: Broken) -> None:
    spec = "Grammar; FOOT"
    crafter = Crafter()
    head = crafter.data
    shelf.add("signature-alone", "Grammar; Strict reading", "Nothing but the signature.", head[:8])
    shelf.add("HEAD-alone", "Grammar; Strict reading", "A HEAD, and no FOOT.", head)
    data = head[:8] + build_foot(0, 0) + head[8:] + build_foot(0, 0)
    shelf.add("FOOT-before-HEAD", spec, "A FOOT comes before HEAD.", data)
    whole = file_of(dance(), index=False)
    data = whole[: -FOOT.size] + b"CLIP\0\0"
    purpose = "The file ends within the header of a chunk."
    shelf.add("truncated-in-header", "Strict reading; Chunks", purpose, data)
    for name, kind, purpose, inner in (
        ("FOOT-in-clip", "CEND", "A FOOT before CEND.", build_foot(0, 0)),
        ("ATTA-in-clip", "CEND", "An ATTA before CEND.", _attachment()),
        ("SKEL-in-clip", "CEND", "A SKEL before CEND.", _skeleton()),
    ):
        edits = {f"{kind}_frame": lambda chunk, inner=inner: inner + chunk}
        shelf.edited(name, spec, purpose, index=False, **edits)
    purpose = "A CLIP before the CEND of the one before."
    twin = file_of(dance(2, name="twin"), index=False)
    start = twin.index(b"CLIP")
    inner = twin[start : -FOOT.size]
    edits = {"CEND_frame": lambda chunk: inner + chunk}
    shelf.edited("CLIP-in-clip", "Grammar; CLIP", purpose, index=False, **edits)
    crafter = Crafter(FOOT=_Nth(0, lambda foot: build_chunk(b"xtra", b"", 1) + foot))
    finished(crafter, dance())
    purpose = "A chunk between the first INDX and its FOOT; the last INDX is right."
    data = finished(crafter, dance(3, name="encore"))
    shelf.add("first-INDX-not-before-FOOT", spec, purpose, data)
    places = (
        ("FOOT-offset-alone", "An index offset, but no index.", build_index_foot(8, 0)),
        ("FOOT-index-short", "An index of 5 bytes, less than any chunk.", build_index_foot(-5, 5)),
    )
    for name, purpose, foot in places:
        made = whole[: -FOOT.size]
        offset = len(made)
        shelf.add(name, spec, purpose, made + foot(offset))


def build_index_foot(offset: int, length: int) -> Callable[[int], bytes]:
    """The FOOT of an index at ``offset``, counted from the FOOT where it is negative."""
    return lambda end: build_foot(end + offset if offset < 0 else offset, length)


def _attachment() -> bytes:
    crafter = Crafter()
    before = len(crafter.data)
    crafter.parts("a.txt", b"content")
    return crafter.data[before:]


def _skeleton() -> bytes:
    crafter = Crafter()
    before = len(crafter.data)
    write_skeleton(crafter, puppet())
    return crafter.data[before:]


def _tables(shelf: Broken) -> None:
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


def _packets(shelf: Broken) -> None:
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
        renumbered = _Nth(2, _numbered(number))
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


class _Nth:
    """An edit of the one of this number alone, from 0."""

    def __init__(self, number: int, edit: Callable[[Any], Any]) -> None:
        self.number, self.edit, self.count = number, edit, -1

    def __call__(self, value: Any) -> Any:
        self.count += 1
        return self.edit(value) if self.count == self.number else value


def _index(shelf: Broken) -> None:
    """INDX of a file with all that it lists, one field after the other."""

    def clip(**changes: Any) -> Callable[[Any], Any]:
        return lambda fields: fields.clips[0].update(changes)

    def signal(**changes: Any) -> Callable[[Any], Any]:
        return lambda fields: fields.clips[0].signals[0].update(changes)

    def add(rows: str, path: str, more: int = 1) -> Callable[[Any], Any]:
        def change(fields: Any) -> None:
            row = getattr(fields, rows)[0]
            *inner, last = path.split(".")
            for name in inner:
                row = row[name][0]
            row[last] += more

        return change

    cases: dict[str, tuple[str, Callable[[Any], Any]]] = {
        "rate-denominator": ("Another denominator of the rate.", clip(rate_denominator=2)),
        "codec-id": ("Another codec.", signal(codec=1)),
        "samples": ("Other rows a frame.", signal(samples_per_frame=2)),
        "no-signal": ("A clip without a signal.", clip(signals=[])),
        "clip-length": ("Another length of CLIP.", add("clips", "length")),
        "cend-gap": ("CEND is said to be a byte further on.", add("clips", "cend_gap")),
        "cend-length": ("Another length of CEND.", add("clips", "cend_length")),
        "segment-size": ("Another size of a segment.", _row(1, 1)),
        "segment-lead": ("Another lead of a segment.", _row(4, 1)),
        "segment-tail": ("Another tail of a segment.", _row(5, 1)),
        "segment-missing": ("The segment is left out.", clip(segments=b"")),
        "segment-cut": ("The list of segments ends in a row.", clip(segments=b"\x24\1")),
        "ancillary-missing": ("An ancillary chunk is left out.", clip(ancillary=[])),
        "ancillary-offset": ("An ancillary chunk lies elsewhere.", _ancillary("offset", 1)),
        "ancillary-length": ("An ancillary chunk is longer.", _ancillary("length", 1)),
        "ancillary-type": ("An ancillary chunk is of another type.", _ancillary("type", b"xtrb")),
        "shared-offset": ("The skeleton lies elsewhere.", add("shared", "offset")),
        "shared-length": ("The skeleton is longer.", add("shared", "length")),
        "shared-type": (
            "The skeleton is a model.",
            lambda f: f.shared[0].update({"type": b"MODL"}),
        ),
        "shared-missing": ("The skeleton is left out.", lambda f: f.shared.pop(0) and None),
        "attachment-size": ("Another size of an attachment.", add("attachments", "size")),
        "attachment-offset": ("A part lies elsewhere.", add("attachments", "parts.offset")),
        "attachment-length": ("A part is longer.", add("attachments", "parts.length")),
        "attachment-name": ("Another name.", lambda f: f.attachments[0].update({"name": "b.txt"})),
        "attachment-no-part": ("No part.", lambda f: f.attachments[0].update({"parts": []})),
        "attachment-missing": ("An attachment is left out.", lambda f: f.attachments.clear()),
        "alias-target": ("Another target of an alias.", _alias(target=b"b.txt")),
        "alias-of": ("An alias of a clip.", _alias(of=0)),
        "alias-missing": ("An alias is left out.", lambda f: f.aliases.clear()),
    }
    for name, (purpose, change) in cases.items():

        def edit(fields: Any, change: Callable[[Any], Any] = change) -> Any:
            change(fields)
            return fields

        shelf.add(name, "INDX; Strict reading", f"INDX: {purpose}", _full(table=edit))


def _full(**edits: Any) -> bytes:
    """A file whose INDX has a row of every kind."""
    crafter = Crafter(**edits)
    crafter.parts("a.txt", b"content")
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"a.txt")
    crafter.clip(dance())
    crafter.ancillary(b"xtra", b"more")
    return finished(crafter)


def _row(place: int, more: int) -> Callable[[Any], Any]:
    """One of the seven varints of the segment is more."""

    def change(fields: Any) -> None:
        row = fields.clips[0]
        parts = bytearray(row.segments)
        assert len(parts) == 7
        parts[place] += more
        row.segments = bytes(parts)

    return change


def _ancillary(field: str, new: Any) -> Callable[[Any], Any]:
    def change(fields: Any) -> None:
        row = fields.clips[0].ancillary[0]
        row[field] = new if isinstance(new, bytes) else row[field] + new

    return change


def _alias(**changes: Any) -> Callable[[Any], Any]:
    return lambda fields: fields.aliases[0].update(changes)


def _index_bounds(shelf: Broken) -> None:
    def swollen(fields: Any) -> Any:
        fields.extension = bytes(BOMB)
        return fields

    purpose = "An INDX that inflates to more than 64 KiB and twice the file, most of it ignored."
    shelf.edited("INDX-bomb", "INDX; Limits and profiles", purpose, table=swollen)
    broken = {"INDX": lambda payload: payload[:2] + b"\x07" + payload[3:]}
    shelf.edited("INDX-block", "INDX; Conventions", "INDX is no deflate stream.", **broken)

    def slower(fields: Any) -> Any:
        fields.clips[0].rate_numerator += 1
        return fields

    crafter = Crafter(table=_Nth(0, slower))
    finished(crafter, dance())
    data = finished(crafter, dance(3, name="encore"))
    purpose = "INDX: the first of two says another frame rate; the last is right."
    shelf.add("first-of-two", "INDX; Strict reading", purpose, data)


def _shared(shelf: Broken) -> None:
    nan = struct.pack("<3d", 0, float("nan"), 0)
    spec = "SRCE; Conventions"
    ratio = {"SRCE": put(payloads.SRCE, "size", varint(2**20))}
    data = file_of(take(PLAIN, "plain"), **ratio)
    purpose = "A template: 2^20 bytes stated, more than its deflate stream can make."
    shelf.add("SRCE-size-ratio", spec, purpose, data)
    data = file_of(take(PLAIN, "plain"), SRCE=lambda p: p[:4] + b"\x07" + p[5:])
    shelf.add("SRCE-deflate-block", spec, "A template: It is no deflate stream.", data)
    crafter = Crafter()
    huge = {"format": 3, "encoding": 1, "size": 2**26 + 1, "data": deflate(bytes(2**26 + 1))}
    crafter.shared(b"SRCE", build(payloads.SRCE, huge, "SRCE"))
    purpose = "A template of 2^26 + 1 bytes in the base profile."
    shelf.add("SRCE-limit", "SRCE; Limits and profiles", purpose, finished(crafter))
    crafter = Crafter()
    later = write_skeleton(Crafter(), puppet())
    based = put(payloads.SKEL, "base", b"\1" + later)(_payload_of(puppet()))
    crafter.plain_chunk(b"SKEL", based)
    write_skeleton(crafter, puppet())
    purpose = "The base of a skeleton comes behind it."
    shelf.add("base-later", "SKEL; Grammar", purpose, finished(crafter, index=False))
    for name, purpose, axis in (
        ("axis-NaN", "An axis that is no number.", nan),
        ("axis-infinite", "An infinite axis.", struct.pack("<3d", 0, 0, -float("inf"))),
    ):
        shelf.edited(name, "SKEL", purpose, SKEL=_with_axis(axis))


def _payload_of(skeleton: Any) -> bytes:
    crafter = Crafter()
    write_skeleton(crafter, skeleton)
    (place,) = crafter.directory.shared.values()
    assert place.length is not None
    return crafter.data[place.payload_offset :][: place.length]


def _with_axis(axis: bytes) -> Edit:
    """Joint 1, which has an offset, gets an axis."""

    def edit(payload: bytes) -> bytes:
        stop = span(payloads.SKEL, payload, "joints.1.offset")[1]
        longer = payload[:stop] + axis + b"\0" + payload[stop:]
        start, end = span(payloads.SKEL, payload, "joints.1.flags")
        return longer[:start] + bytes((payload[start] | 4,)) + longer[end:]

    return edit


def _attachments(shelf: Broken) -> None:
    third = put(payloads.ATTA, "part", b"\2")
    nothing = put(payloads.ATTA, "part_size", b"\0")
    crafter = Crafter()
    crafter.parts("a.txt", b"one", b"two")
    (row,) = crafter.directory.attachments.values()
    second = crafter.data[row.parts[1].payload_offset : -4]
    crafter.plain_chunk(b"ATTA", nothing(third(second))[:-3])
    purpose = "Part 2 of 2, counted from 0, of no bytes."
    shelf.add("ATTA-part-beyond", "ATTA", purpose, finished(crafter, index=False))
    crafter = Crafter()
    crafter.parts("a.txt", b"one")
    crafter.parts("a.txt", b"one")
    purpose = "Two attachments of one name."
    shelf.add("ATTA-same-name", "ATTA; Grammar", purpose, finished(crafter, index=False))
    crafter = Crafter(ATTA_frame=_Nth(1, lambda chunk: _skeleton() + chunk))
    crafter.parts("a.txt", b"one", b"two")
    purpose = "A chunk between the two parts of a file."
    shelf.add("ATTA-apart", "ATTA", purpose, finished(crafter, index=False))


def _text(shelf: Broken) -> None:
    cases = {
        "overlong": ("a slash in two bytes", b"\xc0\xaf"),
        "surrogate": ("half of a surrogate pair", b"\xed\xa0\x80"),
        "beyond": ("a code point beyond U+10FFFF", b"\xf4\x90\x80\x80"),
        "cut": ("a code point without its last byte", b"\xe2\x82"),
        "continuation": ("a byte that continues nothing", b"a\x80"),
    }
    for name, (purpose, text) in cases.items():
        edit = put(payloads.SKEL, "joints.1.name", varint(len(text)) + text)
        shelf.edited(f"text-{name}", "SKEL; Conventions", f"A name with {purpose}.", SKEL=edit)


def _clip(shelf: Broken) -> None:
    source = {"template": b"t" * 16, "format": 3, "detail": b"", "path": "a.bvh", "size": 1}
    two = b"\2" + build(payloads.CLIP_SOURCE, source, "source") * 2
    purpose = "Two sources of one clip."
    shelf.edited(
        "sources-two", "CLIP; Conventions", purpose, CLIP=put(payloads.CLIP, "source", two)
    )
    two = put(payloads.CEND, "source_sha256", b"\2" + b"s" * 64)
    shelf.edited("source-hashes-two", "CEND; Conventions", "Two hashes of a source.", CEND=two)
