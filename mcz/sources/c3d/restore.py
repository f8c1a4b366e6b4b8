"""Signals, template and detail -> the bytes of a C3D file.

SPEC.md, "Source reconstruction", is normative. The data section is made of the signals; all else is
kept as it is, but for the fields that count frames, which follow the motion if it has other
frames than the file had.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcz.errors import FormatError, MotionError
from mcz.model.motion import Motion, Signal, Source
from mcz.model.numbers import Grid, GridKind
from mcz.model.types import Items, Values
from mcz.sources.c3d.layout import Kind, Layout, parse_layout
from mcz.sources.c3d.parameters import BLOCK, OUTPUTS, Order
from mcz.sources.c3d.shape import COUNTED, ROTATION_WORDS

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


def _head(motion: Motion, layout: Layout, size: int) -> bytes:
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
        if kind != Kind.ROTATIONS or not whole:
            value = field_bytes(layout.order, kind, first, motion.n_frames, rotations_at)
            head[at : at + kind.size] = value
    return bytes(head)


def _padding(size: int) -> bytes:
    """Zeros up to the next border of a block."""
    return bytes(-size % BLOCK)


def field_bytes(order: Order, kind: Kind, first: int, n_frames: int, rotations_at: int) -> bytes:
    """The bytes of a field if ``n_frames`` frames from number ``first`` on are there."""
    last = first + n_frames - 1  # C3D-15
    match kind:
        case Kind.COUNT_FLOAT:
            return order.build_real(n_frames)
        case Kind.FIRST_LONG | Kind.LAST_LONG:
            number = min(max(0, first if kind == Kind.FIRST_LONG else last), 2**32 - 1)
            return order.build_integer(number & COUNTED) + order.build_integer(number >> 16)
        case Kind.COUNT:
            number = n_frames
        case Kind.FIRST:
            number = first
        case Kind.LAST:
            number = last
        case Kind.ROTATIONS:
            number = rotations_at // BLOCK + 1
    return order.build_integer(min(max(0, number), COUNTED))


def _section(motion: Motion, layout: Layout) -> bytes:
    """The data section: of every frame the points, then the samples of the analog channels."""
    n_frames, end = motion.n_frames, 4 * layout.n_points
    n_analog = layout.n_channels * layout.subframes
    words = np.empty((n_frames, end + n_analog), f"{layout.order.prefix}u{layout.word}")
    _fill_points(words, motion, layout)
    if n_analog:
        analog = _signal(motion, "analog", layout.n_channels, layout.subframes)
        samples = _words(analog, layout, layout.unsigned)
        words[:, end:] = samples.reshape(n_frames, n_analog)
    return words.tobytes()


def _fill_points(words: Items, motion: Motion, layout: Layout) -> None:
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


def _parts(motion: Motion, layout: Layout) -> list[tuple[Signal, NDArray[np.int64]]]:
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


def _residuals(motion: Motion, layout: Layout, parts: list[Signal]) -> Signal:
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

    A lossy codec fills such gaps, which the file would then no longer have.
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


def _words(signal: Signal, layout: Layout, unsigned: bool = False) -> Items:
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
