"""Invalid, one fault each: chunks, their grammar, FOOT."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from typing import Any

from mcz.container import payloads
from mcz.container.chunks import build_chunk, build_foot
from mcz.schema import build
from tools.vectors.craft import Broken, Crafter, Vector, file_of, finished
from tools.vectors.edits import at, flip, framed, plus
from tools.vectors.motions import dance


def vectors() -> Iterable[Vector]:
    chunks, grammar = Broken("invalid/chunks"), Broken("invalid/grammar")
    _chunks(chunks)
    _ends(grammar)
    _order(grammar)
    _twins(grammar)
    _foot(grammar)
    return [*chunks.vectors, *grammar.vectors]


def _chunks(shelf: Broken) -> None:
    good = file_of(dance())
    text = good.replace(b"\r\n", b"\n", 1)
    shelf.add("signature", "Chunks", "The signature after a transfer as text.", text)
    shelf.add("no-bytes", "Strict reading", "Nothing at all.", b"")
    shelf.edited("crc", "Chunks", "One flipped bit in the crc of a DATA.", DATA_frame=flip(-1))
    purpose = "A header_check that is the high half of the CRC-32, not the low one."
    shelf.edited("header-check", "Chunks", purpose, SKEL_frame=_high_check)
    huge, long = struct.pack("<Q", 2**53), struct.pack("<Q", 2**40)
    cases: tuple[tuple[str, str, str, str, dict[str, bytes]], ...] = (
        ("type-digit", "A chunk type with a digit.", "", "CLIP", {"type": b"CL1P"}),
        ("reserved-byte", "The reserved byte is 1.", "", "SKEL", {"reserved": b"\1"}),
        ("reserved-flag", "A reserved flag is set.", "", "CEND", {"flags": b"\4"}),
        ("ancillary-SKEL", "A critical type marked as ancillary.", "", "SKEL", {"flags": b"\1"}),
        ("length-beyond-2-53", "A length of 2^53.", "Conventions", "DATA", {"length": huge}),
        ("length-beyond-end", "A length of 2^40.", "Strict reading", "DATA", {"length": long}),
        (
            "open-CLIP",
            "A chunk of another type than DATA is open.",
            "Open DATA and packets",
            "CLIP",
            {"length": b"\xff" * 8},
        ),
    )
    for name, purpose, heading, kind, changes in cases:
        spec = f"Chunks; {heading}" if heading else "Chunks"
        shelf.edited(name, spec, purpose, **{f"{kind}_frame": framed(**changes)})
    crafter = Crafter()
    crafter.clip(dance())
    crafter.plain_chunk(b"QUAL", b"\0", 0)
    shelf.add("QUAL-critical", "QUAL; Chunks", "QUAL is not ancillary.", finished(crafter))


def _high_check(chunk: bytes) -> bytes:
    check = zlib.crc32(chunk[:6] + chunk[8:16]) >> 16
    return framed(header_check=struct.pack("<H", check))(chunk)


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

    model = build_chunk(b"MODL", build(payloads.MODL, {"kind": 77, "data": b""}, "MODL"))
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
