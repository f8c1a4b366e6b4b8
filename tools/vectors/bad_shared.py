"""Invalid, one fault each: SKEL, SRCE, MODL, ATTA, ALIA."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

from mcz.container import payloads
from mcz.files.encoding import write_skeleton
from mcz.schema import varint
from tools.vectors.craft import Broken, Crafter, Vector, file_of, finished
from tools.vectors.edits import Edit, plus, put, span
from tools.vectors.motions import dance, puppet
from tools.vectors.sources import PLAIN, take

INFINITE, NOT_A_NUMBER = float("inf"), float("nan")


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/shared")
    _skeletons(shelf)
    _templates(shelf)
    _attachments(shelf)
    _paths(shelf)
    _aliases(shelf)
    return shelf.vectors


def _doubles(*values: float) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)


def _skeletons(shelf: Broken) -> None:
    nan, many = _doubles(0, NOT_A_NUMBER, 0), varint(4097) + b"\0" * 5 * 4097
    cases = (
        ("SKEL-flag", "A reserved flag of SKEL is set.", "flags", b"\3", ""),
        ("JOINT-flag", "A reserved flag of a joint is set.", "joints.1.flags", b"\x0b", ""),
        ("parent-of-itself", "A joint is its own parent.", "joints.1.parent", b"\2", ""),
        ("parent-later", "A parent comes after its child.", "joints.1.parent", b"\3", ""),
        ("offset-NaN", "An offset that is not a number.", "joints.1.offset", nan, ""),
        (
            "tail-infinite",
            "An infinite tail.",
            "joints.2.tails",
            b"\1" + _doubles(0, 0, INFINITE),
            "",
        ),
        ("unit-NaN", "A length unit that is no number.", "unit_cm", b"\1" + nan[8:16], ""),
        ("unit-negative", "A negative length unit.", "unit_cm", b"\1" + _doubles(-1), ""),
        ("unit-0", "A length unit of 0.", "unit_cm", b"\1" + _doubles(0), ""),
        (
            "optional-2",
            "An optional field twice.",
            "unit_cm",
            b"\2" + _doubles(1, 1),
            "Conventions",
        ),
        ("angle-unit", "An angle unit beyond the table.", "angle_unit", b"\3", ""),
        ("up-axis", "An up axis beyond the table.", "up_axis", b"\4", ""),
        ("base-missing", "A base that is not in the file.", "base", b"\1" + b"b" * 16, "Grammar"),
        ("name-UTF-8", "A name that is not UTF-8.", "joints.1.name", b"\2\xc3\x28", "Conventions"),
        (
            "varint-overlong",
            "A count with a useless last byte.",
            "joints.2.channels",
            b"\x80\0",
            "Conventions",
        ),
        (
            "varint-beyond-2-53",
            "A length of 2^53.",
            "joints.2.name",
            b"\x80" * 7 + b"\x10",
            "Conventions",
        ),
        (
            "varint-endless",
            "A varint of ten bytes.",
            "joints.2.name",
            b"\xff" * 9 + b"\1",
            "Conventions",
        ),
        (
            "count-of-joints",
            "Many more joints than bytes.",
            "joints",
            b"\xff\xff\xff\xff\x0f",
            "Conventions",
        ),
        ("joint-limit", "4,097 joints in the base profile.", "joints", many, "Limits and profiles"),
    )
    for name, purpose, path, new, heading in cases:
        spec = f"SKEL; {heading}" if heading else "SKEL"
        shelf.edited(name, spec, purpose, SKEL=put(payloads.SKEL, path, new))
    shelf.edited("axis-order", "SKEL", "An axis order beyond the table.", SKEL=_axis_order)
    crafter = Crafter()
    crafter.plain_chunk(b"MODL", b"")
    shelf.add("MODL-empty", "MODL", "A MODL without a kind.", finished(crafter, index=False))


def _axis_order(payload: bytes) -> bytes:
    """Joint 2, which has neither offset nor axis, gets both."""
    stop = span(payloads.SKEL, payload, "joints.2.offset")[1]
    with_axis = payload[:stop] + _doubles(0, 0, 0) + b"\6" + payload[stop:]
    return put(payloads.SKEL, "joints.2.flags", b"\7")(payload)[:stop] + with_axis[stop:]


def _templates(shelf: Broken) -> None:
    source = take(PLAIN, "plain").source
    assert source is not None
    template, size = source.template, len(source.template)

    def field(path: str, new: bytes) -> Edit:
        return put(payloads.SRCE, path, new)

    def stored(payload: bytes) -> bytes:
        return payload[:1] + b"\0" + varint(size + 1) + template

    cases: tuple[tuple[str, str, str, Edit], ...] = (
        ("size", "Conventions", "One byte more than stated.", field("size", varint(size - 1))),
        (
            "size-huge",
            "Limits and profiles",
            "2^40 bytes stated, of a few.",
            field("size", varint(2**40)),
        ),
        ("deflate-tail", "Conventions", "A byte follows the deflate stream.", plus(b"\0")),
        ("deflate-end", "Conventions", "The deflate stream has no end.", lambda data: data[:-1]),
        ("encoding", "", "An encoding beyond the table.", field("encoding", b"\2")),
        ("stored-size", "", "Stored, of another size than stated.", stored),
    )
    for name, heading, purpose, edit in cases:
        spec = f"SRCE; {heading}" if heading else "SRCE"
        data = file_of(take(PLAIN, "plain"), SRCE=edit)
        shelf.add(f"SRCE-{name}", spec, f"A template: {purpose}", data)


def _attached(edit: Edit) -> bytes:
    crafter = Crafter(ATTA=edit)
    crafter.parts("a/b.txt", b"first ", b"second")
    return finished(crafter, index=False)


def _attachments(shelf: Broken) -> None:
    def of(part: int, path: str, new: bytes) -> Edit:
        """Edit one of the two parts; its number is the ninth byte."""
        edit = put(payloads.ATTA, path, new)
        return lambda payload: edit(payload) if payload[8] == part else payload

    def exchanged(payload: bytes) -> bytes:
        return payload[:8] + bytes((1 - payload[8],)) + payload[9:]

    cases: tuple[tuple[str, str, Edit], ...] = (
        ("order", "Part 1 comes first.", exchanged),
        ("part-missing", "Part 1 of 3 is the last.", put(payloads.ATTA, "n_parts", b"\3")),
        ("part-of-0", "A part of none.", put(payloads.ATTA, "n_parts", b"\0")),
        ("parts-differ", "The parts state different counts.", of(1, "n_parts", b"\3")),
        ("hashes-differ", "The parts state different hashes.", of(0, "sha256", b"h" * 32)),
        ("hash", "A hash that is not that of the parts.", put(payloads.ATTA, "sha256", b"h" * 32)),
        ("size", "The parts are shorter than the size.", put(payloads.ATTA, "size", b"\x0d")),
        ("part-size", "A part is shorter than it says.", of(1, "part_size", b"\7")),
        ("encoding", "An encoding beyond the table.", of(1, "encoding", b"\2")),
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
        data = _attached(put(payloads.ATTA, "name", varint(len(path)) + path))
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
    crafter = Crafter(ALIA=put(payloads.ALIA, "of", b"\3"))
    crafter.parts("b.txt", b"")
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    data = finished(crafter, index=False)
    shelf.add("ALIA-of", "ALIA", "An alias of a kind beyond the table.", data)
    crafter = Crafter()
    crafter.parts("b.txt", b"")
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    del crafter.directory.aliases["c.txt"]
    crafter.alias("c.txt", payloads.OF_ATTACHMENT, b"b.txt")
    shelf.add("ALIA-same-name", "Grammar; ALIA", "Two aliases of one name.", finished(crafter))
