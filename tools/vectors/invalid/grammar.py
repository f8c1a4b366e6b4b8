"""Invalid, one fault each: the order of chunks, FOOT, the end of the file."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from typing import Any

from mcz.container import payloads
from mcz.container.chunks import FOOT, build_chunk, build_foot
from tools.records import built
from tools.vectors.build.edits import Nth, at, flip, plus
from tools.vectors.build.files import Broken, Crafter, Vector, file_of, finished, skeleton_chunk
from tools.vectors.build.motions import dance
from tools.vectors.build.source_files import PLAIN, take


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/grammar")
    _ends(shelf)
    _order(shelf)
    _twins(shelf)
    _foot(shelf)
    _bounds(shelf)
    _order_of_references(shelf)
    return shelf.vectors


def _ends(shelf: Broken) -> None:
    good = file_of(dance())
    shelf.add("truncated", "Strict reading", "The file ends inside its DATA.", good[:300])
    shelf.add("no-FOOT", "Strict reading; FOOT", "The file ends before its FOOT.", good[:-32])
    shelf.add("byte-after-FOOT", "Strict reading; FOOT", "A byte after the FOOT.", good + b"\0")
    crafter = Crafter()
    crafter.finish()
    crafter.clip(dance())
    purpose = "An append that was cut before its FOOT."
    shelf.add("append-cut", "Strict reading; Salvage", purpose, crafter.data)


def _order(shelf: Broken) -> None:
    def twice(chunk: bytes) -> bytes:
        return chunk + chunk

    def left_out(chunk: bytes) -> bytes:
        return b""

    model = build_chunk(b"MODL", built(payloads.Modl, {"kind": 77, "data": b""}, "MODL"))
    data = build_chunk(b"DATA", b"\0\0\1\0\0\1\0" + b"\0" * 4)
    cases: tuple[tuple[str, str, str, Callable[[bytes], bytes]], ...] = (
        ("no-HEAD", "No HEAD.", "HEAD", left_out),
        ("second-HEAD", "HEAD twice.", "HEAD", twice),
        ("DATA-outside", "DATA before CLIP.", "CLIP", lambda clip: data + clip),
        ("CEND-outside", "CEND twice.", "CEND", twice),
        ("no-CEND", "A clip without CEND.", "CEND", left_out),
        ("MODL-in-clip", "MODL between CLIP and DATA.", "CLIP", plus(model)),
    )
    for name, purpose, kind, edit in cases:
        shelf.edited(name, "Grammar", purpose, **{f"{kind}_frame": edit})
    crafter = Crafter()
    crafter.clip(dance())
    (place,) = crafter.directory.shared.values()
    start, stop = place.offset, place.offset + place.size
    moved = crafter.data[:start] + crafter.data[stop:] + crafter.data[start:stop]
    purpose = "The skeleton comes after its clip."
    shelf.add("SKEL-after-CLIP", "Grammar", purpose, moved + build_foot(0, 0))
    crafter.finish()
    crafter = Crafter(FOOT=lambda foot: build_chunk(b"xtra", b"", 1) + foot)
    purpose = "A chunk between INDX and FOOT."
    shelf.add("INDX-not-before-FOOT", "Grammar", purpose, finished(crafter, dance()))


def _twins(shelf: Broken) -> None:
    rows: list[Any] = []
    crafter = Crafter(row=lambda row: rows.append(row) or row)
    crafter.clip(dance())
    del crafter.directory.clips["dance"]
    crafter.clip(dance())
    crafter.directory.clips = {str(number): row for number, row in enumerate(rows)}
    shelf.add("same-clip-name", "Grammar; CLIP", "Two clips of one name.", finished(crafter))


def _foot(shelf: Broken) -> None:
    def rebuilt(flags: int = 0, shift: int = 0, more: int = 0) -> Callable[[bytes], bytes]:
        def edit(foot: bytes) -> bytes:
            _, _, offset, length, magic = struct.unpack("<IIQQ8s", foot)
            place = struct.pack("<QQ", offset + shift, length + more)
            crc = zlib.crc32(struct.pack("<I", flags) + place + magic)
            return struct.pack("<II", flags, crc) + place + magic

        return edit

    cases: tuple[tuple[str, str, Callable[[bytes], bytes]], ...] = (
        ("FOOT-damaged", "A flipped bit in the crc of a FOOT.", flip(7)),
        ("FOOT-flags", "A flag of FOOT is set.", rebuilt(flags=1)),
        ("FOOT-magic", "The end magic is that of the beginning.", at(24, b"\x89MCZ")),
        ("FOOT-offset", "The index ends a byte late.", rebuilt(shift=1)),
        ("FOOT-length", "The index begins a byte late.", rebuilt(shift=1, more=-1)),
        ("FOOT-denies-INDX", "FOOT says that there is no index.", lambda foot: build_foot(0, 0)),
    )
    for name, purpose, edit in cases:
        shelf.edited(name, "FOOT", purpose, FOOT=edit)


def _bounds(shelf: Broken) -> None:
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
        ("SKEL-in-clip", "CEND", "A SKEL before CEND.", skeleton_chunk()),
    ):
        edits = {f"{kind}_frame": lambda chunk, inner=inner: inner + chunk}
        shelf.edited(name, spec, purpose, index=False, **edits)
    purpose = "A CLIP before the CEND of the one before."
    twin = file_of(dance(2, name="twin"), index=False)
    start = twin.index(b"CLIP")
    inner = twin[start : -FOOT.size]
    edits = {"CEND_frame": lambda chunk: inner + chunk}
    shelf.edited("CLIP-in-clip", "Grammar; CLIP", purpose, index=False, **edits)
    crafter = Crafter(FOOT=Nth(0, lambda foot: build_chunk(b"xtra", b"", 1) + foot))
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


def _order_of_references(shelf: Broken) -> None:
    """Things that come behind what refers to them."""
    crafter = Crafter()
    crafter.clip(take(PLAIN, "plain"))
    rows = list(crafter.directory.shared.items())
    place = next(chunk for (kind, _), chunk in rows if kind == b"SRCE")
    start, stop = place.offset, place.offset + place.size
    data = crafter.data
    moved = data[:start] + data[stop:] + data[start:stop]
    shelf.add(
        "SRCE-after-CLIP", "Grammar", "The template comes after its clip.", moved + _empty_foot()
    )
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
    crafter = Crafter(FOOT=Nth(0, lambda foot: build_chunk(b"xtra", b"", 1) + foot))
    crafter.finish()
    purpose = "A chunk between an INDX that lists nothing and its FOOT."
    data = finished(crafter, dance())
    shelf.add("INDX-of-nothing-not-before-FOOT", "Grammar; FOOT", purpose, data)
    purpose = "The end magic is that of the beginning, under a right crc."
    shelf.edited("FOOT-magic-alone", "FOOT", purpose, FOOT=_other_magic)


def _empty_foot() -> bytes:
    return build_foot(0, 0)


def _other_magic(foot: bytes) -> bytes:
    rest = foot[8:24] + b"\x89MCZ" + foot[28:]
    return foot[:4] + struct.pack("<I", zlib.crc32(foot[:4] + rest)) + rest
