"""Invalid, one fault each: chunks, payloads that end early, quality records."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

from mcz.container import payloads
from mcz.container.chunks import ANCILLARY, build_chunk
from mcz.container.packets import END, Packet, build_packet
from mcz.schema import varint
from tools.records import built
from tools.vectors.build.edits import flip, framed, plus
from tools.vectors.build.files import Broken, Crafter, Vector, file_of, finished
from tools.vectors.build.motions import dance
from tools.vectors.build.source_files import PLAIN, take

RECORD = {"entries": [{"key": "codec", "value": "raw"}], "extension": b""}


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/chunks")
    _chunks(shelf)
    _headers(shelf)
    _cut_payloads(shelf)
    _records(shelf)
    _flags_of_unknown(shelf)
    return shelf.vectors


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


def _less(payload: bytes) -> bytes:
    return payload[:-1]


def _cut_payloads(shelf: Broken) -> None:
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


def _headers(shelf: Broken) -> None:
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


def _flags_of_unknown(shelf: Broken) -> None:
    """Reserved flags of types that a reader does not know: nothing is unsupported, it is wrong."""
    for name, kind, flags, what in (
        ("unknown-critical-flag", b"ROOM", 4, "a critical"),
        ("unknown-ancillary-flag", b"xtra", ANCILLARY | 8, "an ancillary"),
        ("unknown-ancillary-last-flag", b"xtra", ANCILLARY | 128, "an ancillary"),
    ):
        crafter = Crafter()
        crafter.plain_chunk(kind, b"what the room looked like", flags)
        purpose = f"Reserved flag {flags & ~ANCILLARY} of {what} chunk of unknown type."
        shelf.add(name, "Chunks; Conventions", purpose, finished(crafter, dance(), index=False))


def _records(shelf: Broken) -> None:
    record = built(payloads.Qual, RECORD, "QUAL")
    cases = {
        "cut": ("ends within its last value", record[:-1]),
        "empty": ("has no bytes", b""),
        "UTF-8": ("has a value that is not UTF-8", record[:-1] + b"\xff"),
        "count": ("has 2^40 entries", varint(2**40) + record[1:]),
    }
    for name, (what, payload) in cases.items():
        crafter = Crafter()
        crafter.clip(dance())
        crafter.ancillary(b"QUAL", payload)
        purpose = f"A quality record that {what}."
        shelf.add(f"QUAL-{name}", "QUAL; Conventions", purpose, finished(crafter))
