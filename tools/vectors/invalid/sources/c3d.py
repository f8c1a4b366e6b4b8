"""Templates, details and signals of C3D at fault."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mcz.formats.c3d_layout import MAX_ZEROS, C3dDetail, C3dField, C3dTemplate
from mcz.motion import Channel, Motion, Signal
from mcz.numbers import Grid, GridKind
from mcz.schema import build, parse, varint
from tools.vectors.build.c3d_files import C3D_SPEC, c3d_file, take_c3d
from tools.vectors.build.cuts import shown
from tools.vectors.build.edits import Edit, both, plus, put
from tools.vectors.build.files import Unrestorable, file_of
from tools.vectors.build.source_files import restored, with_source, with_template


def add(shelf: Unrestorable) -> None:
    _template(shelf)
    _detail(shelf)
    _zeros(shelf)
    _signals(shelf)
    _fields(shelf)
    _parts_and_signals(shelf)
    _range(shelf)


def _template(shelf: Unrestorable) -> None:
    floats, integers = (
        take_c3d(c3d_file().build(), "prop"),
        take_c3d(c3d_file(size=2).build(), "prop"),
    )
    beyond = b"\x80\x80\4"  # 65,536

    def field(path: str, new: bytes) -> Edit:
        return put(C3dTemplate, path, new)

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
        data = file_of(motion, SRCE=with_template(edit))
        shelf.add(f"c3d-template-{name}", C3D_SPEC, f"A template of C3D: {purpose}.", data)


def _detail(shelf: Unrestorable) -> None:
    motion = take_c3d(c3d_file(first=3).build(), "prop")
    assert motion.source is not None
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("values-short", "its fields lack a byte", put(C3dDetail, "values", b"\5" + bytes(5))),
        ("values-long", "its fields have a byte more", put(C3dDetail, "values", b"\7" + bytes(7))),
        ("values", "another number of the last frame", _last_frame),
        ("tail", "a byte behind it, which is closed", plus(b"\0")),
        ("cut", "it ends early", lambda data: data[:-1]),
    )
    for name, purpose, edit in cases:
        detail = edit(motion.source.detail)
        data = file_of(replace(motion, source=replace(motion.source, detail=detail)))
        shelf.add(f"c3d-detail-{name}", C3D_SPEC, f"A detail of C3D: {purpose}.", data)


def _zeros(shelf: Unrestorable) -> None:
    """More zeros behind the data than there may be, of which size and hash are right."""
    whole = c3d_file(first=3).build()
    motion = take_c3d(whole, "prop")
    source = motion.source
    assert source is not None
    n_zeros = parse(C3dDetail, source.detail, "detail").zeros
    whole += bytes(MAX_ZEROS + 1 - n_zeros)
    more = replace(
        source,
        detail=put(C3dDetail, "zeros", varint(MAX_ZEROS + 1))(source.detail),
        size=len(whole),
        sha256=hashlib.sha256(whole).digest(),
    )
    data = file_of(replace(motion, source=more))
    shelf.add("c3d-detail-zeros", C3D_SPEC, "A detail of C3D: 2^20 + 1 zeros.", data)


def _last_frame(detail: bytes) -> bytes:
    assert detail[3:9] == b"\3\0\6\0\4\0"  # first, last, POINT:FRAMES
    return detail[:5] + b"\7" + detail[6:]


def _signals(shelf: Unrestorable) -> None:
    """Signals that the template does not fit."""
    floats, integers = (
        take_c3d(c3d_file().build(), "prop"),
        take_c3d(c3d_file(size=2).build(), "prop"),
    )

    def field(path: str, new: int) -> Edit:
        return put(C3dTemplate, path, bytes((new,)))

    cases: tuple[tuple[str, str, Motion, Sequence[Edit]], ...] = (
        ("points", "three points of two", floats, [field("points", 3)]),
        ("channels", "one analog channel of two", floats, [field("channels", 1)]),
        ("subframes", "one sample a frame of two", floats, [field("subframes", 1)]),
        ("rotations", "rotations that the clip has not", floats, [field("rotations", 1)]),
        ("grids", "floats of integers", integers, [field("word", 4)]),
        ("grids-of-vax", "VAX floats of IEEE floats", floats, [field("processor", 85)]),
    )
    for name, purpose, motion, edits in cases:
        data = file_of(motion, SRCE=with_template(both(*edits)))
        shelf.add(f"c3d-signals-{name}", C3D_SPEC, f"A template of C3D: {purpose}.", data)
    renamed = replace(floats.signals[2], role="")
    motion = replace(floats, signals=(*floats.signals[:2], renamed))
    purpose = "A clip without the signal analog, which its template of C3D needs."
    shelf.add("c3d-signals-missing", C3D_SPEC, purpose, file_of(motion))


def _fields(shelf: Unrestorable) -> None:
    """Fields out of order, or with more bytes than they take."""
    text = c3d_file(first=3).build()
    motion = take_c3d(text, "prop")
    assert motion.source is not None
    detail = parse(C3dDetail, motion.source.detail, "detail")
    values = detail.values
    longer = put(C3dDetail, "values", varint(len(values) + 1) + values + b"\0")
    purpose = "A detail of C3D: a byte behind the values of all fields."
    shelf.add(
        "c3d-detail-values-and-byte", C3D_SPEC, purpose, file_of(with_source(motion, text, longer))
    )
    swapped = values[2:4] + values[:2] + values[4:]
    edit = put(C3dDetail, "values", varint(len(values)) + swapped)
    data = file_of(with_source(motion, text, edit), SRCE=with_template(_descending))
    purpose = "A template of C3D: its first two fields, with their values, in another order."
    shelf.add("c3d-template-field-descending", C3D_SPEC, purpose, data)
    edit = put(C3dDetail, "values", varint(len(values) + 2) + values + b"\0\0")
    data = file_of(with_source(motion, text, edit), SRCE=with_template(_behind))
    purpose = "A template of C3D: a field more, the last byte of which is not in head."
    shelf.add("c3d-template-field-half", C3D_SPEC, purpose, data)


def _descending(template: bytes) -> bytes:
    fields = parse(C3dTemplate, template, "template")
    fields.fields[0], fields.fields[1] = fields.fields[1], fields.fields[0]
    return build(fields, "template")


def _behind(template: bytes) -> bytes:
    fields = parse(C3dTemplate, template, "template")
    fields.fields.append(C3dField(at=len(fields.head) - 1, kind=0))
    return build(fields, "template")


def _parts_and_signals(shelf: Unrestorable) -> None:
    """Parts of a file, and signals, that do not fit and could be restored."""
    text = c3d_file(first=3, tail=b"behind" + bytes(506)).build()
    motion = take_c3d(text, "prop")
    assert motion.source is not None
    detail = parse(C3dDetail, motion.source.detail, "detail")
    tail = detail.tail
    moved = put(C3dDetail, "tail", varint(len(tail) - 1) + tail[1:])
    gap = put(C3dTemplate, "gap", b"\1" + tail[:1])
    data = file_of(with_source(motion, text, moved), SRCE=with_template(gap))
    purpose = "A template of C3D: the first byte of the tail as a gap before no rotations."
    shelf.add("c3d-template-gap-moved", C3D_SPEC, purpose, data)
    integers = take_c3d(c3d_file(size=2).build(), "prop")
    rotations = Signal(
        np.arange(4 * 17).reshape(4, 17),
        (Grid(GridKind.INTEGER),) * 17,
        "rotations",
        channels=tuple(Channel("", f"turn {c}") for c in range(17)),
        role="rotations",
    )
    whole = c3d_file(size=2).build() + rotations.values.astype("<i2").tobytes()
    motion = replace(integers, signals=(*integers.signals, rotations))
    edit = put(C3dTemplate, "rotations", b"\1")
    data = file_of(with_source(motion, whole), SRCE=with_template(edit))
    purpose = "A template of C3D: rotations of integers, which the clip has."
    shelf.add("c3d-template-rotations-there", C3D_SPEC, purpose, data)
    residuals = integers.signals[1]
    grids = (Grid(GridKind.BINARY64),) * residuals.n_channels
    floats = replace(residuals, values=residuals.values.astype(np.float64), grids=grids)
    motion = replace(integers, signals=(integers.signals[0], floats, *integers.signals[2:]))
    purpose = "Residuals of integers on a grid of binary64."
    shelf.add("c3d-signals-grid-of-residuals", C3D_SPEC, purpose, file_of(motion))


def _range(shelf: Unrestorable) -> None:
    """A part of a C3D file whose parameters lie behind the data."""
    motion = take_c3d(c3d_file(4).build(), "prop")
    left = replace(shown(motion, 1, 3), frame_numbers=None)
    text = restored(left)
    assert left.source is not None and text[0] == 2
    far = bytes((len(text) // 512 + 2,))
    whole = far + text[1:]

    def moved(template: bytes) -> bytes:
        fields = parse(C3dTemplate, template, "template")
        fields.head = far + fields.head[1:]
        return build(fields, "template")

    digest = hashlib.sha256(whole).digest()
    source = replace(left.source, size=len(whole), sha256=digest)
    data = file_of(replace(left, source=source), SRCE=with_template(moved))
    purpose = "Two of four frames of a C3D file whose header says that parameters follow the data."
    shelf.add("c3d-range-parameters-behind", C3D_SPEC, purpose, data)
