"""Invalid, one fault each: ``lsdt-clip``, and the bases of any."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mcz.codecs.basis_models import build_bases
from mcz.schema import varint
from tools.vectors.build.edits import Edit, Made, plus, stream
from tools.vectors.build.files import Broken, Vector, rehash
from tools.vectors.build.spatial_clips import (
    CLIP,
    Plan,
    basis_of,
    file_with,
    listed,
    still,
    values_of,
)
from tools.vectors.build.spatial_streams import (
    Bits,
    coded_entries,
    spec_of,
    stream_with,
    with_model,
)
from tools.vectors.invalid.common import every_codec, lsdt, lsdt_streams, spatial

MOST = 2**40


def vectors() -> Iterable[Vector]:
    shelf = Broken(f"invalid/{CLIP}")
    spatial.add(shelf, CLIP)
    lsdt.add(shelf, CLIP)
    lsdt_streams.add(shelf, CLIP)
    every_codec.add(shelf, CLIP)
    _bad_bases(shelf, CLIP)
    _window_bytes(shelf, CLIP)
    _model_of_nothing(shelf)
    _bases(shelf)
    _bits(shelf)
    return shelf.vectors


def _model_of_nothing(shelf: Broken) -> None:
    """A model of a clip in which there is nothing to decode."""
    plan = Plan(CLIP, 4, (), bases=(basis_of(4, 3),))
    data = with_model(plan, 1, build_bases(plan.bases) + b"\0")
    purpose = "Bases with a byte behind their last, of a clip of no frames."
    shelf.add("frames-0-model", spec_of(CLIP, "Bases"), purpose, data)


def _bad_bases(shelf: Broken, name: str) -> None:
    """Bytes that are no bases."""
    # A list for each row, in one byte for any number of them.
    plan = Plan(name, 3, (1,), window=1, bases=(basis_of(3, 2),), prefix=True, fill=still)
    good = build_bases(plan.bases)
    n_bases, n_points, n_vectors, shifts, rest = good[:1], good[1:2], good[2:3], good[3:5], good[5:]
    pair = (1, 3, 6), (1, 3, 7)  # the tables of good
    cases: dict[str, tuple[str, bytes]] = {
        "bases-none": ("A model of no bytes", b""),
        "bases-0": ("No bases", b"\0" + good[1:]),
        "bases-17": ("17 bases", b"\x11" + 17 * b"\1\1\0" + coded_entries(17 * [(1, 1, 0)])),
        "bases-varint": ("One basis, in two bytes", b"\x81\0" + good[1:]),
        "bases-points-0": ("Vectors of no entries", n_bases + b"\0" + good[2:]),
        "bases-points-2049": (
            "Vectors of 2049 entries",
            n_bases + varint(2049) + b"\1\0" + coded_entries([(1, 2049, 0)]),
        ),
        "bases-vectors-0": ("No vectors", n_bases + n_points + b"\0"),
        "bases-vectors-4": (
            "4 vectors of 3 entries",
            n_bases + n_points + b"\4" + bytes(4) + coded_entries([(4, 3, 0)]),
        ),
        "bases-shift-41": (
            "41 binary digits",
            good[:3] + b"\6\x29" + coded_entries([(1, 3, 6), (1, 3, 41)]),
        ),
        "bases-shifts-cut": ("A head that ends in its shifts", good[:4]),
        "bases-head-cut": ("A head that ends in a number", b"\1\x83"),
        "bases-byte-behind": ("A byte 255 behind the bits of the model", good + b"\xff"),
        "bases-byte-0-behind": ("A byte 0 behind the bits of the model", good + b"\0"),
        "bases-entry-beyond": (
            "An entry of 2^40 + 1",
            good[:5] + coded_entries(pair, [[1, 2, 3]], [[4, 5, MOST + 1]]),
        ),
        "bases-entry-below": (
            "An entry of -2^40 - 1",
            good[:5] + coded_entries(pair, [[1, 2, 3]], [[4, 5, -MOST - 1]]),
        ),
    }
    assert n_vectors + shifts + rest == good[2:]
    for case, (purpose, data) in cases.items():
        none = {"segments": stream_with(plan, b"")} if case == "bases-vectors-0" else {}
        made = with_model(plan, 1, data, **none)
        shelf.add(case, spec_of(name, "Bases"), f"{purpose}.", made)


def _window_bytes(shelf: Broken, name: str) -> None:
    """Windows whose bytes do not fill the stream."""
    plan = Plan(name, 2, (20,))  # windows of 8, 8 and 4 frames
    values = values_of(plan)
    short = values.copy()
    short[16:] = 0
    parts: dict[str, tuple[str, Edit, np.ndarray]] = {
        "window-behind": ("A byte behind the last window.", plus(b"\x01"), values),
        "window-4": ("A fourth window, of no bytes.", plus(b"\0"), values),
        "window-missing": (
            "The third window is missing.",
            lambda data: data[: _ends(data)[2]],
            short,
        ),
        "windows-none": ("No window.", lambda _: b"", np.zeros((20, 2))),
        "window-more": (
            "The last window has a byte more than the stream.",
            lambda data: _resized(data, 1),
            values,
        ),
        "window-less": (
            "The last window has a byte less than the stream.",
            lambda data: _resized(data, -1),
            values,
        ),
        "window-size-varint": (
            "The bytes of the last window, in a number of two bytes.",
            _long_size,
            values,
        ),
        "window-size-cut": (
            "The stream ends in the number of bytes of the last window.",
            lambda data: data[: _ends(data)[2]] + b"\x80",
            short,
        ),
    }
    for case, (purpose, edit, seen) in parts.items():
        edits = {"segments": stream(0, edit), "CEND": rehash(seen)}
        shelf.add(case, spec_of(name), purpose, file_with(plan, **edits))
    two = replace(plan, segments=(8, 8))

    def joined(made: Made) -> Made:
        (head, (a,)), (_, (b,)) = made
        return [(replace(head, n_frames=8), [a + b]), (made[1][0], [b])]

    purpose = "A segment of one window holds two."
    shelf.add("segment-windows", spec_of(name), purpose, file_with(two, segments=joined))


def _ends(data: bytes) -> list[int]:
    """Where each window begins, all of which are short, and the end."""
    found = [0]
    while found[-1] < len(data):
        assert data[found[-1]] < 128
        found.append(found[-1] + 1 + data[found[-1]])
    return found


def _resized(data: bytes, by: int) -> bytes:
    start = _ends(data)[-2]
    return data[:start] + bytes((data[start] + by,)) + data[start + 1 :]


def _long_size(data: bytes) -> bytes:
    start = _ends(data)[-2]
    return data[:start] + bytes((data[start] | 128, 0)) + data[start + 1 :]


def _bases(shelf: Broken) -> None:
    plan = Plan(CLIP, 3, (1,), window=1, bases=(basis_of(3, 2),), prefix=True, fill=still)
    data = b"\x11\3\2\6\7" + 16 * b"\1\1\0"
    data += coded_entries([(1, 3, 6), (1, 3, 7), *16 * [(1, 1, 0)]])
    purpose = "17 bases, of which the first is the one that is due."
    shelf.add("bases-17-first", spec_of(CLIP, "Bases"), purpose, with_model(plan, 1, data))


def _bits(shelf: Broken) -> None:
    pair = (1, 1), (1, 1)
    row = Bits(pair).sparse(6, (0, 2))
    plan = Plan(CLIP, 4, (6,), prefix=True, lengths=pair, fill=listed([[2]]), window=6)
    data = row.plain(0, 9).data()
    assert data[1:] == b"\0"
    purpose = "Bits of prefix codes without their last byte, which is 0."
    bits = {"segments": stream_with(plan, data[:1])}
    made = file_with(plan, **bits)
    shelf.add("byte-missing-0-prefix", spec_of(CLIP, "Bits"), purpose, made)
