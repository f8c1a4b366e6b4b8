"""Templates of arrays at fault."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from mcz.formats.arrays.layout import ArrayDetail, Kind, Piece
from mcz.motion import Motion, Signal, Source
from mcz.schema import varint
from tools.records import built
from tools.vectors.build.array_files import (
    SPEC,
    floats,
    npy,
    pieces_of,
    plain_npz,
    raw,
    take_arrays,
)
from tools.vectors.build.edits import plus
from tools.vectors.build.files import Unrestorable, file_of
from tools.vectors.build.source_files import with_source, with_template


def add(shelf: Unrestorable) -> None:
    plain = take_arrays(npy(floats(4, 2)), "plain.npy")
    _fields(shelf, plain)
    _lists(shelf, plain)
    _runs(shelf)
    _numbers(shelf)


def _fields(shelf: Unrestorable, plain: Motion) -> None:
    """Pieces of an NPY file are text, a count, text, numbers."""
    head, count, text, numbers = pieces_of(plain)
    assert (count.kind, numbers.kind) == (Kind.COUNT, Kind.DATA)
    whole = npy(floats(4, 2))
    cases: tuple[tuple[str, str, list[bytes]], ...] = (
        ("kind", "a piece of kind 7", [*map(raw, (head, count, text, numbers)), b"\7"]),
        ("type", "numbers of type 12", [raw(numbers, type=12)]),
        ("flags", "flags of 4", [raw(numbers, flags=4)]),
        ("signal-of-count", "the count of a signal that there is not", [raw(count, signal=1)]),
        ("signal", "numbers of a signal that there is not", [raw(numbers, signal=1)]),
        ("channel", "a channel behind the last", [raw(numbers, runs=((1, 2),))]),
        ("run", "a run of no channels behind all", [raw(numbers, runs=((0, 2), (2, 0)))]),
        ("count", "no room for the count", [raw(count, size=len(count.after))]),
    )
    for name, purpose, parts in cases:
        if len(parts) == 1:
            is_count = parts[0][0] == Kind.COUNT
            changed = (
                [*parts, raw(text), raw(numbers)] if is_count else [raw(count), raw(text), *parts]
            )
            parts = [raw(head), *changed]
        template = varint(len(parts)) + b"".join(parts)
        data = file_of(_stated(plain, template, [], whole))
        shelf.add(f"arrays-{name}", SPEC, f"A template of arrays: {purpose}.", data)
    for name, purpose, edit in (
        ("tail", "a byte behind it, which is closed", plus(b"\0")),
        ("cut", "it ends early", lambda data: data[:-1]),
    ):
        data = file_of(plain, SRCE=with_template(edit))
        shelf.add(f"arrays-{name}", SPEC, f"A template of arrays: {purpose}.", data)


def _stated(plain: Motion, template: bytes, parts: list[bytes], whole: bytes) -> Motion:
    """``plain`` with a source of these parts that states size and hash of ``whole``."""
    assert plain.source is not None
    detail = built(ArrayDetail, {"parts": parts}, "detail")
    source = Source(plain.source.format, template, detail, path=plain.source.path)
    return with_source(replace(plain, source=source), whole)


def _lists(shelf: Unrestorable, plain: Motion) -> None:
    """What pieces say of others; what a reader restores that overlooks it is as it is stated."""
    text = Piece(Kind.TEXT, b"abc")
    zero = b"\0\0\0\0"
    crc_abc = (0x352441C2).to_bytes(4, "little")
    crc_of_it = zlib.crc32(crc_abc).to_bytes(4, "little")
    sums = (Kind.CRC, Kind.SIZE4, Kind.SIZE8)
    cases: list[tuple[str, str, list[Piece], list[bytes], bytes]] = [
        ("parts", "a part too many", [text], [b"x"], b"abc"),
        ("no-parts", "a part too few", [text, Piece(Kind.OWN)], [], b"abc"),
    ]
    for kind in sums:
        name = kind.name.lower()
        size = bytes(8 if kind == Kind.SIZE8 else 4)
        back = [Piece(kind, start=1, stop=0), text]
        far = [text, Piece(kind, start=3, stop=3)]
        cases += [
            (f"back-{name}", f"a {kind.name} from behind", back, [], size + b"abc"),
            (f"far-{name}", f"a {kind.name} beyond the end", far, [], b"abc" + size),
        ]
    itself = [Piece(Kind.CRC, start=0, stop=1)]
    nested = [text, Piece(Kind.CRC, start=0, stop=1), Piece(Kind.CRC, start=1, stop=2)]
    over = [text, text, Piece(Kind.CRC, start=0, stop=2), Piece(Kind.CRC, start=1, stop=2)]
    inside = [text, text, Piece(Kind.CRC, start=0, stop=1), Piece(Kind.CRC, start=0, stop=2)]
    both = (0x726E994C).to_bytes(4, "little")
    cases += [
        ("crc-of-itself", "a CRC-32 of itself", itself, [], zero),
        ("crc-of-crc", "a CRC-32 of a CRC-32", nested, [], b"abc" + crc_abc + crc_of_it),
        ("crc-overlap", "CRC-32s that overlap", over, [], b"abcabc" + both + crc_abc),
        ("crc-inside", "a CRC-32 within another", inside, [], b"abcabc" + crc_abc + both),
    ]
    many = [Piece(Kind.TEXT)] * (2**16 + 1)
    cases.append(("many-pieces", "2^16 + 1 pieces", many, [], b""))
    for name, purpose, pieces, parts, whole in cases:
        template = varint(len(pieces)) + b"".join(map(raw, pieces))
        data = file_of(_stated(plain, template, parts, whole))
        shelf.add(f"arrays-{name}", SPEC, f"A template of arrays: {purpose}.", data)


def _runs(shelf: Unrestorable) -> None:
    ones = take_arrays(npy(np.ones((1, 1), np.int8)), "ones.npy")
    count = 2**18 + 1
    pieces = [Piece(Kind.DATA, type=5, runs=((0, 1),) * count)]
    template = varint(1) + raw(pieces[0])
    data = file_of(_stated(ones, template, [], b"\1" * count))
    shelf.add("arrays-many-runs", SPEC, "A template of arrays: 2^18 + 1 runs.", data)


def _numbers(shelf: Unrestorable) -> None:
    many = take_arrays(plain_npz({"a": floats(3, 2), "b": floats(3, 1)}), "many.npz")
    assert many.source is not None
    ints = Signal(np.arange(3).reshape(3, 1), name="b", channels=many.signals[1].channels)
    wrong = replace(many, signals=(many.signals[0], ints))
    data = file_of(wrong)
    shelf.add("arrays-hash", SPEC, "An NPZ file: another array than the hash is of.", data)
