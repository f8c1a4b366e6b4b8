"""Invalid, one fault each: streams of ``fast``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.coding.ordinals.counts import Law
from mcz.coding.quick import streams as quick
from mcz.coding.quick.kernels import FAR
from mcz.container import payloads
from mcz.motion import Motion
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.vectors.build.edits import Edit, flip, plus, put, stream
from tools.vectors.build.fast_clips import HEADING, Coded, build_stream, codec_of
from tools.vectors.build.files import Broken, Vector, file_of, rehash
from tools.vectors.build.lossless_clips import (
    BINARY32,
    BINARY64,
    COUNTS,
    DOUBLE,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    SINGLE,
    SIX,
    WHOLE,
    Constant,
)
from tools.vectors.build.motions import HUNDREDTHS, column, dance, panel, wave
from tools.vectors.invalid.common import every_codec

ZERO = b"\1"  # a constant of no bytes
STATE = b"\0\0\1\0"  # 2^16


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/fast")
    _heads(shelf)
    _coded(shelf)
    _units(shelf)
    _products(shelf)
    _counts(shelf)
    _sizes(shelf)
    _out_of_range(shelf)
    _ordinals(shelf)
    _signal(shelf)
    every_codec.add(shelf, "fast")
    return shelf.vectors


def _with(motion: Motion, *streams: bytes, **edits: Any) -> bytes:
    """The file of ``motion``, its groups' streams replaced; the values stay those hashed."""

    def replaced(made: Any) -> Any:
        ((header, old),) = made
        return [(header, [*streams, *old[len(streams) :]])]

    constants = codec_of([Constant()] * motion.signals[0].n_channels)
    return file_of(motion, codec=constants, segments=replaced, **edits)


def _zeros(n_channels: int, value: float = 0.0) -> Motion:
    return panel([[value / 100] * 4] * n_channels, (HUNDREDTHS,) * n_channels)


def _heads(shelf: Broken) -> None:
    """Of one or two channels of zeros, four rows."""
    one, two = _zeros(1), _zeros(2)
    cases: tuple[tuple[str, str, Motion, bytes], ...] = (
        ("kind-3", "A channel of kind 3.", one, b"\3"),
        ("constant-bit-6", "Bit 6 of a constant.", one, b"\x41"),
        ("constant-9-bytes", "A constant of 9 bytes.", one, b"\x25" + bytes(8) + b"\1"),
        ("constant-zero", "A constant 0 in a byte.", one, b"\5\0"),
        ("constant-long", "A byte 0 behind a constant's last.", _zeros(1, 1), b"\x09\2\0"),
        ("constant-cut", "The stream ends within a constant.", one, b"\x09\2"),
        ("constant-and-byte", "A byte behind channels without values.", one, ZERO + b"\0"),
        ("constant-and-state", "A state behind channels without values.", one, ZERO + STATE),
        ("channel-missing", "One head of two.", two, ZERO),
        ("stream-missing", "An empty stream of a group with channels.", one, b""),
        ("copy-bit-2", "Bit 2 of a copy.", two, ZERO + b"\6\0\0"),
        ("copy-of-no-group", "A copy of a group that there is not.", two, ZERO + b"\2\1\0"),
        ("copy-of-no-channel", "A copy of a channel beyond its group.", two, ZERO + b"\2\0\2"),
        ("copy-of-itself", "A copy of itself.", two, ZERO + b"\2\0\1"),
        ("copy-of-each-other", "Two channels that copy each other.", two, b"\2\0\1\2\0\0"),
        ("copy-varint", "A copy's group not in its shortest form.", two, ZERO + b"\2\x80\0\0"),
        ("copy-cut", "The stream ends within a copy.", two, ZERO + b"\2\0"),
    )
    for name, purpose, motion, data in cases:
        shelf.add(name, HEADING, purpose, _with(motion, data))
    three = panel([[0.0] * 4] * 3, (HUNDREDTHS,) * 3, (2, 1))
    data = _with(three, ZERO + b"\2\0\0", b"\2\0\1")
    shelf.add("copy-of-copy", HEADING, "A copy of a copy in another group.", data)


def _coded(shelf: Broken) -> None:
    """What a head may not say; a reader that does not look decodes the right values."""
    half = [v * 0.5 for v in range(-9, 10)]
    ones = [1.0, 1.5, 1.25, 1.0]
    cases: dict[str, tuple[str, Grid, Coded]] = {
        "form-16": ("A form of 16 digits", SIX, Coded(form=16)),
        "form-87": ("A form of base 2 with 23 digits", SINGLE, Coded(form=87)),
        "drop-of-plain": ("A drop of 20 bits from plain numbers", DOUBLE, Coded(PLAIN, 20)),
        "drop-of-binary32": ("A drop of 23 bits of 24", SINGLE, Coded(BINARY32, 23)),
        "drop-of-binary64": ("A drop of 52 bits of 53", DOUBLE, Coded(BINARY64, 52)),
        "top-of-decimal": ("A greatest class of 615", SIX, Coded(top=615, depth=308)),
        "top-of-binary32": ("A greatest class of 256", SINGLE, Coded(top=256, depth=160)),
        "depth": ("More classes below the greatest than there are", SINGLE, Coded(top=9, depth=10)),
        "depth-of-decimal": ("309 classes below the 308th", SIX, Coded(top=308, depth=309)),
        "classes-256": ("257 classes of 53 digits", DOUBLE, Coded(top=1100, depth=256)),
        "scale-173": ("A scale of 173", SIX, Coded(scale=173)),
        "taps-5": ("Five taps, the last of them 0", SIX, Coded(taps=(1, -1, 1, -1, 0))),
        "taps-15": ("Fifteen taps, eleven of them 0", SIX, Coded(taps=(1, -1, 1, -1, *[0] * 11))),
        "tap-512": ("A tap of 512", SIX, Coded(taps=(512,))),
        "tap-minus-512": ("A tap of -512", SIX, Coded(taps=(5, -512))),
    }
    for name, (purpose, grid, head) in cases.items():
        values = half
        if name in ("drop-of-binary32", "drop-of-binary64"):
            values = [2.0, 8.0, -2.0, 0.0, 0.5]
        if name == "depth":
            values = [0.0] * 4
        if name in ("classes-256", "depth-of-decimal"):
            values = ones
        motion = column(values, grid)
        shelf.add(name, HEADING, f"{purpose}.", file_of(motion, codec=codec_of([head])))
    for name, size in (("top", 1), ("depth", 3), ("scale", 4), ("tap", 5), ("state", 6)):

        def cut(data: bytes, size: int = size) -> bytes:
            return data[:size]

        motion, codec = column([1.5, 1.25, 1.5], SIX), codec_of([Coded(taps=(1,))])
        data = file_of(motion, codec=codec, segments=stream(0, cut))
        shelf.add(f"cut-before-{name}", HEADING, f"The stream ends before a {name}.", data)


def _units(shelf: Broken) -> None:
    zeros, motion = (0,) * 5, column([0.0] * 5, SINGLE)
    units = {"0": 0.0, "NaN": float("nan"), "tiny": 2.0**-201, "huge": 2.0**80 * (1 + 2.0**-52)}
    for name, unit in units.items():
        head = Coded(MULTIPLES, unit=unit, multiples=zeros)
        data = file_of(motion, codec=codec_of([head]))
        shelf.add(f"unit-{name}", HEADING, f"A unit of {unit!r}.", data)
    head = Coded(MULTIPLES, drop=1, unit=0.25, multiples=zeros)
    data = file_of(motion, codec=codec_of([head]))
    shelf.add("drop-of-multiples", HEADING, "A drop of 1 bit from multiples.", data)

    def cut(data: bytes) -> bytes:
        return data[:10]

    data = file_of(motion, codec=codec_of([replace(head, drop=0)]), segments=stream(0, cut))
    shelf.add("cut-in-unit", HEADING, "The stream ends within a unit.", data)


def _products(shelf: Broken) -> None:
    def refused(name: str, purpose: str, grid: Grid, **rest: Any) -> None:
        head = Coded(PRODUCTS, multiples=(0,) * 5, **{"unit": 0.25, "shifts": 1, **rest})
        data = file_of(column([0.0] * 5, grid), codec=codec_of([head]))
        shelf.add(f"products-{name}", HEADING, f"{purpose}.", data)

    refused("on-binary32", "Products on the grid BINARY32", SINGLE)
    refused("on-fixed", "Products on the grid FIXED", HUNDREDTHS)
    refused("drop", "A drop of 1 bit from products", SIX, drop=1)
    refused("shifts-0", "No shifts", SIX, shifts=0)
    refused("shifts-64", "64 shifts", SIX, shifts=64)
    refused("unit", "A unit of 0 of products", SIX, unit=0.0)


def _counts(shelf: Broken) -> None:
    base = Coded(COUNTS, law=Law(0.25, 0.5), multiples=(0,) * 5)

    def refused(
        name: str, purpose: str, head: Coded = base, value: float = 0.5, **rest: Any
    ) -> None:
        data = file_of(column([value] * 5, SINGLE), codec=codec_of([head]), **rest)
        shelf.add(f"counts-{name}", HEADING, f"{purpose}.", data)

    refused("drop", "A drop of 1 bit from counts", replace(base, drop=1))
    refused("unit", "A unit of 0 of counts", replace(base, law=Law(0.0, 0.5)))
    refused("parts-9", "Parts of 9: a bit that means nothing", replace(base, parts=9))
    for name, term in {"NaN": float("nan"), "huge": 2.0**80 * (1 + 2.0**-52)}.items():
        value = float(np.float32(term))
        refused(
            f"offset-{name}", f"An offset of {term!r}", replace(base, law=Law(0.25, term)), value
        )
        head = replace(base, law=Law(0.25, None, term))
        refused(f"shift-{name}", f"A shift of {term!r}", head, value)
    for what, size in (("before-parts", 11), ("in-shift", 27)):

        def cut(data: bytes, size: int = size) -> bytes:
            return data[:size]

        head = replace(base, law=Law(0.25, 0.5, 0.0))
        purpose = f"The stream ends {what.replace('-', ' ')} of a law"
        refused(f"cut-{what}", purpose, head, segments=stream(0, cut))


def _sizes(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("byte-0-between", "A byte 0 between words and bits.", _between(b"\0")),
        ("byte-between", "A byte 255 between words and bits.", _between(b"\xff")),
        ("word-between", "A word of 0 between words and bits.", _between(bytes(2))),
        ("bytes-between", "A thousand bytes between words and bits.", _between(bytes(1000))),
        ("byte-behind", "A byte 255 behind the bits.", plus(b"\xff")),
        ("byte-missing", "The last byte of the bits is missing.", lambda data: data[:-1]),
        ("half-missing", "Half of the bits are missing.", lambda data: data[: len(data) // 2]),
        ("values-missing", "A head without values.", lambda data: data[:2]),
        ("state-small", "A state of 2^16 - 1.", lambda data: data[:2] + b"\xff\xff\0\0" + data[6:]),
        ("state-0", "A state of 0.", lambda data: data[:2] + bytes(4) + data[6:]),
        ("another-state", "A bit of the state is flipped.", flip(2)),
    )
    for name, purpose, edit in cases:
        motion = column(wave(30), HUNDREDTHS)
        data = file_of(motion, codec=codec_of([Coded()]), segments=stream(0, edit))
        shelf.add(name, HEADING, purpose, data)
    head = b"\4\x08"  # kind, scale
    motion = column([0], WHOLE)
    spare = _with(motion, head + STATE + b"\x40")
    shelf.add("bit-spare", HEADING, "A bit that no number has is 1, of the last byte.", spare)
    more = _with(motion, head + b"\1\0\1\0" + b"\0")
    shelf.add("state-at-end", HEADING, "A state of 2^16 + 1 where no symbol is left.", more)


def _between(more: bytes) -> Edit:
    """Bytes between the words and the bits of one FIXED channel, whose misses are small."""

    def edit(data: bytes) -> bytes:
        motion = column(wave(30), HUNDREDTHS)
        ordinals = motion.signals[0].grids[0].ordinals(motion.signals[0].values)[0]
        records = _records(ordinals)
        n_bits = int(records[:, 2].sum()) + 6
        at = len(data) - (n_bits + 7) // 8
        return data[:at] + more + data[at:]

    return edit


def _records(ordinals: Any) -> Any:
    from tools.vectors.build import fast_clips

    _, _, choice, record = quick.loops()
    plan = fast_clips._plan(Coded(), HUNDREDTHS, ordinals[:, 0].tolist())[None]
    records = np.zeros((len(ordinals), record.RECORD_SIZE), np.int64)
    choice.record_columns(np.ascontiguousarray(ordinals.T), plan, quick.tables().powers, records)
    return records


def _out_of_range(shelf: Broken) -> None:
    """Values that say what the rules of decoding refuse."""
    plain = {
        "value-beyond": ("The value 2^44 of a plain channel", 2**44),
        "value-below": ("The value -2^44 - 1 of a plain channel", -(2**44) - 1),
        "first-beyond": ("A first value of 2^44", None),
    }
    for name, (purpose, ordinal) in plain.items():
        rows = [[2**44], [5]] if ordinal is None else [[5], [ordinal]]
        data = build_stream(rows, (WHOLE,), [Coded()])
        zeros = column([0] * 2, WHOLE)
        found = np.array(rows, np.int64)
        shelf.add(name, HEADING, f"{purpose}.", _with(zeros, data, CEND=rehash(found)))
    head = b"\4\x08"  # kind, scale
    motion = column([0], WHOLE)
    long = _with(motion, head + STATE + bytes(8) + b"\x3e")
    shelf.add("first-62-bits", HEADING, "A first value of 62 bits, all 0.", long)
    per_class = 900_000
    zero, one = column([0.0], SIX), per_class * 308 + 1
    data = build_stream([[one]], (SIX,), [Coded(top=308, depth=0)])
    assert data[1:4] == varint(308) + b"\0"
    data = build_stream([[one + per_class]], (SIX,), [Coded(top=308, depth=0)])
    edit = rehash(SIX.values(np.array([one + per_class])).reshape(1, 1))
    purpose = "A class one beyond the greatest, in a first row."
    shelf.add("class-beyond", HEADING, purpose, _with(zero, data, CEND=edit))
    data = build_stream([[one], [one + per_class]], (SIX,), [Coded(top=308, depth=0)])
    edit = rehash(SIX.values(np.array([one, one + per_class])).reshape(2, 1))
    purpose = "A class one beyond the greatest, in another row."
    motion = column([0.0, 0.0], SIX)
    shelf.add("class-beyond-later", HEADING, purpose, _with(motion, data, CEND=edit))
    _far(shelf)


def _far(shelf: Broken) -> None:
    """Numbers spelled as no encoder may, hashed as a reader takes them that overlooks it."""
    motion = column([0, 0], WHOLE)
    head = bytes((4, 28))  # kind; scale 128, so that four bits of a miss are raw
    cases = {
        "far-0": ("A miss of 0 bits, as symbol 48 says it.", (28, FAR, 4, 0), 8),
        "far-62": ("A miss of 62 + 4 bits, as symbol 48 says it.", (28, FAR + 62, 50, 0), 8),
    }
    for name, (purpose, record, value) in cases.items():
        records = np.array([(-1, 0, 0, 0, 0, 0), (*record, 0, 0)], np.int64)
        (data,) = quick.write(records, np.array([2], np.int64))
        edit = rehash(np.array([[0], [value]], np.int64))
        shelf.add(name, HEADING, purpose, _with(motion, head + data, CEND=edit))
    starts = quick.tables().frequencies[28 << 6 | 3] & 4095  # symbol 3 in this context
    state = (int(starts) + 1).to_bytes(4, "little")
    data = head + state + bytes(2) + bytes(2)  # a word; 6 + 5 bits
    edit = rehash(np.array([[0], [3 << 4]], np.int64))
    purpose = "A state below 2^16 from which the values come right."
    shelf.add("state-short", HEADING, purpose, _with(motion, data, CEND=edit))


def _ordinals(shelf: Broken) -> None:
    spec = f"{HEADING}; The grid structure"
    infinite, beyond = float("inf"), 2**51 / 100
    cases: dict[str, tuple[str, Grid, int, Coded, float | int]] = {
        "fixed": ("2^51", HUNDREDTHS, 2**51, Coded(PLAIN, 9), beyond),
        "text32": ("an infinity", Grid(GridKind.TEXT32), 0x7F800000, Coded(), infinite),
    }
    for name, (what, grid, ordinal, head, value) in cases.items():
        data = build_stream([[0], [ordinal]], (grid,), [head])
        values = np.array([[0], [value]], np.float64)
        purpose = f"An ordinal beyond a {grid.kind.name} grid, coded: {what}."
        made = _with(column([0, 0], grid), data, CEND=rehash(values))
        shelf.add(f"ordinal-of-{name}", spec, purpose, made)


def _signal(shelf: Broken) -> None:
    header = put(payloads.Clip, "signals.0.header", b"\1h")
    data = file_of(dance(), codec=codec_of(), CLIP=header)
    shelf.add("header", HEADING, "A header for fast, which has none.", data)

    def doubled(made: Any) -> Any:
        ((header, streams),) = made
        return [(header, [*streams, *streams])]

    twice = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    data = file_of(dance(), codec=codec_of(), CLIP=twice, segments=doubled)
    purpose = "Two resolutions of fast, which has one."
    shelf.add("resolutions", f"{HEADING}; Codecs", purpose, data)
