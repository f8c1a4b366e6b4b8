"""Invalid, one fault each: streams of ``lossless``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mcz.coding.ordinals.counts import Law
from mcz.coding.ordinals.streams import constant_head
from mcz.container import payloads
from mcz.motion import Motion
from mcz.numbers import Grid, GridKind
from mcz.schema import varint
from tools.vectors.build.edits import Edit, at, flip, plus, put, stream
from tools.vectors.build.files import Broken, Vector, file_of, rehash
from tools.vectors.build.lossless_clips import (
    BINARY32,
    BINARY64,
    COUNTS,
    DOUBLE,
    HEADING,
    MULTIPLES,
    PLAIN,
    PRODUCTS,
    SINGLE,
    SIX,
    WHOLE,
    Coded,
    Constant,
    build_stream,
    codec_of,
)
from tools.vectors.build.motions import HUNDREDTHS, column, dance, panel, wave
from tools.vectors.invalid.common import every_codec

ZERO = b"\1"  # a constant of no bytes


def vectors() -> Iterable[Vector]:
    shelf = Broken("invalid/lossless")
    _heads(shelf)
    _copies(shelf)
    _coded(shelf)
    _cut(shelf)
    _units(shelf)
    _products(shelf)
    _counts(shelf)
    _sizes(shelf)
    _out_of_range(shelf)
    _ordinals(shelf)
    _signal(shelf)
    every_codec.add(shelf, "lossless")
    return shelf.vectors


def _heads(shelf: Broken) -> None:
    """Of one or two channels of zeros, four rows."""
    one, two = _zeros(1), _zeros(2)
    cases: tuple[tuple[str, str, Motion, bytes], ...] = (
        ("kind-3", "A channel of kind 3.", one, b"\3"),
        ("constant-bit-6", "Bit 6 of a constant.", one, b"\x41"),
        ("constant-bit-7", "Bit 7 of a constant.", one, b"\x81"),
        ("constant-9-bytes", "A constant of 9 bytes.", one, b"\x25" + bytes(8) + b"\1"),
        ("constant-zero", "A constant 0 in a byte.", one, b"\5\0"),
        ("constant-long", "A byte 0 behind a constant's last.", _zeros(1, 1), b"\x09\2\0"),
        ("constant-cut", "The stream ends within a constant.", one, b"\x09\2"),
        ("constant-and-byte", "A byte behind channels without bits.", one, ZERO + b"\0"),
        ("channel-missing", "One head of two.", two, ZERO),
        ("stream-missing", "An empty stream of a group with channels.", one, b""),
    )
    for name, purpose, motion, data in cases:
        shelf.add(name, HEADING, purpose, _with(motion, data))


def _zeros(n_channels: int, value: float = 0.0) -> Motion:
    return panel([[value / 100] * 4] * n_channels, (HUNDREDTHS,) * n_channels)


def _with(motion: Motion, *streams: bytes, version: int = 0, **edits: Any) -> bytes:
    """The file of ``motion``, its groups' streams replaced; the values stay those hashed."""

    def replaced(made: Any) -> Any:
        ((header, old),) = made
        return [(header, [*streams, *old[len(streams) :]])]

    constants = codec_of([Constant()] * motion.signals[0].n_channels, version=version)
    return file_of(motion, codec=constants, segments=replaced, **edits)


def _copies(shelf: Broken) -> None:
    cases: tuple[tuple[str, str, bytes], ...] = (
        ("copy-bit-2", "Bit 2 of a copy.", ZERO + b"\6\0\0"),
        ("copy-bit-7", "Bit 7 of a copy.", ZERO + b"\x82\0\0"),
        ("copy-of-no-group", "A copy of a group that there is not.", ZERO + b"\2\1\0"),
        ("copy-of-no-channel", "A copy of a channel beyond its group.", ZERO + b"\2\0\2"),
        ("copy-of-itself", "A copy of itself.", ZERO + b"\2\0\1"),
        ("copy-of-each-other", "Two channels that copy each other.", b"\2\0\1\2\0\0"),
        ("copy-varint", "A copy's group not in its shortest form.", ZERO + b"\2\x80\0\0"),
        ("copy-cut", "The stream ends within a copy.", ZERO + b"\2\0"),
        ("copy-and-byte", "A byte behind a constant and its copy.", ZERO + b"\2\0\0\0"),
    )
    for name, purpose, data in cases:
        shelf.add(name, HEADING, purpose, _with(_zeros(2), data))
    three = panel([[0.0] * 4] * 3, (HUNDREDTHS,) * 3, (2, 1))
    data = _with(three, ZERO + b"\2\0\0", b"\2\0\1")
    shelf.add("copy-of-copy", HEADING, "A copy of a copy in another group.", data)


def _coded(shelf: Broken) -> None:
    """What a head may not say; a reader that does not look decodes the right values."""
    half = [v * 0.5 for v in range(-9, 10)]
    eight = (1, -1) * 4
    cases: dict[str, tuple[str, Grid, Coded]] = {
        "form-16": ("A form of 16 digits", SIX, Coded(form=16)),
        "form-87": ("A form of base 2 with 23 digits", SINGLE, Coded(form=87)),
        "form-116": ("A form of base 2 with 52 digits", DOUBLE, Coded(form=116)),
        "drop-of-plain": ("A drop of 20 bits from plain numbers", DOUBLE, Coded(PLAIN, 20)),
        "drop-of-decimal": ("A drop of 1 bit from base 10", Grid(GridKind.FIXED, 0), Coded(2, 1)),
        "drop-of-binary32": ("A drop of 23 bits of 24", SINGLE, Coded(BINARY32, 23)),
        "drop-of-binary64": ("A drop of 52 bits of 53", DOUBLE, Coded(BINARY64, 52)),
        "top-of-decimal": ("A greatest class of 615", SIX, Coded(top=615)),
        "top-of-binary32": ("A greatest class of 256", SINGLE, Coded(top=256)),
        "top-of-binary64": ("A greatest class of 2,048", DOUBLE, Coded(top=2048)),
        "scale-173": ("A scale of 173", SIX, Coded(scale=173)),
        "taps-9": ("Nine taps, the last of them 0", SIX, Coded(taps=(*eight, 0))),
        "taps-15": ("Fifteen taps, seven of them 0", SIX, Coded(taps=(*eight, *[0] * 7))),
        "tap-512": ("A tap of 512", SIX, Coded(taps=(512,))),
        "tap-minus-512": ("A tap of -512", SIX, Coded(taps=(5, -512))),
    }
    for name, (purpose, grid, head) in cases.items():
        values = [4.0, 2.0, 8.0, -2.0, -6.0, 0.0] if name == "drop-of-decimal" else half
        if name in ("drop-of-binary32", "drop-of-binary64"):
            values = [2.0, 8.0, -2.0, 0.0, 0.5]
        motion = column(values, grid)
        shelf.add(name, HEADING, f"{purpose}.", file_of(motion, codec=codec_of([head])))
    for form in (63, 64, 255):

        def claim(data: bytes, form: int = form) -> bytes:
            return at(1, bytes((form,)))(data)

        motion, plain = column(wave(9), HUNDREDTHS), codec_of([Coded(form=PLAIN)])
        data = file_of(motion, codec=plain, segments=stream(0, claim))
        shelf.add(f"form-{form}", HEADING, f"A form of {form} over the bits of form 0.", data)


def _cut(shelf: Broken) -> None:
    purpose = "A tap not in its shortest form."
    zero = codec_of([Coded(taps=(0,))])
    data = file_of(column(wave(9), HUNDREDTHS), codec=zero, segments=stream(0, _overlong))
    shelf.add("tap-varint", HEADING, purpose, data)
    for name, size in (("top", 1), ("scale", 3), ("tap", 4)):

        def cut(data: bytes, size: int = size) -> bytes:
            return data[:size]

        motion, codec = column([1.5, 1.25, 1.5], SIX), codec_of([Coded(taps=(1,))])
        data = file_of(motion, codec=codec, segments=stream(0, cut))
        shelf.add(f"cut-before-{name}", HEADING, f"The stream ends before a {name}.", data)


def _overlong(data: bytes) -> bytes:
    """The stream with its only tap, 0, in two bytes: behind kind and scale."""
    assert data[2] == 0
    return data[:2] + b"\x80\0" + data[3:]


def _units(shelf: Broken) -> None:
    units = {
        "0": 0.0,
        "minus": -0.25,
        "NaN": float("nan"),
        "infinite": float("inf"),
        "tiny": 2.0**-201,
        "huge": 2.0**80 * (1 + 2.0**-52),
    }
    zeros, motion = (0,) * 5, column([0.0] * 5, SINGLE)
    for name, unit in units.items():
        head = Coded(MULTIPLES, unit=unit, multiples=zeros)
        data = file_of(motion, codec=codec_of([head]))
        shelf.add(f"unit-{name}", HEADING, f"A unit of {unit!r}.", data)
    head = Coded(MULTIPLES, drop=1, unit=0.25, multiples=zeros)
    data = file_of(motion, codec=codec_of([head]))
    shelf.add("drop-of-multiples", HEADING, "A drop of 1 bit from multiples.", data)

    def cut(data: bytes) -> bytes:
        return data[:10]

    head = Coded(MULTIPLES, unit=0.25, multiples=zeros)
    data = file_of(motion, codec=codec_of([head]), segments=stream(0, cut))
    shelf.add("cut-in-unit", HEADING, "The stream ends within a unit.", data)
    head = replace(head, multiples=(0, 2**44))
    purpose = "2^44 units"
    _faulty(shelf, "multiple-beyond", purpose, SINGLE, [[0], [0]], head, [[0.0], [2.0**42]])


def _products(shelf: Broken) -> None:
    def refused(name: str, purpose: str, grid: Grid, version: int = 1, **rest: Any) -> None:
        head = Coded(PRODUCTS, multiples=(0,) * 5, **{"unit": 0.25, "shifts": 1, **rest})
        data = file_of(column([0.0] * 5, grid), codec=codec_of([head], version=version))
        shelf.add(f"products-{name}", HEADING, f"{purpose}.", data)

    refused("in-version-0", "Products in a signal of version 0", SIX, 0)
    refused("on-binary32", "Products on the grid BINARY32", SINGLE)
    refused("on-fixed", "Products on the grid FIXED", HUNDREDTHS)
    refused("drop", "A drop of 1 bit from products", SIX, drop=1)
    refused("shifts-0", "No shifts", SIX, shifts=0)
    refused("shifts-64", "64 shifts", SIX, shifts=64)
    refused("shifts-255", "255 shifts", SIX, shifts=255)
    refused("unit", "A unit of 0 of products", SIX, unit=0.0)


def _counts(shelf: Broken) -> None:
    offset, beyond = Law(0.25, 0.5), 2.0**80 * (1 + 2.0**-52)
    base = Coded(COUNTS, law=offset, multiples=(0,) * 5)

    def refused(
        name: str, purpose: str, head: Coded = base, value: float = 0.5, **rest: Any
    ) -> None:
        codec = codec_of([head], version=rest.pop("version", 1))
        data = file_of(column([value] * 5, SINGLE), codec=codec, **rest)
        shelf.add(f"counts-{name}", HEADING, f"{purpose}.", data)

    refused("in-version-0", "Counts in a signal of version 0", version=0)
    refused("drop", "A drop of 1 bit from counts", replace(base, drop=1))
    refused("unit", "A unit of 0 of counts", replace(base, law=Law(0.0, 0.5)))
    for parts in (8 | 1, 128 | 1):
        head = replace(base, parts=parts)
        refused(f"parts-{parts}", f"Parts of {parts}: a bit that means nothing", head)
    terms = {"NaN": float("nan"), "infinite": float("inf"), "huge": beyond, "low": -beyond}
    for name, term in terms.items():
        value = float(np.float32(term))
        head = replace(base, law=Law(0.25, term))
        refused(f"offset-{name}", f"An offset of {term!r}", head, value)
        head = replace(base, law=Law(0.25, 0.5, term))
        refused(f"shift-{name}", f"A shift of {term!r}", head, value)
    for what, size in (("before-parts", 11), ("in-offset", 15), ("in-shift", 27)):

        def cut(data: bytes, size: int = size) -> bytes:
            return data[:size]

        head = replace(base, law=Law(0.25, 0.5, 0.0))
        purpose = f"The stream ends {what.replace('-', ' ')} of a law"
        refused(f"cut-{what}", purpose, head, segments=stream(0, cut))
    head, zeros = Coded(COUNTS, law=offset, multiples=(0, 2**44)), [[0], [0]]
    _faulty(shelf, "counts-beyond", "2^44 counts", SINGLE, zeros, head, [[0.5], [2.0**42]])
    head = Coded(COUNTS, law=offset, multiples=(0, 0), rests=(0, 2**44))
    (half,) = SINGLE.ordinals(np.array([0.5]))[0].tolist()
    values = DOUBLE.values(np.array([[half], [half + 2**44]])).tolist()
    _faulty(shelf, "counts-rest-beyond", "A rest of 2^44", DOUBLE, zeros, head, values)


def _sizes(shelf: Broken) -> None:
    spec = "Entropy coding; Codec 128: lossless"
    cases: tuple[tuple[str, str, Edit], ...] = (
        ("byte-0-behind", "A byte 0 behind the bits, which changes none.", plus(b"\0")),
        ("byte-behind", "A byte 255 behind the bits.", plus(b"\xff")),
        ("bytes-behind", "A thousand bytes behind the bits.", plus(bytes(1000))),
        ("byte-missing", "The last byte of the bits is missing.", lambda data: data[:-1]),
        ("half-missing", "Half of the bits are missing.", lambda data: data[: len(data) // 2]),
        ("bits-missing", "A head without bits.", lambda data: data[:2]),
        ("another-value", "A bit of the first byte of bits is flipped.", flip(2)),
    )
    for name, purpose, edit in cases:
        motion = column(wave(30), HUNDREDTHS)
        data = file_of(motion, codec=codec_of([Coded()]), segments=stream(0, edit))
        shelf.add(name, spec, purpose, data)
    head, short = Coded(scale=28), column([0], WHOLE)
    data = file_of(short, codec=codec_of([head]), segments=stream(0, plus(b"\0")))
    purpose = "A byte 0 where the bits need none at all."
    shelf.add("byte-for-nothing", spec, purpose, data)


def _out_of_range(shelf: Broken) -> None:
    """Bits that say what the rules of decoding refuse; they end with the fault."""
    plain = {
        "value-beyond": ("The value 2^44 of a plain channel", 2**44),
        "value-below": ("The value -2^44 - 1 of a plain channel", -(2**44) - 1),
        "length-54": ("A residual of 54 bits", 2**54),
        "length-61": ("A residual of more than 60 bits", 2**62),
    }
    for name, (purpose, ordinal) in plain.items():
        _faulty(shelf, name, purpose, WHOLE, [[5], [ordinal]], Coded(), [[5], [ordinal]])
    purpose = "A class more than 4,095 beyond the expected one"
    narrow = Coded(form=65, top=0)  # one digit of base 2: the class is the ordinal
    data = build_stream([[0], [5000]], (DOUBLE,), [narrow], faulty=True)
    head = bytes((data[0], BINARY64, 0, 0, data[4]))
    motion = column([0.0, 0.0], DOUBLE)
    shelf.add("class-far", HEADING, f"{purpose}.", _with(motion, head + data[5:]))
    _below(shelf)


def _faulty(
    shelf: Broken,
    name: str,
    purpose: str,
    grid: Grid,
    ordinals: Sequence[Any],
    head: Coded,
    values: Sequence[Any],
) -> None:
    """``values``, which are hashed: what a reader takes that overlooks the fault."""
    data = build_stream(ordinals, (grid,), [head], faulty=True)
    zeros = column([0.0] * len(ordinals), grid)
    found = np.array(values, zeros.signals[0].values.dtype)
    made = _with(zeros, data, version=int(head.form == COUNTS), CEND=rehash(found))
    shelf.add(name, HEADING, f"{purpose}.", made)


def _below(shelf: Broken) -> None:
    """Good bits under a head for other numbers: the only row lies out of range.

    The hashes are of what a reader takes that overlooks it.
    """

    def add(name: str, purpose: str, data: bytes, magnitude: int) -> None:
        ordinal = np.array([magnitude], np.int64)
        edit = rehash(SIX.values(ordinal).reshape(1, 1))
        shelf.add(name, HEADING, purpose, _with(column([0.0], SIX), data, CEND=edit))

    per_class, top = 900_000, 100  # of six decimal digits
    head = b"\4" + varint(top) + b"\0"
    magnitude = (top + 1) * per_class + 1
    add("class-beyond", "A class one beyond the greatest.", head + _beyond(), magnitude)
    (ordinal,) = SIX.ordinals(np.array([1e-7]))[0].tolist()
    own = (ordinal - 1) // per_class
    data = build_stream([[ordinal]], (SIX,), [Coded(top=400)])
    assert data[1:3] == varint(400)
    data = data[:1] + varint(400 - own - 1) + data[3:]
    add("class-below", "A class below 0.", data, ordinal - (own + 1) * per_class)
    (ordinal,) = SIX.ordinals(np.array([9.99999]))[0].tolist()
    own, mantissa = (ordinal - 1) // per_class, (ordinal - 1) % per_class
    data = at(1, b"\3")(build_stream([[ordinal]], (SIX,), [Coded(form=6, scale=0)]))
    purpose = "A mantissa of four digits in form 3."
    add("mantissa-beyond", purpose, data, own * 900 + 1 + mantissa)


def _beyond() -> bytes:
    """The bits of one number, scale 0, whose class is one beyond the greatest of base 10.

    They are those of class 14 of base 2, which is within its 44: with nothing to predict from and
    the least mantissa the bits of both bases are alike.
    """
    return build_stream([[2]], (DOUBLE,), [Coded(form=66, top=31, scale=0)])[5:]


def _ordinals(shelf: Broken) -> None:
    spec = f"{HEADING}; The grid structure"
    infinite, beyond = float("inf"), 2**51 / 100
    cases: dict[str, tuple[str, Grid, int, Coded, float | int]] = {
        "fixed": ("2^51", HUNDREDTHS, 2**51, Coded(PLAIN, 9), beyond),
        "integer": ("2^53 + 1", WHOLE, 2**53 + 1, Coded(PLAIN, 11), 2**53 + 1),
        "text32": ("an infinity", Grid(GridKind.TEXT32), 0x7F800000, Coded(), infinite),
        "text64": ("an infinity", Grid(GridKind.TEXT64), 0x7FF0000000000000, Coded(), infinite),
        "vax-f": ("of 33 bits", Grid(GridKind.VAX_F), 2**32, Coded(BINARY64), 0.0),
    }
    for name, (what, grid, ordinal, head, value) in cases.items():
        data = build_stream([[0], [ordinal]], (grid,), [head])
        motion = column([0, 0], grid)
        values = np.array([[0], [value]], motion.signals[0].values.dtype)
        purpose = f"An ordinal beyond a {grid.kind.name} grid, coded: {what}."
        shelf.add(f"ordinal-of-{name}", spec, purpose, _with(motion, data, CEND=rehash(values)))
    data = constant_head(-1 - 2**51)
    values = np.full((2, 1), -beyond)
    purpose = "A constant ordinal beyond a FIXED grid."
    data = _with(column([0.0, 0.0], HUNDREDTHS), data, CEND=rehash(values))
    shelf.add("ordinal-of-constant", spec, purpose, data)
    minus = _with(column([0, 0], WHOLE), constant_head(-(2**53) - 1), CEND=_integers())
    purpose = "A constant ordinal below an INTEGER grid."
    shelf.add("ordinal-of-constant-minus", spec, purpose, minus)


def _integers() -> Edit:
    return rehash(np.full((2, 1), -(2**53) - 1, np.int64))


def _signal(shelf: Broken) -> None:
    header = put(payloads.Clip, "signals.0.header", b"\1h")
    data = file_of(dance(), codec=codec_of(), CLIP=header)
    shelf.add("header", HEADING, "A header for lossless, which has none.", data)

    def doubled(made: Any) -> Any:
        ((header, streams),) = made
        return [(header, [*streams, *streams])]

    twice = put(payloads.Clip, "signals.0.n_resolutions", b"\2")
    data = file_of(dance(), codec=codec_of(), CLIP=twice, segments=doubled)
    purpose = "Two resolutions of lossless, which has one."
    shelf.add("resolutions", f"{HEADING}; Codecs", purpose, data)
