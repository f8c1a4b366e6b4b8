"""Invalid, one fault each: chunks that are said to stand in the file a second time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from mcz.container.chunks import ANCILLARY, COPY
from mcz.container.copies import Copy
from mcz.schema import varint
from tools.vectors.build.copies import Edit, content_of, copies_of, payload_of
from tools.vectors.build.files import Broken, Crafter, Vector, finished
from tools.vectors.build.motions import dance
from tools.vectors.build.source_files import PLAIN, take


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/copies")
    _other_chunks(shelf)
    _order(shelf)
    _bytes(shelf)
    _flags(shelf)
    return shelf.vectors


def _file(payload: bytes, flags: int = ANCILLARY) -> bytes:
    """The file of two clips, one with a source, and a COPY behind them."""
    crafter = _begun()
    crafter.plain_chunk(COPY, payload, flags)
    return finished(crafter, index=False)


def _begun() -> Crafter:
    crafter = Crafter()
    crafter.clip(take(PLAIN, "plain"))
    crafter.clip(dance())
    return crafter


def _edited(edit: Edit) -> bytes:
    """The file whose COPY says other things of the chunks before it."""
    crafter = _begun()
    return _file(payload_of(content_of(edit(copies_of(crafter)), crafter.offset)))


def _at(index: int, edit: dict[str, object]) -> Edit:
    return lambda copies: [
        replace(copy, **edit) if n == index else copy  # type: ignore[arg-type]
        for n, copy in enumerate(copies)
    ]


def _other_chunks(shelf: Broken) -> None:
    """What it says of a chunk is not so."""
    copies = copies_of(_begun())
    index = next(n for n, copy in enumerate(copies) if copy.type == b"SKEL")
    skel = copies[index]
    last = skel.payload[:-1] + bytes((skel.payload[-1] ^ 1,))
    long, type_ = skel.payload + b"\0", {"type": b"MODL"}
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("distance", "A SKEL is said to lie a byte before its place.", _moved(index, -1)),
        ("payload", "The last byte of a SKEL is another.", _at(index, {"payload": last})),
        ("payload-short", "A SKEL without its last byte.", _at(index, {"payload": last[:-1]})),
        ("payload-long", "A SKEL with a byte more.", _at(index, {"payload": long})),
        ("type", "A SKEL is said to be a MODL.", _at(index, type_)),
        ("type-lower", "The type of a SKEL is skel.", _at(index, {"type": b"skel"})),
        ("in-SKEL", "What is said to be a SKEL lies within one.", lambda _: [_within(skel)]),
    )
    for name, purpose, edit in cases:
        shelf.add(name, "COPY", purpose, _edited(edit))
    _data(shelf)


def _moved(index: int, by: int) -> Edit:
    return lambda copies: [
        replace(copy, offset=copy.offset + by * (n == index)) for n, copy in enumerate(copies)
    ]


def _within(copy: Copy) -> Copy:
    return Copy(copy.offset + 1, copy.type, copy.payload[:-1])


def _data(shelf: Broken) -> None:
    """Chunks of a type that is not copied."""
    crafter = _begun()
    row = crafter.directory.clips["plain"].segments[0]
    payload = crafter.data[row.offset : row.stop]
    copy = Copy(row.chunk().offset, b"DATA", payload)
    data = _file(payload_of(content_of([copy], crafter.offset)))
    shelf.add("type-DATA", "COPY", "A DATA is copied.", data)
    crafter = _begun()
    start = crafter.offset
    crafter.ancillary(b"xtra", b"not for copies")
    copy = Copy(start, b"xtra", b"not for copies")
    crafter.plain_chunk(COPY, payload_of(content_of([copy], crafter.offset)), ANCILLARY)
    data = finished(crafter, index=False)
    shelf.add("type-ancillary", "COPY", "An ancillary chunk is copied.", data)


def _order(shelf: Broken) -> None:
    """Copies that are not in file order, or not before the COPY."""

    def swapped(copies: list[Copy]) -> list[Copy]:
        return [copies[0], copies[2], copies[1], *copies[3:]]

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("order", "Two copies are swapped.", swapped),
        ("twice", "HEAD is copied twice.", lambda copies: [copies[0], *copies]),
        ("before-file", "A chunk is said to begin before the file.", lambda _: [_far()]),
        ("distance-0", "A chunk is said to begin where the COPY does.", lambda _: [_here(0)]),
        ("reaches-in", "A chunk is said to end within the COPY.", lambda _: [_here(-20)]),
    )
    for name, purpose, edit in cases:
        shelf.add(name, "COPY", purpose, _edited(edit))


def _far() -> Copy:
    return Copy(-1000, b"HEAD", b"")


def _here(by: int) -> Copy:
    return Copy(_begun().offset + by, b"HEAD", b"\0")


def _bytes(shelf: Broken) -> None:
    """Payloads that end early, say another size, or have bytes behind their end."""
    crafter = _begun()
    content = content_of(copies_of(crafter), crafter.offset)
    good, stored = payload_of(content), payload_of(content, stored=True)
    head = content_of(copies_of(crafter)[:1], crafter.offset)
    bomb = payload_of(bytes(2**20))
    more, less = (payload_of(content, size=len(content) + by) for by in (1, -1))
    cases = (
        ("no-bytes", "COPY", "A COPY without any byte.", b""),
        ("cut", "COPY", "A COPY that ends within its size.", good[:2]),
        ("encoding", "COPY; Conventions", "An encoding of 3.", b"\3" + good[1:]),
        ("size-more", "COPY", "A stated size of a byte more.", more),
        ("size-less", "COPY", "A stated size of a byte less.", less),
        ("stored-more", "COPY", "A byte behind stored copies.", stored + b"\0"),
        ("stored-less", "COPY", "Stored copies without their last byte.", stored[:-1]),
        ("deflate-tail", "COPY; Conventions", "A byte behind the deflate stream.", good + b"\0"),
        ("deflate-cut", "COPY; Conventions", "A deflate stream without its end.", good[:-1]),
        ("copy-cut", "COPY", "The last copy ends within its payload.", payload_of(head[:-1])),
        ("copy-type-cut", "COPY", "The last copy ends within its type.", payload_of(head[:4])),
        ("copy-tail", "COPY", "A byte behind the last copy.", payload_of(content + b"\1")),
        ("copy-length", "COPY", "A copy of 2^50 bytes.", payload_of(head[:6] + varint(2**50))),
        ("bomb", "COPY; Limits and profiles", "A size of 2^20 in a small file.", bomb),
    )  # fmt: skip
    for name, spec, purpose, payload in cases:
        shelf.add(name, spec, purpose, _file(payload))
    overlong = payload_of(b"\x80\x00" + head[1:])
    purpose = "A distance not in its shortest form."
    shelf.add("distance-varint", "COPY; Conventions", purpose, _file(overlong))


def _flags(shelf: Broken) -> None:
    crafter = _begun()
    payload = payload_of(content_of(copies_of(crafter), crafter.offset))
    for name, flags in (("critical", 0), ("safe-to-copy", 3)):
        shelf.add(name, "Chunks; COPY", f"A COPY with flags {flags}.", _file(payload, flags))
