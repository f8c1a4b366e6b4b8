"""Invalid, one fault each: INDX against the chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from mcz.container import payloads
from mcz.schema import parse, varint
from tools.records import update
from tools.vectors.build.edits import Nth, at, both, plus, put
from tools.vectors.build.files import Broken, Crafter, Vector, finished
from tools.vectors.build.motions import dance, puppet

BOMB = 2**17  # bytes of zeros


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/index")
    _fields(shelf)
    _every_field(shelf)
    _orders(shelf)
    _index_bounds(shelf)
    return shelf.vectors


def _fields(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, Callable[[Any], None]], ...] = (
        ("clip-name", "Another name of the clip.", _clip(name="dancf")),
        ("n-frames", "Another number of frames.", _clip(n_frames=5)),
        ("rate", "Another frame rate.", _clip(rate_numerator=60)),
        ("skeleton", "Another skeleton.", _clip(skeleton=b"s" * 16)),
        ("clip-left-out", "The clip is left out.", lambda fields: fields.clips.clear()),
        ("codec", "Another version of the codec.", _signal(codec_version=1)),
        ("channels", "Another number of channels.", _signal(n_channels=5)),
        ("clip-offset", "The clip is said to be a byte further on.", _moved),
        ("segment-gap", "The segment is said to be a byte further on.", _later),
        ("segment-flags", "Other flags of the segment.", _segment(6, 0)),
        ("segment-signal", "A segment of a signal that is not there.", _segment(2, 1)),
        ("segment-frames", "Another number of frames of the segment.", _segment(3, 3)),
        ("shared-id", "Another id of the skeleton.", _other_id),
        ("head", "Another copy of HEAD.", _other_head),
        ("attachment-too-many", "An attachment that is not there.", _ghost),
        ("alias-too-many", "An alias that is not there.", _ghost_alias),
    )
    for name, purpose, change in cases:
        shelf.edited(name, "INDX; Strict reading", f"INDX: {purpose}", table=_silent(change))
    opened = both(put(payloads.Clip, "flags", b"\1"), put(payloads.Clip, "n_frames", b"\0"))
    purpose = "INDX: No frames of an open clip, as CLIP says, where CEND has 4."
    edits = {"CLIP": opened, "table": _silent(_clip(n_frames=0))}
    shelf.edited("n-frames-of-open", "INDX; CLIP; CEND", purpose, **edits)
    shelf.edited("INDX-size", "INDX; Conventions", "INDX inflates to a byte less.", INDX=_resized)
    purpose = "A byte follows the deflate stream."
    shelf.edited("INDX-deflate", "INDX; Conventions", purpose, INDX=plus(b"\0"))


def _silent(change: Callable[[Any], None]) -> Callable[[Any], Any]:
    def edit(fields: Any) -> Any:
        change(fields)
        return fields

    return edit


def _clip(**changes: Any) -> Callable[[Any], None]:
    return lambda fields: update(fields.clips[0], changes)


def _signal(**changes: Any) -> Callable[[Any], None]:
    return lambda fields: update(fields.clips[0].signals[0], changes)


def _segment(place: int, value: int) -> Callable[[Any], None]:
    """Change one of the seven fields of the segment, all of one byte."""

    def change(fields: Any) -> None:
        row = fields.clips[0]
        assert len(row.segments) == 7
        row.segments = at(place, bytes((value,)))(row.segments)

    return change


def _moved(fields: Any) -> None:
    fields.clips[0].offset += 1


def _later(fields: Any) -> None:
    row = fields.clips[0]
    row.segments = at(0, bytes((row.segments[0] + 1,)))(row.segments)
    row.cend_gap -= 1


def _other_id(fields: Any) -> None:
    fields.shared[0].id = b"?" * 16


def _other_head(fields: Any) -> None:
    fields.head = at(1, b"\7")(fields.head)


def _ghost(fields: Any) -> None:
    fields.attachments.append({"name": "ghost.txt", "size": 0, "parts": []})


def _ghost_alias(fields: Any) -> None:
    fields.aliases.append({"name": "ghost.bvh", "of": 0, "target": b"dance"})


def _resized(payload: bytes) -> bytes:
    fields = parse(payloads.Indx, payload, "INDX")
    return varint(fields.size + 1) + bytes(fields.data)


def _every_field(shelf: Broken) -> None:
    """INDX of a file with all that it lists, one field after the other."""

    def clip(**changes: Any) -> Callable[[Any], Any]:
        return lambda fields: update(fields.clips[0], changes)

    def signal(**changes: Any) -> Callable[[Any], Any]:
        return lambda fields: update(fields.clips[0].signals[0], changes)

    def add(rows: str, path: str, more: int = 1) -> Callable[[Any], Any]:
        def change(fields: Any) -> None:
            row = getattr(fields, rows)[0]
            *inner, last = path.split(".")
            for name in inner:
                row = getattr(row, name)[0]
            setattr(row, last, getattr(row, last) + more)

        return change

    cases: dict[str, tuple[str, Callable[[Any], Any]]] = {
        "rate-denominator": ("Another denominator of the rate.", clip(rate_denominator=2)),
        "codec-id": ("Another codec.", signal(codec=1)),
        "samples": ("Other rows a frame.", signal(samples_per_frame=2)),
        "no-signal": ("A clip without a signal.", clip(signals=[])),
        "clip-length": ("Another length of CLIP.", add("clips", "length")),
        "cend-gap": ("CEND is said to be a byte further on.", add("clips", "cend_gap")),
        "cend-length": ("Another length of CEND.", add("clips", "cend_length")),
        "segment-size": ("Another size of a segment.", _varint(1, 1)),
        "segment-lead": ("Another lead of a segment.", _varint(4, 1)),
        "segment-tail": ("Another tail of a segment.", _varint(5, 1)),
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
            lambda f: update(f.shared[0], {"type": b"MODL"}),
        ),
        "shared-missing": ("The skeleton is left out.", lambda f: f.shared.pop(0) and None),
        "attachment-size": ("Another size of an attachment.", add("attachments", "size")),
        "attachment-offset": ("A part lies elsewhere.", add("attachments", "parts.offset")),
        "attachment-length": ("A part is longer.", add("attachments", "parts.length")),
        "attachment-name": ("Another name.", lambda f: update(f.attachments[0], {"name": "b.txt"})),
        "attachment-no-part": ("No part.", lambda f: update(f.attachments[0], {"parts": []})),
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


def _varint(place: int, more: int) -> Callable[[Any], Any]:
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
        setattr(row, field, new if isinstance(new, bytes) else getattr(row, field) + new)

    return change


def _alias(**changes: Any) -> Callable[[Any], Any]:
    return lambda fields: update(fields.aliases[0], changes)


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

    crafter = Crafter(table=Nth(0, slower))
    finished(crafter, dance())
    data = finished(crafter, dance(3, name="encore"))
    purpose = "INDX: the first of two says another frame rate; the last is right."
    shelf.add("first-of-two", "INDX; Strict reading", purpose, data)


def _orders(shelf: Broken) -> None:
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
