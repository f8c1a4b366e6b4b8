"""A motion that did not come from C3D, laid out as a plain C3D file.

Intel byte order, floats; integers if all coordinates are multiples of one scale and all analog
samples are 16-bit integers. The parameter section holds POINT, TRIAL, ANALOG and FORCE_PLATFORM.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from mcz.errors import MotionError
from mcz.model.motion import POSITION_KINDS, Channel, Motion, Signal, Source
from mcz.model.numbers import Grid, GridKind
from mcz.model.signal import Scaling
from mcz.sources.c3d.data_section import field_bytes, valid_points
from mcz.sources.c3d.layout import C3dLayout, FieldKind
from mcz.sources.c3d.parameters import (
    BLOCK,
    FLOAT,
    INTEGER,
    INTEL,
    MAX_BLOCKS,
    MAX_COUNT,
    OUTPUTS,
    TEXT,
    UNITS_OF,
    WORD_OF_FIRST,
    WORD_OF_LAST,
    ByteOrder,
    OutputList,
    describe_outputs,
)

UNITS = {0.1: "mm", 1.0: "cm", 100.0: "m", 2.54: "in"}
KNOWN = ("residuals", "analog", OUTPUTS)  # roles of signals beside the points
EVENTS_KEY = 12_345  # label and range data are of the kind that C3D has today
FLOATS = Grid(GridKind.BINARY32)
MOST_RATE = 1e30  # of frames: the samples of one second fit a binary32, too


def plain_c3d(motion: Motion) -> Motion:
    """``motion`` on the grids of a C3D file, with the source of a plain one.

    Model outputs follow the points. Raises MotionError for joints that are no markers, for signals
    other than residuals, analog and outputs, and for sizes beyond C3D.
    """
    for joint in motion.skeleton.joints:
        if joint.parent >= 0 or tuple(c.kind for c in joint.channels) != POSITION_KINDS:
            raise MotionError(f"C3D holds markers only; joint {joint.name!r} is not a marker")
    others = {signal.role: signal for signal in motion.signals[1:]}
    if len(others) < len(motion.signals) - 1 or not set(others) <= set(KNOWN):
        unsupported = ", ".join(signal.name for signal in motion.signals[1:])
        raise MotionError(f"C3D cannot hold all of the signals {unsupported}")
    residuals, outputs = others.get("residuals"), others.get(OUTPUTS)
    analog, scaling = _analog(others.get("analog"))
    placed = [motion.signals[0], *([outputs] if outputs is not None else [])]
    n_points = sum(signal.n_channels // 3 for signal in placed)
    n_channels = analog.n_channels if analog else 0
    subframes = analog.samples_per_frame if analog and n_channels else 1
    if max(n_points, n_channels * subframes) > MAX_COUNT:
        raise MotionError(f"C3D allows at most {MAX_COUNT} points and analog samples a frame")
    if residuals is not None and residuals.n_channels != n_points:
        raise MotionError(f"{residuals.n_channels} residuals do not fit {n_points} points")
    names = [joint.name for joint in motion.skeleton.joints]
    for name in names:
        if not name or name != name.strip():
            raise MotionError(
                f"C3D cannot hold the name {name!r}, because its labels are padded with blanks"
            )
    listed = describe_outputs(outputs)
    both = {*names} & {*listed.labels}
    if both or not all(listed.labels):
        raise MotionError(
            "C3D distinguishes outputs from points only by name, and these are both: "
            f"{sorted(both)}"
        )
    scale = _scale(placed, [signal for signal in (residuals, analog) if signal])
    unsigned = scale is not None and analog is not None and _range(analog)[1] > 0x7FFF
    grids = (Grid(GridKind.SCALED, scale=scale), Grid(GridKind.INTEGER)) if scale else (FLOATS,) * 2
    if residuals is None:
        residuals = _residuals(placed, motion.n_frames)
    signals = [_regrid(signal, grids[0]) for signal in placed]
    signals += [_regrid(signal, grids[1]) for signal in (residuals, analog) if signal is not None]
    section_data = SectionData(
        [*names, *listed.labels],
        listed,
        UNITS.get(motion.skeleton.unit_cm or 0.0, ""),
        motion.skeleton.up_axis,
        analog,
        scaling,
        unsigned,
    )
    layout = _layout(motion, scale, section_data, (n_channels, subframes))
    template, detail = layout.build()
    source = Source(layout.format, template, detail)
    return replace(motion, signals=tuple(signals), source=source)


def _analog(signal: Signal | None) -> tuple[Signal | None, Scaling | None]:
    """The analog signal as stored and what its words mean, or its values, if C3D cannot say."""
    if signal is None or signal.scaling is None:
        return signal, None
    offsets, scaling = signal.scaling.offsets, signal.scaling
    words = (offsets == np.rint(offsets)) & (offsets >= -0x7FFF) & (offsets <= 0x7FFF)
    factors = np.array([*scaling.scales, scaling.general])
    with np.errstate(over="ignore"):
        exact = (factors.astype(np.float32) == factors).all()
    if words.all() and exact:
        return signal.as_stored(), scaling
    return replace(signal, scaling=None, grids=(), grid_changes=(), ordinals=None), None


def _residuals(placed: Sequence[Signal], n_frames: int) -> Signal:
    """The residuals of all points: 0 if they are valid, -1 elsewhere."""
    parts = []
    for signal in placed:
        valid = valid_points(_without_nan(signal))
        words = np.zeros((n_frames, signal.n_channels // 3))
        if valid is not None:
            words[~valid] = -1.0
        parts.append(words)
    words = np.concatenate(parts, axis=1)
    n_points = words.shape[1]
    channels = (Channel("", "residual"),) * n_points
    grids = (FLOATS,) * n_points
    return Signal(words, grids, "residuals", channels=channels, role="residuals", of=0)


def _scale(placed: Sequence[Signal], others: Iterable[Signal]) -> float | None:
    """The scale of a file of integers, None if floats are needed."""
    grids = {grid for points in placed for grid in points.grids}
    if len(grids) != 1 or next(iter(grids)).kind != GridKind.SCALED:
        return None
    scale = next(iter(grids)).scale
    for points in placed:
        ordinals, exact = points.to_ordinals()
        low, high = ordinals.min(initial=0), ordinals.max(initial=0)
        if points.grid_changes or not exact.all() or low < -0x8000 or high > 0x7FFF:
            return None
    if scale != np.float32(scale):
        return None
    for signal in others:
        if signal.values.dtype != np.int64 and signal.n_channels:
            return None
        low, high = _range(signal)
        if low < -0x8000 or high > (0xFFFF if low >= 0 and signal.role == "analog" else 0x7FFF):
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


def _regrid(signal: Signal, grid: Grid) -> Signal:
    """The signal on another grid; raises MotionError if that has no number nearby."""
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
        role=signal.role,
        of=signal.of,
    )


def _layout(
    motion: Motion, scale: float | None, section_data: SectionData, shape: tuple[int, int]
) -> C3dLayout:
    """The layout of the file: header, parameter section, fields."""
    order, n_points = ByteOrder(INTEL), len(section_data.names)
    n_channels, subframes = shape
    first = 1 if motion.frame_numbers is None or not motion.n_frames else motion.frame_numbers[0]
    rate = Fraction(motion.frame_rate or 0)
    if rate > MOST_RATE:
        raise MotionError(f"C3D allows frame rates up to {MOST_RATE:.2g}, but this one is larger")
    section = section_of(section_data, -1.0 if scale is None else scale, rate, shape)
    start = BLOCK + len(section.data)
    header = bytearray(BLOCK)
    struct.pack_into("<BBHHHHHf", header, 0, 2, 0x50, n_points, n_channels * subframes, 0, 0, 0,
                     -1.0 if scale is None else scale)  # fmt: skip
    struct.pack_into("<HHf", header, 16, start // BLOCK + 1, subframes, float(rate))
    struct.pack_into("<H", header, 298, EVENTS_KEY)
    struct.pack_into("<H", section.data, section.data_start, start // BLOCK + 1)
    fields = [(WORD_OF_FIRST, FieldKind.FIRST), (WORD_OF_LAST, FieldKind.LAST)]
    fields += [(BLOCK + at, kind) for at, kind in section.fields]
    head = header + section.data
    for at, kind in fields:
        head[at : at + kind.size] = field_bytes(order, kind, int(first), motion.n_frames, 0)
    return C3dLayout(
        order,
        4 if scale is None else 2,
        n_points,
        n_channels,
        subframes,
        section_data.unsigned,
        motion.n_frames,
        max(0, int(first)),
        bytes(head),
        tuple(fields),
        outputs=(motion.skeleton.n_joints, len(section_data.listed.labels))
        if section_data.listed.labels
        else (),
    )


LABELS_PER_PARAMETER = 255
LABELS_SIZE = 30_000  # bytes of a parameter of labels; its length must fit 15 bits
MAX_LABEL = 255
SCREENS = {  # to the right, up
    "x": ("+Y", "+X"),
    "y": ("+X", "+Y"),
    "z": ("+X", "+Z"),
    "-x": ("+Y", "-X"),
    "-y": ("+X", "-Y"),
    "-z": ("+X", "-Z"),
}


@dataclass(frozen=True, slots=True)
class SectionData:
    """Data to write to the section: all points, outputs after the others, and analog data."""

    names: Sequence[str]
    listed: OutputList
    unit: str
    up_axis: str
    analog: Signal | None
    scaling: Scaling | None
    unsigned: bool


@dataclass
class ParameterSection:
    """A parameter section while it is written; offsets are counted from its start."""

    data: bytearray = field(default_factory=lambda: bytearray((1, 0x50, 0, INTEL)))
    fields: list[tuple[int, FieldKind]] = field(default_factory=list)
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
            raise MotionError(f"a name of {width} bytes is too long; C3D allows 255")
        step = min(LABELS_PER_PARAMETER, LABELS_SIZE // max(1, width))
        for number, k in enumerate(range(0, max(1, len(coded)), step), 1):
            part = coded[k : k + step]
            padded = b"".join(text.ljust(width) for text in part)
            self.add(name if number == 1 else f"{name}{number}", TEXT, (width, len(part)), padded)

    def numbers(self, name: str, kind: int, code: str, numbers: Sequence[float]) -> None:
        """Add numbers, of a kind and a code of struct, in as many parameters as they need."""
        for number, k in enumerate(range(0, max(1, len(numbers)), LABELS_PER_PARAMETER), 1):
            part = numbers[k : k + LABELS_PER_PARAMETER]
            data = struct.pack(f"<{len(part)}{code}", *part)
            self.add(name if number == 1 else f"{name}{number}", kind, (len(part),), data)

    def close(self) -> None:
        """End the section at the border of a block; raises MotionError if it is too long."""
        self.data += b"\0\0"
        self.data += bytes(-len(self.data) % BLOCK)
        if len(self.data) > MAX_BLOCKS * BLOCK:
            raise MotionError(f"names of {len(self.data)} bytes are too long for a C3D file")
        self.data[2] = len(self.data) // BLOCK


def section_of(
    content: SectionData, scale: float, rate: Fraction, shape: tuple[int, int]
) -> ParameterSection:
    """The section; ``shape`` are the analog channels and their samples a frame."""
    section = ParameterSection()
    _add_points(section, content, scale, rate)
    section.group("TRIAL")
    for name, kind in (
        ("ACTUAL_START_FIELD", FieldKind.FIRST_LONG),
        ("ACTUAL_END_FIELD", FieldKind.LAST_LONG),
    ):
        section.fields.append((section.add(name, INTEGER, (2,), bytes(4)), kind))
    _add_analog(section, content, rate, *shape)
    section.group("FORCE_PLATFORM")
    section.number("USED", 0)
    section.add("TYPE", INTEGER, (0,), b"")
    section.close()
    return section


def _add_points(
    section: ParameterSection, content: SectionData, scale: float, rate: Fraction
) -> None:
    section.group("POINT")
    section.number("USED", len(content.names))
    section.fields.append((section.number("FRAMES", 0), FieldKind.COUNT))
    section.data_start = section.number("DATA_START", 0)
    section.number("SCALE", scale)
    section.number("RATE", rate)
    section.texts("LABELS", content.names)
    section.texts("DESCRIPTIONS", [""] * len(content.names))
    section.text("UNITS", content.unit)
    if content.up_axis:
        for name, axis in zip(("X_SCREEN", "Y_SCREEN"), SCREENS[content.up_axis], strict=True):
            section.text(name, axis)
    for group, (labels, unit) in content.listed.groups.items():
        section.texts(group, labels)
        section.text(UNITS_OF[group], unit)


def _add_analog(
    section: ParameterSection, content: SectionData, rate: Fraction, n_channels: int, subframes: int
) -> None:
    section.group("ANALOG")
    channels = content.analog.channels if content.analog and content.analog.channels else ()
    ones = Scaling(np.zeros(n_channels), np.ones(n_channels))
    scaling = ones if content.scaling is None else content.scaling
    section.number("USED", n_channels)
    section.texts("LABELS", [channel.label for channel in channels])
    section.texts("DESCRIPTIONS", [""] * n_channels)
    section.texts("UNITS", [channel.unit for channel in channels])
    section.number("GEN_SCALE", scaling.general)
    section.numbers("SCALE", FLOAT, "f", scaling.scales.tolist())
    section.numbers("OFFSET", INTEGER, "h", [int(offset) for offset in scaling.offsets])
    section.number("RATE", rate * subframes)
    section.text("FORMAT", "UNSIGNED" if content.unsigned else "SIGNED")
    section.number("BITS", 16)
