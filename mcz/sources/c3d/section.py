"""The parameter section of a plain C3D file: POINT, TRIAL, ANALOG and FORCE_PLATFORM."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from mcz.errors import MotionError
from mcz.model.motion import Signal
from mcz.model.numbers.scaling import Scaling
from mcz.sources.c3d.layout import Kind
from mcz.sources.c3d.outputs import UNITS_OF, Listed
from mcz.sources.c3d.parameters import BLOCK, FLOAT, INTEGER, INTEL, MAX_BLOCKS, TEXT

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
    listed: Listed
    unit: str
    up_axis: str
    analog: Signal | None
    scaling: Scaling | None
    unsigned: bool


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

    def numbers(self, name: str, kind: int, code: str, numbers: Sequence[float]) -> None:
        """Add numbers, of a kind and a code of struct, in as many parameters as they need."""
        for number, k in enumerate(range(0, max(1, len(numbers)), LABELS_PER_PARAMETER), 1):
            part = numbers[k : k + LABELS_PER_PARAMETER]
            data = struct.pack(f"<{len(part)}{code}", *part)
            self.add(name if number == 1 else f"{name}{number}", kind, (len(part),), data)

    def close(self) -> None:
        """End the section at the border of a block; raises MotionError where it is too long."""
        self.data += b"\0\0"
        self.data += bytes(-len(self.data) % BLOCK)
        if len(self.data) > MAX_BLOCKS * BLOCK:
            raise MotionError(f"names of {len(self.data)} bytes are too much for a C3D file")
        self.data[2] = len(self.data) // BLOCK


def section_of(
    content: SectionData, scale: float, rate: Fraction, shape: tuple[int, int]
) -> Section:
    """The section; ``shape`` are the analog channels and their samples a frame."""
    section = Section()
    _add_points(section, content, scale, rate)
    section.group("TRIAL")
    for name, kind in (
        ("ACTUAL_START_FIELD", Kind.FIRST_LONG),
        ("ACTUAL_END_FIELD", Kind.LAST_LONG),
    ):
        section.fields.append((section.add(name, INTEGER, (2,), bytes(4)), kind))
    _add_analog(section, content, rate, *shape)
    section.group("FORCE_PLATFORM")
    section.number("USED", 0)
    section.add("TYPE", INTEGER, (0,), b"")
    section.close()
    return section


def _add_points(section: Section, content: SectionData, scale: float, rate: Fraction) -> None:
    section.group("POINT")
    section.number("USED", len(content.names))
    section.fields.append((section.number("FRAMES", 0), Kind.COUNT))
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
    section: Section, content: SectionData, rate: Fraction, n_channels: int, subframes: int
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
