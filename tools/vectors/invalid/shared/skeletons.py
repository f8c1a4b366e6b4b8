"""Skeletons and templates at fault."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from mcz.container import payloads
from mcz.schema import deflate, varint
from mcz.writing.clip_writer import write_skeleton
from tools.records import built
from tools.vectors.build.edits import Edit, plus, put, span
from tools.vectors.build.files import Broken, Crafter, file_of, finished
from tools.vectors.build.motions import puppet
from tools.vectors.build.source_files import PLAIN, take
from tools.vectors.build.words import beyond, packed, too_long

INFINITE, NOT_A_NUMBER = float("inf"), float("nan")
_SKELETON: dict[str, Any] = {
    "name": "crowd",
    "flags": 0,
    "unit_cm": None,
    "angle_unit": 0,
    "up_axis": 0,
    "forward_axis": 0,
    "handedness": 0,
    "base": None,
    "source": None,
    "joints": [],
    "extension": b"",
}


def add(shelf: Broken) -> None:
    _skeletons(shelf)
    _templates(shelf)
    _bounds(shelf)
    _text(shelf)
    _many_joints(shelf)
    _infinite_unit(shelf)
    _words(shelf)


def _doubles(*values: float) -> bytes:
    return struct.pack(f"<{len(values)}d", *values)


def _skeletons(shelf: Broken) -> None:
    nan, many = _doubles(0, NOT_A_NUMBER, 0), varint(4097) + b"\0" * 5 * 4097
    cases = (
        ("SKEL-flag", "A reserved flag of SKEL is set.", "flags", b"\5", ""),
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
        ("up-axis", "An up axis beyond the table.", "up_axis", b"\7", ""),
        ("forward-axis", "A forward axis beyond the table.", "forward_axis", b"\7", ""),
        ("forward-up", "A figure that faces down its up axis.", "forward_axis", b"\5", ""),
        ("handedness", "A handedness beyond the table.", "handedness", b"\3", ""),
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
        shelf.edited(name, spec, purpose, SKEL=put(payloads.Skel, path, new))
    shelf.edited("axis-order", "SKEL", "An axis order beyond the table.", SKEL=_axis_order)
    crafter = Crafter()
    crafter.plain_chunk(b"MODL", b"")
    shelf.add("MODL-empty", "MODL", "A MODL without a kind.", finished(crafter, index=False))


def _axis_order(payload: bytes) -> bytes:
    """Joint 2, which has neither offset nor axis, gets both."""
    stop = span(payloads.Skel, payload, "joints.2.offset")[1]
    with_axis = payload[:stop] + _doubles(0, 0, 0) + b"\6" + payload[stop:]
    return put(payloads.Skel, "joints.2.flags", b"\7")(payload)[:stop] + with_axis[stop:]


def _templates(shelf: Broken) -> None:
    source = take(PLAIN, "plain").source
    assert source is not None
    template, size = source.template, len(source.template)

    def field(path: str, new: bytes) -> Edit:
        return put(payloads.Srce, path, new)

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
        ("encoding", "", "An encoding beyond the table.", field("flags", b"\3")),
        ("stored-size", "", "Stored, of another size than stated.", stored),
    )
    for name, heading, purpose, edit in cases:
        spec = f"SRCE; {heading}" if heading else "SRCE"
        data = file_of(take(PLAIN, "plain"), SRCE=edit)
        shelf.add(f"SRCE-{name}", spec, f"A template: {purpose}", data)


def _bounds(shelf: Broken) -> None:
    nan = struct.pack("<3d", 0, float("nan"), 0)
    spec = "SRCE; Conventions"
    ratio = {"SRCE": put(payloads.Srce, "size", varint(2**20))}
    data = file_of(take(PLAIN, "plain"), **ratio)
    purpose = "A template: 2^20 bytes stated, more than its deflate stream can make."
    shelf.add("SRCE-size-ratio", spec, purpose, data)
    data = file_of(take(PLAIN, "plain"), SRCE=lambda p: p[:4] + b"\x07" + p[5:])
    shelf.add("SRCE-deflate-block", spec, "A template: It is no deflate stream.", data)
    crafter = Crafter()
    huge = {"format": 3, "flags": 1, "size": 2**26 + 1, "data": deflate(bytes(2**26 + 1))}
    crafter.shared(b"SRCE", built(payloads.Srce, huge, "SRCE"))
    purpose = "A template of 2^26 + 1 bytes in the base profile."
    shelf.add("SRCE-limit", "SRCE; Limits and profiles", purpose, finished(crafter))
    crafter = Crafter()
    later = write_skeleton(Crafter(), puppet())
    based = put(payloads.Skel, "base", b"\1" + later)(_payload_of(puppet()))
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
        stop = span(payloads.Skel, payload, "joints.1.offset")[1]
        longer = payload[:stop] + axis + b"\0" + payload[stop:]
        start, end = span(payloads.Skel, payload, "joints.1.flags")
        return longer[:start] + bytes((payload[start] | 4,)) + longer[end:]

    return edit


def _text(shelf: Broken) -> None:
    cases = {
        "overlong": ("a slash in two bytes", b"\xc0\xaf"),
        "surrogate": ("half of a surrogate pair", b"\xed\xa0\x80"),
        "beyond": ("a code point beyond U+10FFFF", b"\xf4\x90\x80\x80"),
        "cut": ("a code point without its last byte", b"\xe2\x82"),
        "continuation": ("a byte that continues nothing", b"a\x80"),
    }
    for name, (purpose, text) in cases.items():
        edit = put(payloads.Skel, "joints.1.name", varint(len(text)) + text)
        shelf.edited(f"text-{name}", "SKEL; Conventions", f"A name with {purpose}.", SKEL=edit)


def _many_joints(shelf: Broken) -> None:
    joints = varint(4097) + b"\0" * 5 * 4097
    crafter = Crafter()
    empty = built(payloads.Skel, _SKELETON, "SKEL")
    crafter.shared(b"SKEL", put(payloads.Skel, "joints", joints)(empty))
    purpose = "A skeleton of 4,097 joints in the base profile, and no clip."
    shelf.add("joints-limit", "SKEL; Limits and profiles", purpose, finished(crafter))


def _infinite_unit(shelf: Broken) -> None:
    infinite = b"\1" + np.array([np.inf], "<f8").tobytes()
    edit = put(payloads.Skel, "unit_cm", infinite)
    shelf.edited("unit-infinite", "SKEL", "An infinite length unit.", SKEL=edit)


def _words(shelf: Broken) -> None:
    spec = "SRCE; Conventions"
    purpose = "A template: A distance reaches beyond the first of the words."
    shelf.add("SRCE-words-beyond", spec, purpose, file_of(take(PLAIN, "plain"), SRCE=beyond))
    cases: tuple[tuple[str, str, str, Edit], ...] = (
        ("size", "Conventions", "One byte more than stated", _packed_of_less),
        ("tail", "Conventions", "A byte follows the stream", lambda data: packed(data) + b"\0"),
        ("limit", "Limits and profiles", "2^26 + 1 bytes in the base profile", too_long),
    )
    for name, heading, purpose, edit in cases:
        text = f"Packed fields: {purpose}."
        shelf.edited(f"packed-{name}", f"SKEL; {heading}", text, SKEL=edit)


def _packed_of_less(payload: bytes) -> bytes:
    return packed(payload, len(payload) - payload[0] - 3)
