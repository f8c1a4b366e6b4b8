"""Attachments, their parts and paths, and aliases at fault."""

from __future__ import annotations

from typing import Any

from mcz.container import payloads
from mcz.container.chunks import build_foot
from mcz.schema import varint
from mcz.writing.clip_writer import write_skeleton
from tools.vectors.build.edits import Edit, Nth, put
from tools.vectors.build.files import Broken, Crafter, finished, skeleton_chunk
from tools.vectors.build.motions import dance, puppet


def add(shelf: Broken) -> None:
    _attachments(shelf)
    _paths(shelf)
    _aliases(shelf)
    _parts_and_names(shelf)
    _numbers_of_parts(shelf)
    _between_parts(shelf)


def _attached(edit: Edit) -> bytes:
    crafter = Crafter(ATTA=edit)
    crafter.parts("a/b.txt", b"first ", b"second")
    return finished(crafter, index=False)


def _attachments(shelf: Broken) -> None:
    def of(part: int, path: str, new: bytes) -> Edit:
        """Edit one of the two parts; its number is the ninth byte."""
        edit = put(payloads.Atta, path, new)
        return lambda payload: edit(payload) if payload[8] == part else payload

    def exchanged(payload: bytes) -> bytes:
        return payload[:8] + bytes((1 - payload[8],)) + payload[9:]

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("order", "Part 1 comes first.", exchanged),
        ("part-missing", "Part 1 of 3 is the last.", put(payloads.Atta, "n_parts", b"\3")),
        ("part-of-0", "A part of none.", put(payloads.Atta, "n_parts", b"\0")),
        ("parts-differ", "The parts state different counts.", of(1, "n_parts", b"\3")),
        ("hashes-differ", "The parts state different hashes.", of(0, "sha256", b"h" * 32)),
        ("hash-later", "Part 1 states another hash than the file's.", of(1, "sha256", b"h" * 32)),
        ("parts-before", "Part 0 states another count than part 1.", of(0, "n_parts", b"\3")),
        ("hash", "A hash that is not that of the parts.", put(payloads.Atta, "sha256", b"h" * 32)),
        ("size", "The parts are shorter than the size.", put(payloads.Atta, "size", b"\x0d")),
        ("part-size", "A part is shorter than it says.", of(1, "part_size", b"\7")),
        ("encoding", "An encoding beyond the table.", of(1, "flags", b"\3")),
    )
    for name, purpose, edit in cases:
        shelf.add(f"ATTA-{name}", "ATTA", purpose, _attached(edit))


def _paths(shelf: Broken) -> None:
    cases = {
        "up": b"../b.txt",
        "absolute": b"/etc/b",
        "drive": b"c:/b.txt",
        "backslash": b"a\\b.txt",
        "empty-part": b"a//b.txt",
        "dot": b"./b.txt",
        "empty": b"",
        "NUL": b"a\0b.txt",
    }
    for name, path in cases.items():
        data = _attached(put(payloads.Atta, "name", varint(len(path)) + path))
        shown = path.decode().replace("\0", "(NUL)")
        purpose = f"The name {shown!r} is no plain relative path."
        shelf.add(f"path-{name}", "ATTA; ALIA", purpose, data)


def _aliases(shelf: Broken) -> None:
    def aliased(name: str, purpose: str, of: int, target: bytes, **edits: Any) -> None:
        crafter = Crafter(**edits)
        crafter.clip(dance())
        crafter.alias("copy.txt", of, target)
        shelf.add(f"ALIA-{name}", "ALIA; Grammar", purpose, finished(crafter))

    aliased("no-clip", "An alias of no clip.", payloads.OF_CLIP, b"nobody")
    aliased("no-skeleton", "An alias of no skeleton.", payloads.OF_SKELETON, b"s" * 16)
    aliased("no-attachment", "An alias of no attachment.", payloads.OF_ATTACHMENT, b"dance")
    aliased("clip-without-source", "An alias of a clip without a source.", 0, b"dance")
    crafter = Crafter()
    crafter.alias("copy.asf", payloads.OF_SKELETON, write_skeleton(crafter, puppet()))
    purpose = "An alias of a skeleton without a source."
    shelf.add("ALIA-skeleton-without-source", "ALIA", purpose, finished(crafter))
    crafter = Crafter(ALIA=put(payloads.Alia, "of", b"\3"))
    crafter.parts("b.txt", b"")
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    data = finished(crafter, index=False)
    shelf.add("ALIA-of", "ALIA", "An alias of a kind beyond the table.", data)
    crafter = Crafter()
    crafter.parts("b.txt", b"")
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    del crafter.directory.aliases["c.txt"]
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    data = finished(crafter, index=False)  # which would list one of them
    shelf.add("ALIA-same-name", "Grammar; ALIA", "Two aliases of one name.", data)


def _parts_and_names(shelf: Broken) -> None:
    third = put(payloads.Atta, "part", b"\2")
    nothing = put(payloads.Atta, "part_size", b"\0")
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
    crafter = Crafter(ATTA_frame=Nth(1, lambda chunk: skeleton_chunk() + chunk))
    crafter.parts("a.txt", b"one", b"two")
    purpose = "A chunk between the two parts of a file."
    shelf.add("ATTA-apart", "ATTA", purpose, finished(crafter, index=False))


def _numbers_of_parts(shelf: Broken) -> None:
    def renumbered(payload: bytes) -> bytes:
        """Parts 0 and 1 of two become 1 and 2; the number is the seventh byte."""
        return payload[:6] + bytes((payload[6] + 1,)) + payload[7:]

    def second(payload: bytes) -> bytes:
        return put(payloads.Atta, "size", b"\7")(payload) if payload[6] else payload

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("part-first", "The parts are numbered from 1.", renumbered),
        ("sizes-differ", "The parts state different sizes.", second),
    )
    for name, purpose, edit in cases:
        crafter = Crafter(ATTA=edit)
        crafter.parts("a.txt", b"one", b"two")
        shelf.add(f"ATTA-{name}", "ATTA", purpose, finished(crafter, index=False))


def _between_parts(shelf: Broken) -> None:
    crafter = Crafter(ATTA_frame=Nth(1, lambda chunk: build_foot(0, 0) + chunk))
    crafter.parts("a.bin", b"first", b"second")
    purpose = "A FOOT between the two parts of a file, both of which are there."
    shelf.add("ATTA-parts-FOOT", "ATTA; Grammar", purpose, finished(crafter, index=False))
    crafter = Crafter(ATTA_frame=Nth(1, _after_note))
    crafter.parts("a.bin", b"first", b"second")
    purpose = "An ancillary chunk between the two parts of a file."
    shelf.add("ATTA-parts-ancillary", "ATTA; Grammar", purpose, finished(crafter, index=False))


def _after_note(chunk: bytes) -> bytes:
    crafter = Crafter()
    before = len(crafter.data)
    crafter.ancillary(b"note", b"between")
    return crafter.data[before:] + chunk
