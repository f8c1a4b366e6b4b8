"""Shape of a C3D data section: header and parameters checked against its size.

Header and parameters often disagree, and either may be wrong. The first of their statements counts
under which a declared number of frames fills the section; else the header's, and the data say how
many frames there are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from mcz.errors import SourceError
from mcz.sources.c3d.parameters import BLOCK, WORD_OF_START, Order, Parameters

WORD_OF_FIRST, WORD_OF_LAST = 6, 8  # offsets of the frame numbers in the header
COUNTED = 65_535  # the most that a word can count
MAX_EMPTY_SIZE = 2**16  # bytes of a frame, if the file has none and is smaller than that
ROTATION_WORDS = 17  # floats of a rotation: a 4 x 4 matrix and its reliability


@dataclass(frozen=True, slots=True)
class Shape:
    """The data section: ``n_frames`` frames of points (4 words each), then samples of analog."""

    start: int
    word: int  # bytes: 2 for integers, 4 for floats
    n_points: int
    n_channels: int
    subframes: int  # samples of every analog channel in a frame
    n_frames: int = 0
    first: int = 1  # number of the first frame
    n_rotations: int = 0
    ratio: int = 1  # samples of every rotation in a frame
    rotations_at: int = 0
    notes: tuple[str, ...] = field(default=())

    @property
    def frame_words(self) -> int:
        return 4 * self.n_points + self.n_channels * self.subframes

    @property
    def frame_size(self) -> int:
        return self.word * self.frame_words

    @property
    def stop(self) -> int:
        return self.start + self.n_frames * self.frame_size

    @property
    def rotations_size(self) -> int:
        """Bytes of a frame of rotations."""
        return self.n_rotations * self.ratio * ROTATION_WORDS * 4


def find_shape(data: bytes, parameters: Parameters) -> Shape:
    """The shape of the data section; raises SourceError if there is none."""
    order = parameters.order
    counts = list(_counts(data, parameters))
    shapes = list(_candidates(data, parameters))
    fitted = [(shape, *_fit(data, shape, counts, parameters)) for shape in shapes]
    shape, n_frames, _ = next((f for f in fitted if f[2]), fitted[0])
    if not shape.frame_size and n_frames > COUNTED:
        raise SourceError(
            f"{n_frames} frames are declared, but they have no size", offset=WORD_OF_LAST
        )
    size = shape.frame_size
    if not n_frames and size > max(len(data), MAX_EMPTY_SIZE):
        raise SourceError(
            f"the data do not hold even one frame, which has {size} bytes", offset=shape.start
        )
    shape = replace(shape, n_frames=n_frames, first=_first(data, parameters))
    shape = _with_rotations(data, shape, parameters)
    return replace(shape, notes=tuple(_notes(data, shape, counts, parameters, order)))


def _counts(data: bytes, parameters: Parameters) -> Iterator[int]:
    """The numbers of frames that are declared, the widest fields first."""
    first, last = parameters.first_frame, parameters.last_frame
    if first is not None and last is not None and last + 1 >= first:
        yield last + 1 - first
    for name in ("LONG_FRAMES", "FRAMES"):
        count = parameters.count("POINT", name)
        if count is not None:
            yield count
    begin, end = (parameters.order.integer(data, at) for at in (WORD_OF_FIRST, WORD_OF_LAST))
    if end + 1 >= begin and (end < COUNTED or last is None):
        yield end + 1 - begin


def _candidates(data: bytes, parameters: Parameters) -> Iterator[Shape]:
    """Every shape that is declared, the header's first."""
    order = parameters.order
    stated = (order.integer(data, 2), parameters.count("POINT", "USED"))
    points = dict.fromkeys(n for n in stated if n is not None and n <= COUNTED)
    scales = (parameters.number("POINT", "SCALE"), order.real(data, 12))
    words = dict.fromkeys(4 if s < 0 else 2 for s in scales if s is not None and s == s)
    analogs = dict.fromkeys(_analogs(data, parameters))
    blocks = (order.integer(data, WORD_OF_START), parameters.count("POINT", "DATA_START") or 0)
    starts = [(block - 1) * BLOCK for block in dict.fromkeys(blocks) if block > 1]
    starts = [start for start in starts if start <= len(data)]
    if not starts and (any(points) or any(n for n, _ in analogs)):
        raise SourceError(
            f"the data begin at block {blocks[0]}, which is not in the file", offset=WORD_OF_START
        )
    starts = starts or [len(data)]
    for start, word, n_points, (n, subframes) in product(starts, words or (2, 4), points, analogs):
        yield Shape(start, word, n_points, n, subframes)


def _analogs(data: bytes, parameters: Parameters) -> Iterator[tuple[int, int]]:
    """Channels and samples a frame of the analog data that are declared."""
    samples, subframes = (parameters.order.integer(data, at) for at in (4, 18))
    used = parameters.count("ANALOG", "USED") or 0
    used = used if used <= COUNTED else 0
    if samples == 0:
        yield 0, 1
    elif subframes and samples % subframes == 0:
        yield samples // subframes, subframes
    if used and samples and samples % used == 0:
        yield used, samples // used
    if used:
        yield used, subframes or 1
        rate = parameters.number("POINT", "RATE") or parameters.order.real(data, 20)
        ratio = (parameters.number("ANALOG", "RATE") or 0.0) / (rate or 1.0)
        if 1 <= ratio <= COUNTED:
            yield used, round(ratio)
    if samples:
        yield samples, 1


def _fit(data: bytes, shape: Shape, counts: list[int], parameters: Parameters) -> tuple[int, bool]:
    """Number of frames, and True if it is declared and fills the section."""
    if not shape.frame_size:
        return (counts[0] if counts else 0), True
    stops = [len(data), parameters.start]
    if shape.word == 4 and parameters.count("ROTATION", "USED"):
        stops.append(((parameters.count("ROTATION", "DATA_START") or 0) - 1) * BLOCK)
    size = min(stop for stop in stops if stop >= shape.start) - shape.start
    there = size // shape.frame_size
    declared = [count for count in counts if count <= there]
    n_frames = max(declared, default=there)
    if declared and size - n_frames * shape.frame_size <= BLOCK:
        return n_frames, True
    for count in counts:  # a word that overflowed, or stays at its end
        n_wrapped = there - (there - count) % (COUNTED + 1)
        if n_wrapped > COUNTED and size - n_wrapped * shape.frame_size <= BLOCK:
            return n_wrapped, True
    saturated = COUNTED in counts or parameters.order.integer(data, WORD_OF_LAST) == COUNTED
    if saturated and there > COUNTED and size % shape.frame_size <= BLOCK:
        return there, True
    return n_frames or there, False


def _first(data: bytes, parameters: Parameters) -> int:
    """The number of the first frame: the header's, or TRIAL's if it does not fit a word."""
    first, trial = parameters.order.integer(data, WORD_OF_FIRST), parameters.first_frame
    if trial is not None and trial > COUNTED and first in (COUNTED, trial & COUNTED):
        return trial
    return first


def _with_rotations(data: bytes, shape: Shape, parameters: Parameters) -> Shape:
    """The shape with the rotations that ROTATION declares, if all of them are there."""
    used, block, ratio = (
        parameters.count("ROTATION", name) for name in ("USED", "DATA_START", "RATIO")
    )
    if not used or not block or shape.word != 4 or not shape.n_frames:
        return shape
    if max(used, ratio or 1) > COUNTED:
        return shape
    at = (block - 1) * BLOCK
    full = replace(shape, n_rotations=used, ratio=ratio or 1, rotations_at=at)
    if at < shape.stop or at + full.rotations_size * shape.n_frames > len(data):
        return shape
    return full


def _notes(
    data: bytes, shape: Shape, counts: list[int], parameters: Parameters, order: Order
) -> Iterator[str]:
    """Notes on oddities of the file."""
    if shape.n_frames > COUNTED:  # a word that stays at its end says what it can
        counts = [count for count in counts if count > COUNTED]
    if any(count != shape.n_frames for count in counts):
        declared = " or ".join(str(count) for count in dict.fromkeys(counts))
        yield f"{declared} frames are declared, {shape.n_frames} are there"
    words = (
        ("points", [order.integer(data, 2), parameters.count("POINT", "USED")], shape.n_points),
        ("analog samples a frame", [order.integer(data, 4)], shape.n_channels * shape.subframes),
        ("analog channels", [parameters.count("ANALOG", "USED")], shape.n_channels),
    )
    for what, stated, actual in words:
        wrong = [number for number in stated if number is not None and number != actual]
        if wrong:
            yield f"{wrong[0]} {what} are declared, {actual} are taken"
    scale, own = order.real(data, 12), parameters.number("POINT", "SCALE")
    if own is not None and not np.isclose(scale, own, rtol=1e-6, atol=0):
        yield f"the scale is {scale:.9g} in the header, {own:.9g} in POINT:SCALE"
    rate, own = order.real(data, 20), parameters.number("POINT", "RATE")
    if own is not None and not np.isclose(rate, own, rtol=1e-6, atol=0):
        yield f"the rate is {rate:.9g} in the header, {own:.9g} in POINT:RATE"
