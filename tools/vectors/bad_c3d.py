"""Invalid, one fault each: templates and details of C3D. All are asked for sources."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import replace

from mcz.formats.c3d_layout import C3D_DETAIL, C3D_TEMPLATE, MAX_ZEROS
from mcz.motion import Motion
from mcz.schema import parse, varint
from tools.vectors.bad_sources import Unrestorable, _srce
from tools.vectors.craft import Vector, file_of
from tools.vectors.edits import Edit, both, plus, put
from tools.vectors.sources_c3d import SPEC, made, take


def vectors() -> Iterable[Vector]:
    shelf = Unrestorable("invalid/sources")
    _template(shelf)
    _detail(shelf)
    _zeros(shelf)
    _signals(shelf)
    return shelf.vectors


def _template(shelf: Unrestorable) -> None:
    floats, integers = take(made().build(), "prop"), take(made(size=2).build(), "prop")
    beyond = b"\x80\x80\4"  # 65,536

    def field(path: str, new: bytes) -> Edit:
        return put(C3D_TEMPLATE, path, new)

    cases: tuple[tuple[str, str, Motion, Edit], ...] = (
        ("processor", "a processor of 87", floats, field("processor", b"\x57")),
        ("word", "words of 3 bytes", floats, field("word", b"\3")),
        ("points", "65,536 points", floats, field("points", beyond)),
        ("channels", "65,536 analog channels", floats, field("channels", beyond)),
        ("subframes", "no samples a frame", floats, field("subframes", b"\0")),
        ("subframes-many", "65,536 samples a frame", floats, field("subframes", beyond)),
        ("rotations-many", "65,536 rotations", floats, field("rotations", beyond)),
        ("ratio-many", "a ratio of 65,536", floats, field("ratio", beyond)),
        ("unsigned", "unsigned is 2", integers, field("unsigned", b"\2")),
        ("unsigned-floats", "unsigned floats", floats, field("unsigned", b"\1")),
        ("rotations", "rotations of integers", integers, field("rotations", b"\1")),
        ("ratio", "a ratio of 0", floats, field("ratio", b"\0")),
        ("gap", "a gap without rotations", floats, field("gap", b"\1\0")),
        ("field-kind", "a field of kind 7", floats, field("fields.0.kind", b"\7")),
        ("field-order", "a field within another", floats, field("fields.1.at", b"\7")),
        ("field-beyond", "a field not within head", floats, field("fields.2.at", varint(1023))),
        ("tail", "a byte behind it, which is closed", floats, plus(b"\0")),
        ("cut", "it ends early", floats, lambda data: data[:-1]),
    )
    for name, purpose, motion, edit in cases:
        data = file_of(motion, SRCE=_srce(edit))
        shelf.add(f"c3d-template-{name}", SPEC, f"A template of C3D: {purpose}.", data)


def _detail(shelf: Unrestorable) -> None:
    motion = take(made(first=3).build(), "prop")
    assert motion.source is not None
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("values-short", "its fields lack a byte", put(C3D_DETAIL, "values", b"\5" + bytes(5))),
        ("values-long", "its fields have a byte more", put(C3D_DETAIL, "values", b"\7" + bytes(7))),
        ("values", "another number of the last frame", _last_frame),
        ("tail", "a byte behind it, which is closed", plus(b"\0")),
        ("cut", "it ends early", lambda data: data[:-1]),
    )
    for name, purpose, edit in cases:
        detail = edit(motion.source.detail)
        data = file_of(replace(motion, source=replace(motion.source, detail=detail)))
        shelf.add(f"c3d-detail-{name}", SPEC, f"A detail of C3D: {purpose}.", data)


def _zeros(shelf: Unrestorable) -> None:
    """More zeros behind the data than there may be, of which size and hash are right."""
    whole = made(first=3).build()
    motion = take(whole, "prop")
    source = motion.source
    assert source is not None
    n_zeros = parse(C3D_DETAIL, source.detail, "detail").zeros
    whole += bytes(MAX_ZEROS + 1 - n_zeros)
    more = replace(
        source,
        detail=put(C3D_DETAIL, "zeros", varint(MAX_ZEROS + 1))(source.detail),
        size=len(whole),
        sha256=hashlib.sha256(whole).digest(),
    )
    data = file_of(replace(motion, source=more))
    shelf.add("c3d-detail-zeros", SPEC, "A detail of C3D: 2^20 + 1 zeros.", data)


def _last_frame(detail: bytes) -> bytes:
    assert detail[3:9] == b"\3\0\6\0\4\0"  # first, last, POINT:FRAMES
    return detail[:5] + b"\7" + detail[6:]


def _signals(shelf: Unrestorable) -> None:
    """Signals that the template does not fit."""
    floats, integers = take(made().build(), "prop"), take(made(size=2).build(), "prop")

    def field(path: str, new: int) -> Edit:
        return put(C3D_TEMPLATE, path, bytes((new,)))

    cases: tuple[tuple[str, str, Motion, Sequence[Edit]], ...] = (
        ("points", "three points of two", floats, [field("points", 3)]),
        ("channels", "one analog channel of two", floats, [field("channels", 1)]),
        ("subframes", "one sample a frame of two", floats, [field("subframes", 1)]),
        ("rotations", "rotations that the clip has not", floats, [field("rotations", 1)]),
        ("grids", "floats of integers", integers, [field("word", 4)]),
        ("grids-of-vax", "VAX floats of IEEE floats", floats, [field("processor", 85)]),
    )
    for name, purpose, motion, edits in cases:
        data = file_of(motion, SRCE=_srce(both(*edits)))
        shelf.add(f"c3d-signals-{name}", SPEC, f"A template of C3D: {purpose}.", data)
    renamed = replace(floats.signals[2], name="analogue")
    motion = replace(floats, signals=(*floats.signals[:2], renamed))
    purpose = "A clip without the signal analog, which its template of C3D needs."
    shelf.add("c3d-signals-missing", SPEC, purpose, file_of(motion))
