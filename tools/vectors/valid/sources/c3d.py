"""C3D files of every byte order and encoding, and what lies around their data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from mcz.formats import c3d
from mcz.motion import Motion
from tests.formats.c3d_files import DEC, SGI, Made, real, real_of
from tools.vectors.build.c3d_files import C3D_SPEC, ORDERS, c3d_file, c3d_rotations, take_c3d
from tools.vectors.build.files import Whole, file_of
from tools.vectors.build.lossless_clips import codec_of
from tools.vectors.build.source_files import BOTH

WORDS = {"integers": 2, "floats": 4}


def add(shelf: Whole) -> None:
    _orders(shelf)
    _parts(shelf)
    _invalid_points(shelf)
    _odd_words(shelf)
    _around(shelf)
    _no_residuals(shelf)


def hold(shelf: Whole, name: str, purpose: str, file: Made, coded: bool = False) -> None:
    """Add the file, its clip coded by raw or by lossless."""
    source = file.build()
    motion = take_c3d(source, name)
    _check(motion, file)
    data = file_of(motion, codec=codec_of()) if coded else file_of(motion)
    sources = ((f"{name}.c3d", source),)
    shelf.hold(f"c3d-{name}", C3D_SPEC, purpose, data, motion, sources=sources, modes=BOTH)


def _check(motion: Motion, file: Made) -> None:
    """The coordinates of a file of floats are what another way of reading makes of its words."""
    if file.size == 2 or not file.points.size:
        return
    kind = ">u4" if file.processor == SGI else "<u4"
    data = file.points[:, :, :3].astype(kind).tobytes()
    values = [real_of(data[at : at + 4], file.processor) for at in range(0, len(data), 4)]
    found = motion.signals[0].values.ravel()
    assert np.array_equal(found, np.array(values), equal_nan=True)


def _orders(shelf: Whole) -> None:
    for order, processor in ORDERS.items():
        for word, size in WORDS.items():
            purpose = f"Points and analog samples, {order}, {word}."
            hold(shelf, f"{order}-{word}", purpose, c3d_file(processor=processor, size=size))
    file = c3d_file(9, 3, 2, 3)
    hold(shelf, "lossless", "A C3D file whose signals lossless codes.", file, coded=True)
    file = c3d_file(9, 3, 2, 3, DEC, scale=0.1)
    hold(shelf, "lossless-dec", "VAX floats in classes of lossless.", file, coded=True)


def _parts(shelf: Whole) -> None:
    hold(shelf, "points-only", "A C3D file without analog channels.", c3d_file(channels=0))
    purpose = "A C3D file without points: the motion has no channels."
    hold(shelf, "analog-only", purpose, c3d_file(n_points=0))
    hold(shelf, "no-frames", "A C3D file without a frame.", c3d_file(0))
    unsigned = {"ANALOG": {"FORMAT": (-1, (8,), b"UNSIGNED")}}
    file = c3d_file(size=2, parameters=unsigned)
    file.analog[1:3] = 65_535, 32_768
    hold(shelf, "unsigned", "Analog words of 0 to 65,535.", file)
    file = c3d_file(size=2)
    file.analog[1:3] = 65_535, 32_768
    file.points[2, 0] = 32_768, 65_535, 32_767, 0
    hold(shelf, "negative", "Integer words with a sign, to -32,768.", file)


def _invalid_points(shelf: Whole) -> None:
    for order, processor in ORDERS.items():
        file = c3d_file(processor=processor)
        minus = real(-1.0, processor)
        word = int.from_bytes(minus, "big" if processor == SGI else "little")
        file.points[1, 0] = 0, 0, 0, word
        file.points[3, :, 3] = word
        purpose = f"Points marked invalid by a residual of -1, {order}, floats."
        hold(shelf, f"invalid-points-{order}", purpose, file)
    file = c3d_file(size=2)
    file.points[1, 0] = 0, 0, 0, 65_535
    file.points[2, 1, 3] = 0x8003
    purpose = "Points marked invalid by residuals of -1 and -32,765, integers."
    hold(shelf, "invalid-points-integers", purpose, file, coded=True)


def _odd_words(shelf: Whole) -> None:
    payloads = (0x7F800001, 0xFFC00001, 0x7FC00000, 0xFFFFFFFF)
    for order in ("intel", "sgi"):
        file = c3d_file(processor=ORDERS[order])
        file.points[0, 0, :3], file.points[2, 1, 3] = payloads[:3], payloads[3]
        file.analog[3, 1] = payloads[:2]
        file.points[1, 1] = 0x80000000, 0x7F800000, 0xFF800000, 1
        purpose = f"NaN whose signs and payloads must come back, infinities, -0; {order}."
        for name, coded in (("", False), ("-lossless", True)):
            how = "lossless" if coded else "raw"
            hold(shelf, f"nan-{order}{name}", f"{purpose[:-1]}, {how}.", file, coded)
    file = c3d_file(processor=DEC)
    file.points[0, 0, :3] = 0x00008000, 0x12348000, 0x12340000
    file.points[1, 1, :3] = 0xFFFF7FFF, 0xFFFFFFFF, 0x00000080
    purpose = "Reserved operands of a VAX, a zero with a fraction, the ends of its range."
    hold(shelf, "vax-reserved", purpose, file)
    hold(shelf, "vax-reserved-lossless", f"{purpose[:-1]}; lossless.", file, coded=True)


def _around(shelf: Whole) -> None:
    file = c3d_file(first=40, tail=b"behind the data" + bytes(497))
    hold(shelf, "first-frame", "Frames from 40 on, bytes and zeros behind the data.", file)
    long: dict[str, dict[str, Any]] = {"TRIAL": {}, "POINT": {}}
    made_long = c3d_file(first=40, parameters=long)
    long["TRIAL"]["ACTUAL_START_FIELD"] = made_long.long(40)
    long["TRIAL"]["ACTUAL_END_FIELD"] = made_long.long(43)
    long["POINT"]["LONG_FRAMES"] = made_long.real(4.0)
    purpose = "Frame counts of every kind: words, pairs of words, a float."
    hold(shelf, "fields", purpose, made_long)
    labels = [b"R\xfccken", b"LASI"]
    purpose = "A label that is not UTF-8: its bytes are in the template alone."
    hold(shelf, "latin-1", purpose, c3d_file(labels=labels))
    hold(shelf, "rotations", "Rotations behind points and analog samples.", c3d_rotations())


def _no_residuals(shelf: Whole) -> None:
    """A clip without the signal of residuals, which were 0, and -1 where a point is invalid."""
    for name, size, minus in (("integers", 2, 0xFFFF), ("floats", 4, 0xBF800000)):
        file = c3d_file(size=size)
        file.points[:, :, 3] = 0
        file.points[1, 0, 3] = file.points[3, 1, 3] = minus
        source = file.build()
        whole = take_c3d(source, f"bare-{name}")
        kept = tuple(signal for signal in whole.signals if signal.name != "residuals")
        assert len(kept) == len(whole.signals) - 1
        motion = replace(whole, signals=kept)
        assert c3d.write(motion) == source
        purpose = f"No signal of residuals: 0 where a point is valid, -1 elsewhere, {name}."
        sources = ((f"bare-{name}.c3d", source),)
        shelf.hold(
            f"c3d-bare-{name}", C3D_SPEC, purpose, file_of(motion), motion,
            sources=sources, modes=BOTH,
        )  # fmt: skip
