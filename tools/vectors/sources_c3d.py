"""Valid: C3D files of every byte order and encoding, and what lies around their data."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.formats import c3d
from mcz.motion import Motion
from tests.formats.c3d_files import DEC, INTEL, SGI, Made, real, real_of
from tools.vectors.coded import codec_of
from tools.vectors.craft import Vector, Whole, file_of
from tools.vectors.sources import BOTH, HEADING, called

SPEC = f"{HEADING}; Template and detail of C3D; The bytes of C3D"
ORDERS = {"intel": INTEL, "dec": DEC, "sgi": SGI}
WORDS = {"integers": 2, "floats": 4}


def vectors() -> Iterable[Vector]:
    shelf = Whole("valid/sources")
    _orders(shelf)
    _parts(shelf)
    _invalid_points(shelf)
    _odd_words(shelf)
    _around(shelf)
    return shelf.vectors


def words(shape: tuple[int, ...], processor: int, size: int, seed: int = 0) -> NDArray[np.uint32]:
    """Counted numbers: words of integers, or floats with a fraction."""
    counted = [(seed + k * k * 7) % 997 for k in range(int(np.prod(shape)))]
    if size == 2:
        return np.array(counted, np.uint32).reshape(shape)
    kind = ">u4" if processor == SGI else "<u4"
    data = b"".join(real(n / 4 + 0.125, processor) for n in counted)
    return np.frombuffer(data, kind).astype(np.uint32).reshape(shape)


def made(
    n_frames: int = 4,
    n_points: int = 2,
    channels: int = 2,
    subframes: int = 2,
    processor: int = INTEL,
    size: int = 4,
    **more: Any,
) -> Made:
    """A file of counted words, all points valid."""
    points = words((n_frames, n_points, 4), processor, size)
    analog = words((n_frames, subframes, channels), processor, size, 5)
    return Made(points, analog, processor=processor, size=size, **more)


def hold(shelf: Whole, name: str, purpose: str, file: Made, coded: bool = False) -> None:
    """Add the file, its clip coded by raw or by codec 1."""
    source = file.build()
    motion = take(source, name)
    _check(motion, file)
    data = file_of(motion, codec=codec_of()) if coded else file_of(motion)
    sources = ((f"{name}.c3d", source),)
    shelf.hold(f"c3d-{name}", SPEC, purpose, data, motion, sources=sources, modes=BOTH)


def take(source: bytes, name: str) -> Motion:
    """The motion in a C3D file, its source called after it; it must come back."""
    motion = called(c3d.read(source, name), f"{name}.c3d")
    assert c3d.write(motion) == source, name
    return motion


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
            hold(shelf, f"{order}-{word}", purpose, made(processor=processor, size=size))
    file = made(9, 3, 2, 3)
    hold(shelf, "lossless", "A C3D file whose signals codec 1 codes.", file, coded=True)
    file = made(9, 3, 2, 3, DEC, scale=0.1)
    hold(shelf, "lossless-dec", "VAX floats in classes of codec 1.", file, coded=True)


def _parts(shelf: Whole) -> None:
    hold(shelf, "points-only", "A C3D file without analog channels.", made(channels=0))
    purpose = "A C3D file without points: the motion has no channels."
    hold(shelf, "analog-only", purpose, made(n_points=0))
    hold(shelf, "no-frames", "A C3D file without a frame.", made(0))
    unsigned = {"ANALOG": {"FORMAT": (-1, (8,), b"UNSIGNED")}}
    file = made(size=2, parameters=unsigned)
    file.analog[1:3] = 65_535, 32_768
    hold(shelf, "unsigned", "Analog words of 0 to 65,535.", file)
    file = made(size=2)
    file.analog[1:3] = 65_535, 32_768
    file.points[2, 0] = 32_768, 65_535, 32_767, 0
    hold(shelf, "negative", "Integer words with a sign, to -32,768.", file)


def _invalid_points(shelf: Whole) -> None:
    for order, processor in ORDERS.items():
        file = made(processor=processor)
        minus = real(-1.0, processor)
        word = int.from_bytes(minus, "big" if processor == SGI else "little")
        file.points[1, 0] = 0, 0, 0, word
        file.points[3, :, 3] = word
        purpose = f"Points marked invalid by a residual of -1, {order}, floats."
        hold(shelf, f"invalid-points-{order}", purpose, file)
    file = made(size=2)
    file.points[1, 0] = 0, 0, 0, 65_535
    file.points[2, 1, 3] = 0x8003
    purpose = "Points marked invalid by residuals of -1 and -32,765, integers."
    hold(shelf, "invalid-points-integers", purpose, file, coded=True)


def _odd_words(shelf: Whole) -> None:
    payloads = (0x7F800001, 0xFFC00001, 0x7FC00000, 0xFFFFFFFF)
    for order in ("intel", "sgi"):
        file = made(processor=ORDERS[order])
        file.points[0, 0, :3], file.points[2, 1, 3] = payloads[:3], payloads[3]
        file.analog[3, 1] = payloads[:2]
        file.points[1, 1] = 0x80000000, 0x7F800000, 0xFF800000, 1
        purpose = f"NaN whose signs and payloads must come back, infinities, -0; {order}."
        for name, coded in (("", False), ("-lossless", True)):
            how = "codec 1" if coded else "raw"
            hold(shelf, f"nan-{order}{name}", f"{purpose[:-1]}, {how}.", file, coded)
    file = made(processor=DEC)
    file.points[0, 0, :3] = 0x00008000, 0x12348000, 0x12340000
    file.points[1, 1, :3] = 0xFFFF7FFF, 0xFFFFFFFF, 0x00000080
    purpose = "Reserved operands of a VAX, a zero with a fraction, the ends of its range."
    hold(shelf, "vax-reserved", purpose, file)
    hold(shelf, "vax-reserved-lossless", f"{purpose[:-1]}; codec 1.", file, coded=True)


def _around(shelf: Whole) -> None:
    file = made(first=40, tail=b"behind the data" + bytes(497))
    hold(shelf, "first-frame", "Frames from 40 on, bytes and zeros behind the data.", file)
    long: dict[str, dict[str, Any]] = {"TRIAL": {}, "POINT": {}}
    made_long = made(first=40, parameters=long)
    long["TRIAL"]["ACTUAL_START_FIELD"] = made_long.long(40)
    long["TRIAL"]["ACTUAL_END_FIELD"] = made_long.long(43)
    long["POINT"]["LONG_FRAMES"] = made_long.real(4.0)
    purpose = "Frame counts of every kind: words, pairs of words, a float."
    hold(shelf, "fields", purpose, made_long)
    labels = [b"R\xfccken", b"LASI"]
    purpose = "A label that is not UTF-8: its bytes are in the template alone."
    hold(shelf, "latin-1", purpose, made(labels=labels))
    hold(shelf, "rotations", "Rotations behind points and analog samples.", _rotations())


def _rotations() -> Made:
    """Two frames of one rotation at 2 samples a frame, in the block behind the data."""
    file = made(2)
    rotation = {
        "USED": file.number(1),
        "RATIO": file.number(2),
        "DATA_START": file.number(0),
        "LABELS": file.texts([b"pelvis"]),
    }
    file.parameters = {"ROTATION": rotation}
    size = len(file.build())
    start = -(-size // 512)
    rotation["DATA_START"] = file.number(start + 1)
    matrices = [float(k * k % 19) / 8 for k in range(2 * 2 * 17)]
    file.tail = bytes(512 * start - size) + struct.pack(f"<{len(matrices)}f", *matrices)
    return file
