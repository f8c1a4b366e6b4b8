"""The data section of a C3D file: its shape, read from the head, and its bytes, restored.

Header and parameters often disagree about the shape, and either may be wrong. The first of their
statements counts under which a declared number of frames fills the section; else the header's, and
the data tell how many frames there are.

SPEC.md, "Source reconstruction", is normative for what is restored. The section is made of the
signals; all else is kept as it is, but for the fields that count frames, which follow the motion if
it has other frames than the file had.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, MotionError, SourceError
from mcz.model.motion import Motion, Signal, Source
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Items, Values
from mcz.sources.c3d.layout import C3dLayout, FieldKind, parse_layout
from mcz.sources.c3d.parameters import (
    BLOCK,
    MAX_COUNT,
    OUTPUTS,
    ROTATION_WORDS,
    WORD_OF_FIRST,
    WORD_OF_LAST,
    WORD_OF_START,
    ByteOrder,
    Parameters,
)

MAX_EMPTY_SIZE = 2**16  # bytes of a frame, if the file has none and is smaller than that


@dataclass(frozen=True, slots=True)
class DataShape:
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


def find_shape(data: bytes, parameters: Parameters) -> DataShape:
    """The shape of the data section; raises SourceError if there is none."""
    order = parameters.order
    counts = list(_counts(data, parameters))
    shapes = list(_candidates(data, parameters))
    fitted = [(shape, *_fit(data, shape, counts, parameters)) for shape in shapes]
    shape, n_frames, _ = next((f for f in fitted if f[2]), fitted[0])
    if not shape.frame_size and n_frames > MAX_COUNT:
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
    if end + 1 >= begin and (end < MAX_COUNT or last is None):
        yield end + 1 - begin


def _candidates(data: bytes, parameters: Parameters) -> Iterator[DataShape]:
    """Every shape that is declared, the header's first."""
    order = parameters.order
    stated = (order.integer(data, 2), parameters.count("POINT", "USED"))
    points = dict.fromkeys(n for n in stated if n is not None and n <= MAX_COUNT)
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
        yield DataShape(start, word, n_points, n, subframes)


def _analogs(data: bytes, parameters: Parameters) -> Iterator[tuple[int, int]]:
    """Channels and samples a frame of the analog data that are declared."""
    samples, subframes = (parameters.order.integer(data, at) for at in (4, 18))
    used = parameters.count("ANALOG", "USED") or 0
    used = used if used <= MAX_COUNT else 0
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
        if 1 <= ratio <= MAX_COUNT:
            yield used, round(ratio)
    if samples:
        yield samples, 1


def _fit(
    data: bytes, shape: DataShape, counts: list[int], parameters: Parameters
) -> tuple[int, bool]:
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
        n_wrapped = there - (there - count) % (MAX_COUNT + 1)
        if n_wrapped > MAX_COUNT and size - n_wrapped * shape.frame_size <= BLOCK:
            return n_wrapped, True
    saturated = MAX_COUNT in counts or parameters.order.integer(data, WORD_OF_LAST) == MAX_COUNT
    if saturated and there > MAX_COUNT and size % shape.frame_size <= BLOCK:
        return there, True
    return n_frames or there, False


def _first(data: bytes, parameters: Parameters) -> int:
    """The number of the first frame: the header's, or TRIAL's if it does not fit a word."""
    first, trial = parameters.order.integer(data, WORD_OF_FIRST), parameters.first_frame
    if trial is not None and trial > MAX_COUNT and first in (MAX_COUNT, trial & MAX_COUNT):
        return trial
    return first


def _with_rotations(data: bytes, shape: DataShape, parameters: Parameters) -> DataShape:
    """The shape with the rotations that ROTATION declares, if all are present."""
    used, block, ratio = (
        parameters.count("ROTATION", name) for name in ("USED", "DATA_START", "RATIO")
    )
    if not used or not block or shape.word != 4 or not shape.n_frames:
        return shape
    if max(used, ratio or 1) > MAX_COUNT:
        return shape
    at = (block - 1) * BLOCK
    full = replace(shape, n_rotations=used, ratio=ratio or 1, rotations_at=at)
    if at < shape.stop or at + full.rotations_size * shape.n_frames > len(data):
        return shape
    return full


def _notes(
    data: bytes, shape: DataShape, counts: list[int], parameters: Parameters, order: ByteOrder
) -> Iterator[str]:
    """Notes on oddities of the file."""
    if shape.n_frames > MAX_COUNT:  # a word that cannot hold the count has its largest value
        counts = [count for count in counts if count > MAX_COUNT]
    if any(count != shape.n_frames for count in counts):
        declared = " or ".join(str(count) for count in dict.fromkeys(counts))
        yield f"{declared} frames are declared, {shape.n_frames} are there"
    words = (
        ("points", [order.integer(data, 2), parameters.count("POINT", "USED")], shape.n_points),
        ("analog samples a frame", [order.integer(data, 4)], shape.n_channels * shape.subframes),
        ("analog channels", [parameters.count("ANALOG", "USED")], shape.n_channels),
    )
    for noun, stated, actual in words:
        wrong = [number for number in stated if number is not None and number != actual]
        if wrong:
            yield f"{wrong[0]} {noun} are declared, {actual} are taken"
    scale, own = order.real(data, 12), parameters.number("POINT", "SCALE")
    if own is not None and not np.isclose(scale, own, rtol=1e-6, atol=0):
        yield f"the scale is {scale:.9g} in the header, {own:.9g} in POINT:SCALE"
    rate, own = order.real(data, 20), parameters.number("POINT", "RATE")
    if own is not None and not np.isclose(rate, own, rtol=1e-6, atol=0):
        yield f"the rate is {rate:.9g} in the header, {own:.9g} in POINT:RATE"


INTEGERS = (GridKind.SCALED, GridKind.INTEGER)


def restore_c3d(motion: Motion, source: Source) -> bytes:
    """The bytes that ``source`` and the signals of ``motion`` make.

    A value that its grid does not have is written as the nearest that a word can hold. Raises
    FormatError if the source does not belong to such a motion, MotionError for a range of
    frames that the file cannot have.
    """
    layout = parse_layout(source.format, source.template, source.detail)
    data = _section(motion, layout)
    rotations = b""
    if layout.n_rotations:
        signal = _signal(motion, "rotations", layout.n_rotations * ROTATION_WORDS, layout.ratio)
        rotations = _words(signal, layout).tobytes()
    if motion.n_frames == layout.n_frames:  # C3D-15
        rest = layout.gap + rotations + layout.tail
    else:
        if (layout.head[:1] or b"\0")[0] * BLOCK > len(layout.head):
            raise MotionError("the parameters follow the data, so only a whole clip can be written")
        rest = _padding(len(layout.head) + len(data)) + rotations + _padding(len(rotations))
        trimmed_tail = layout.tail.rstrip(b"\0")
        rest += trimmed_tail + _padding(len(trimmed_tail))
    return _head(motion, layout, len(data)) + data + rest


def _head(motion: Motion, layout: C3dLayout, size: int) -> bytes:
    """The bytes before the data section, whose size is given, with fields that fit the motion."""
    whole = motion.n_frames == layout.n_frames
    first = layout.first
    if motion.n_frames:
        first = 1 if motion.frame_numbers is None else int(motion.frame_numbers[0])
    if whole and first == layout.first:
        return layout.head
    head = bytearray(layout.head)
    rotations_at = len(head) + size + len(_padding(len(head) + size))
    for at, kind in layout.fields:
        if kind != FieldKind.ROTATIONS or not whole:
            value = field_bytes(layout.order, kind, first, motion.n_frames, rotations_at)
            head[at : at + kind.size] = value
    return bytes(head)


def _padding(size: int) -> bytes:
    """Zeros up to the next border of a block."""
    return bytes(-size % BLOCK)


def field_bytes(
    order: ByteOrder, kind: FieldKind, first: int, n_frames: int, rotations_at: int
) -> bytes:
    """The bytes of a field if ``n_frames`` frames from number ``first`` on are there."""
    last = first + n_frames - 1  # C3D-15
    match kind:
        case FieldKind.COUNT_FLOAT:
            return order.build_real(n_frames)
        case FieldKind.FIRST_LONG | FieldKind.LAST_LONG:
            number = min(max(0, first if kind == FieldKind.FIRST_LONG else last), 2**32 - 1)
            return order.build_integer(number & MAX_COUNT) + order.build_integer(number >> 16)
        case FieldKind.COUNT:
            number = n_frames
        case FieldKind.FIRST:
            number = first
        case FieldKind.LAST:
            number = last
        case FieldKind.ROTATIONS:
            number = rotations_at // BLOCK + 1
    return order.build_integer(min(max(0, number), MAX_COUNT))


def _section(motion: Motion, layout: C3dLayout) -> bytes:
    """The data section: for every frame the points, then the samples of analog channels."""
    n_frames, end = motion.n_frames, 4 * layout.n_points
    n_analog = layout.n_channels * layout.subframes
    words = np.empty((n_frames, end + n_analog), f"{layout.order.prefix}u{layout.word}")
    _fill_points(words, motion, layout)
    if n_analog:
        analog = _signal(motion, "analog", layout.n_channels, layout.subframes)
        samples = _words(analog, layout, layout.unsigned)
        words[:, end:] = samples.reshape(n_frames, n_analog)
    return words.tobytes()


def _fill_points(words: Items, motion: Motion, layout: C3dLayout) -> None:
    """The words of all points, which are the first of each row."""
    parts = _parts(motion, layout)
    if not layout.n_points:
        return
    residuals = _residuals(motion, layout, [signal for signal, _ in parts])
    words[:, 4 * layout.split.order + 3] = _words(residuals, layout)
    at = 0
    for signal, points in parts:
        if layout.order.grid.kind == GridKind.BINARY32 and layout.word == 4:
            signal = _with_gaps(signal, residuals.values[:, at : at + len(points)])
        positions = _words(signal, layout)
        for axis in range(3):
            words[:, 4 * points + axis] = positions[:, axis::3]
        at += len(points)


def _parts(motion: Motion, layout: C3dLayout) -> list[tuple[Signal, NDArray[np.int64]]]:
    """The signals of the points, checked, and the numbers of their points in the file."""
    split = layout.split
    parts = [(_check_signal(motion.signals[0], 3 * len(split.points), 1), split.points)]
    if len(split.outputs):
        parts.append((_signal(motion, OUTPUTS, 3 * len(split.outputs), 1), split.outputs))
    return parts


def _signal(motion: Motion, role: str, n_channels: int, per_frame: int) -> Signal:
    """The first signal of a role, checked; raises FormatError."""
    for signal in motion.signals_of(role):
        if not signal.of:
            return _check_signal(signal.as_stored(), n_channels, per_frame)
    raise FormatError(f"source template: it needs a signal of {role}, which the clip has not")


def _check_signal(signal: Signal, n_channels: int, per_frame: int) -> Signal:
    if (signal.n_channels, signal.samples_per_frame) != (n_channels, per_frame):  # C3D-14
        raise FormatError(
            f"source template: {n_channels} channels of {per_frame} samples a frame, but signal "
            f"{signal.name!r} has {signal.n_channels} of {signal.samples_per_frame}"
        )
    return signal


def _residuals(motion: Motion, layout: C3dLayout, parts: list[Signal]) -> Signal:
    """The residual words of the points of all ``parts``, one part after the other.

    If the motion has none, 0 for valid points and -1 for others.
    """
    if any(signal.of == 0 for signal in motion.signals):
        return _signal(motion, "residuals", layout.n_points, 1)
    shape = motion.n_frames, layout.n_points
    residuals = np.zeros(shape, np.int64)
    at = 0
    for signal in parts:
        n_points, valid = signal.n_channels // 3, valid_points(signal)
        if valid is not None:
            residuals[:, at : at + n_points][~valid] = -1
        at += n_points
    if layout.word == 2:
        return Signal(residuals, (Grid(GridKind.INTEGER),) * layout.n_points)
    return Signal(residuals.astype(np.float64), (layout.order.grid,) * layout.n_points)


def _with_gaps(points: Signal, residuals: Values) -> Signal:
    """The points, NaN if they are invalid and neither they nor their residuals say so.

    A lossy codec fills such gaps; without NaN the file would lose them.
    """
    valid = valid_points(points)
    if valid is None:
        return points
    values = points.values.reshape(*valid.shape, 3)  # either may be 0
    is_gap = ~valid & (residuals >= 0) & ~np.isnan(values).any(axis=2)
    if not is_gap.any():
        return points
    gapped = np.where(is_gap[:, :, None], np.nan, values)
    return replace(points, values=gapped.reshape(points.values.shape))


def valid_points(signal: Signal) -> NDArray[np.bool_] | None:
    """Mask of the valid points, (n_frames, n_points); None if all are valid."""
    if signal.mask is None:
        return None
    shape = len(signal.mask), signal.n_channels // 3, 3
    valid: NDArray[np.bool_] = np.asarray(signal.mask.reshape(shape).all(axis=2))
    return valid


def _words(signal: Signal, layout: C3dLayout, unsigned: bool = False) -> Items:
    """The words of a signal, (rows, channels), in the byte order of the file."""
    grids = (*signal.grids, *(grid for _, _, grid in signal.grid_changes))
    kinds = {grid.kind for grid in grids}
    allowed = INTEGERS if layout.word == 2 else (layout.order.grid.kind,)
    if not kinds <= set(allowed):  # C3D-14
        names = " or ".join(kind.name for kind in allowed)
        raise FormatError(f"source template: signal {signal.name!r} is not on a grid {names}")
    integral = signal.values.dtype == np.int64
    ordinals = signal.values.astype(np.int64) if integral else signal.to_ordinals()[0]  # C3D-15
    if layout.word == 4:
        return layout.order.grid.bits(ordinals).astype(f"{layout.order.prefix}u4")
    low, high = (0, 0xFFFF) if unsigned else (-0x8000, 0x7FFF)  # C3D-15
    return (np.clip(ordinals, low, high) & 0xFFFF).astype(f"{layout.order.prefix}u2")
