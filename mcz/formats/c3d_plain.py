"""A motion that did not come from C3D, laid out as a plain C3D file.

Intel byte order, floats; integers where all coordinates are multiples of one scale and all analog
samples are 16-bit integers. The parameter section holds POINT, TRIAL, ANALOG and FORCE_PLATFORM.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from mcz.errors import MotionError
from mcz.formats.c3d_layout import Kind, Layout
from mcz.formats.c3d_parameters import BLOCK, FLOAT, INTEGER, INTEL, MAX_BLOCKS, TEXT, Order
from mcz.formats.c3d_restore import field_bytes, valid_points
from mcz.formats.c3d_shape import COUNTED, WORD_OF_FIRST, WORD_OF_LAST
from mcz.motion import POSITION_KINDS, Motion, Signal, Source
from mcz.numbers import Grid, GridKind

UNITS = {0.1: "mm", 1.0: "cm", 100.0: "m", 2.54: "in"}
KNOWN = ("residuals", "analog")  # signals beside the points
EVENTS_KEY = 12_345  # label and range data are of the kind that C3D has today
LABELS_PER_PARAMETER = 255
LABELS_SIZE = 30_000  # bytes of a parameter of labels; its length must fit 15 bits
MAX_LABEL = 255
FLOATS = Grid(GridKind.BINARY32)


def plain(motion: Motion) -> Motion:
    """``motion`` on the grids of a C3D file, with the source of a plain one.

    Raises MotionError for joints that are no markers, signals other than residuals and analog,
    and whatever is too much for C3D.
    """
    for joint in motion.skeleton.joints:
        if joint.parent >= 0 or tuple(c.kind for c in joint.channels) != POSITION_KINDS:
            raise MotionError(f"C3D has markers only, and joint {joint.name!r} is none")
    others = {signal.name: signal for signal in motion.signals[1:]}
    if len(others) < len(motion.signals) - 1 or not set(others) <= set(KNOWN):
        raise MotionError(f"C3D has no place for all of the signals {', '.join(others)}")
    points, analog = motion.signals[0], others.get("analog")
    residuals = others.get("residuals")
    n_points, n_channels = motion.skeleton.n_joints, analog.n_channels if analog else 0
    subframes = analog.samples_per_frame if analog and n_channels else 1
    if max(n_points, n_channels * subframes) > COUNTED:
        raise MotionError(f"C3D has at most {COUNTED} points and analog samples a frame")
    if residuals is not None and residuals.n_channels != n_points:
        raise MotionError(f"{residuals.n_channels} residuals for {n_points} points")
    scale = _scale(points, [signal for signal in (residuals, analog) if signal])
    unsigned = scale is not None and analog is not None and _range(analog)[1] > 0x7FFF
    grids = (Grid(GridKind.SCALED, scale=scale), Grid(GridKind.INTEGER)) if scale else (FLOATS,) * 2
    if residuals is None:
        valid = valid_points(_without_nan(points))
        words = np.zeros((motion.n_frames, n_points))
        if valid is not None:
            words[~valid] = -1.0
        residuals = Signal(words, (FLOATS,) * n_points, "residuals")
    signals = [_on(points, grids[0])]
    signals += [_on(signal, grids[1]) for signal in (residuals, analog) if signal is not None]
    layout = _layout(motion, scale, analog, (n_channels, subframes), unsigned)
    template, detail = layout.build()
    return replace(motion, signals=tuple(signals), source=Source("c3d", template, detail))


def _scale(points: Signal, others: Iterable[Signal]) -> float | None:
    """The scale of a file of integers, None where floats are needed."""
    grids = set(points.grids)
    if len(grids) != 1 or points.grid_changes or points.grids[0].kind != GridKind.SCALED:
        return None
    scale = points.grids[0].scale
    ordinals, exact = points.to_ordinals()
    low, high = ordinals.min(initial=0), ordinals.max(initial=0)
    if not exact.all() or low < -0x8000 or high > 0x7FFF or scale != np.float32(scale):
        return None
    for signal in others:
        if signal.values.dtype != np.int64 and signal.n_channels:
            return None
        low, high = _range(signal)
        if low < -0x8000 or high > (0xFFFF if low >= 0 and signal.name == "analog" else 0x7FFF):
            return None
    return scale


def _range(signal: Signal) -> tuple[int, int]:
    return int(signal.values.min(initial=0)), int(signal.values.max(initial=0))


def _without_nan(points: Signal) -> Signal:
    """The points, with a mask that leaves out NaN, too."""
    nan = np.isnan(points.values)
    if not nan.any():
        return points
    return replace(points, mask=~nan if points.mask is None else points.mask & ~nan)


def _on(signal: Signal, grid: Grid) -> Signal:
    """The signal on another grid; raises MotionError where that has no number nearby."""
    if all(own == grid for own in signal.grids) and not signal.grid_changes:
        return signal
    ordinals, _ = grid.ordinals(signal.values.astype(np.float64))
    values = ordinals if grid.kind == GridKind.INTEGER else grid.values(ordinals)
    if (np.isinf(values) & np.isfinite(signal.values)).any():
        raise MotionError(f"signal {signal.name!r}: a value is too large for a binary32")
    return Signal(
        values,
        (grid,) * signal.n_channels,
        signal.name,
        signal.samples_per_frame,
        signal.mask,
        channels=signal.channels,
    )


def _layout(
    motion: Motion,
    scale: float | None,
    analog: Signal | None,
    shape: tuple[int, int],
    unsigned: bool,
) -> Layout:
    """The layout of the file: header, parameter section, fields."""
    order, n_points = Order(INTEL), motion.skeleton.n_joints
    n_channels, subframes = shape
    first = 1 if motion.frame_numbers is None or not motion.n_frames else motion.frame_numbers[0]
    section = _section(motion, -1.0 if scale is None else scale, analog, shape, unsigned)
    start = BLOCK + len(section.data)
    header = bytearray(BLOCK)
    rate = float(motion.frame_rate or 0)
    struct.pack_into("<BBHHHHHf", header, 0, 2, 0x50, n_points, n_channels * subframes, 0, 0, 0,
                     -1.0 if scale is None else scale)  # fmt: skip
    struct.pack_into("<HHf", header, 16, start // BLOCK + 1, subframes, rate)
    struct.pack_into("<H", header, 298, EVENTS_KEY)
    struct.pack_into("<H", section.data, section.data_start, start // BLOCK + 1)
    fields = [(WORD_OF_FIRST, Kind.FIRST), (WORD_OF_LAST, Kind.LAST)]
    fields += [(BLOCK + at, kind) for at, kind in section.fields]
    head = header + section.data
    for at, kind in fields:
        head[at : at + kind.size] = field_bytes(order, kind, int(first), motion.n_frames, 0)
    return Layout(
        order,
        4 if scale is None else 2,
        n_points,
        n_channels,
        subframes,
        unsigned,
        motion.n_frames,
        max(0, int(first)),
        bytes(head),
        tuple(fields),
    )


@dataclass
class Section:
    """A parameter section while it is written; offsets are counted from its start."""

    data: bytearray = field(default_factory=lambda: bytearray((1, 0x50, 0, INTEL)))
    fields: list[tuple[int, Kind]] = field(default_factory=list)
    data_start: int = 0
    n_groups: int = 0

    def group(self, name: str) -> None:
        self.n_groups += 1
        self.data += struct.pack("bb", len(name), -self.n_groups) + name.encode()
        self.data += struct.pack("<HB", 3, 0)

    def add(self, name: str, kind: int, dims: Sequence[int], data: bytes) -> int:
        """Add a parameter to the last group; return where its data lie."""
        self.data += struct.pack("bb", len(name), self.n_groups) + name.encode()
        self.data += struct.pack("<HbB", 5 + len(dims) + len(data), kind, len(dims)) + bytes(dims)
        at = len(self.data)
        self.data += data + b"\0"  # an empty description
        return at

    def number(self, name: str, value: float | Fraction) -> int:
        if isinstance(value, int):
            return self.add(name, INTEGER, (), struct.pack("<H", value))
        return self.add(name, FLOAT, (), struct.pack("<f", float(value)))

    def text(self, name: str, text: str) -> None:
        data = text.encode()
        self.add(name, TEXT, (len(data),), data)

    def texts(self, name: str, texts: Sequence[str]) -> None:
        """Add texts, in as many parameters (NAME, NAME2, ...) as they need."""
        coded = [text.encode() for text in texts]
        width = max(map(len, coded), default=0)
        if width > MAX_LABEL:
            raise MotionError(f"a name of {width} bytes is too long for C3D, which allows 255")
        step = min(LABELS_PER_PARAMETER, LABELS_SIZE // max(1, width))
        for number, k in enumerate(range(0, max(1, len(coded)), step), 1):
            part = coded[k : k + step]
            padded = b"".join(text.ljust(width) for text in part)
            self.add(name if number == 1 else f"{name}{number}", TEXT, (width, len(part)), padded)

    def each(self, name: str, n: int, kind: int, item: bytes) -> None:
        """Add ``n`` equal numbers, in as many parameters as they need."""
        for number, k in enumerate(range(0, max(1, n), LABELS_PER_PARAMETER), 1):
            part = min(LABELS_PER_PARAMETER, n - k)
            self.add(name if number == 1 else f"{name}{number}", kind, (part,), item * part)

    def close(self) -> None:
        """End the section at the border of a block; raises MotionError where it is too long."""
        self.data += b"\0\0"
        self.data += bytes(-len(self.data) % BLOCK)
        if len(self.data) > MAX_BLOCKS * BLOCK:
            raise MotionError(f"names of {len(self.data)} bytes are too much for a C3D file")
        self.data[2] = len(self.data) // BLOCK


def _section(
    motion: Motion, scale: float, analog: Signal | None, shape: tuple[int, int], unsigned: bool
) -> Section:
    section = Section()
    n_channels, subframes = shape
    rate = Fraction(motion.frame_rate or 0)
    section.group("POINT")
    section.number("USED", motion.skeleton.n_joints)
    section.fields.append((section.number("FRAMES", 0), Kind.COUNT))
    section.data_start = section.number("DATA_START", 0)
    section.number("SCALE", scale)
    section.number("RATE", rate)
    names = [joint.name for joint in motion.skeleton.joints]
    section.texts("LABELS", names)
    section.texts("DESCRIPTIONS", [""] * len(names))
    section.text("UNITS", UNITS.get(motion.skeleton.unit_cm or 0.0, ""))
    section.group("TRIAL")
    for name, kind in (
        ("ACTUAL_START_FIELD", Kind.FIRST_LONG),
        ("ACTUAL_END_FIELD", Kind.LAST_LONG),
    ):
        section.fields.append((section.add(name, INTEGER, (2,), bytes(4)), kind))
    section.group("ANALOG")
    channels = analog.channels if analog and analog.channels else ()
    section.number("USED", n_channels)
    section.texts("LABELS", [channel.label for channel in channels])
    section.texts("DESCRIPTIONS", [""] * n_channels)
    section.texts("UNITS", [channel.unit for channel in channels])
    section.number("GEN_SCALE", 1.0)
    section.each("SCALE", n_channels, FLOAT, struct.pack("<f", 1.0))
    section.each("OFFSET", n_channels, INTEGER, bytes(2))
    section.number("RATE", rate * subframes)
    section.text("FORMAT", "UNSIGNED" if unsigned else "SIGNED")
    section.number("BITS", 16)
    section.group("FORCE_PLATFORM")
    section.number("USED", 0)
    section.add("TYPE", INTEGER, (0,), b"")
    section.close()
    return section
