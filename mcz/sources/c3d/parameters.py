"""The parameter section of a C3D file, its words in their byte order, and its model outputs.

Read leniently: a parameter that runs out of its section is left out, the first of a name counts.

Model outputs are angles, forces, moments, powers and scalars. Programs that compute them store them
beside the markers, in the same words, and list their labels in parameters of POINT. Here they are
apart, as the signal ``outputs``.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import NDArray

from mcz.errors import MotionError, SourceError
from mcz.model.motion import Channel, Signal
from mcz.model.numbers import Grid, GridKind

BLOCK = 512
WORD_OF_START = 16  # offset in the header: first block of the data
WORD_OF_FIRST, WORD_OF_LAST = 6, 8  # offsets of the frame numbers in the header
MAX_COUNT = 65_535  # the most that a word can count
ROTATION_WORDS = 17  # floats of a rotation: a 4 x 4 matrix and its reliability
MAX_BLOCKS = 255  # of a parameter section: its length is a byte
INTEL, DEC, SGI = 84, 85, 86  # processor bytes
TEXT, BYTE, INTEGER, FLOAT = -1, 1, 2, 4  # types of parameters; the magnitude is a size

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ByteOrder:
    """Byte order and float format of the processor that wrote a file."""

    processor: int

    @property
    def prefix(self) -> str:
        """For numpy and struct."""
        return ">" if self.processor == SGI else "<"  # C3D-15

    @property
    def grid(self) -> Grid:
        """Grid of a float."""
        return Grid(GridKind.VAX_F if self.processor == DEC else GridKind.BINARY32)

    def integer(self, data: bytes, at: int) -> int:
        """The unsigned 16-bit integer at an offset, 0 beyond the end."""
        word = data[at : at + 2]
        return int(struct.unpack(f"{self.prefix}H", word)[0]) if len(word) == 2 else 0

    def reals(self, data: bytes) -> Floats:
        """All floats of ``data``, whose size is a multiple of 4."""
        words = np.frombuffer(data, f"{self.prefix}u4")
        return self.grid.values(self.grid.ordinals_of_bits(words))

    def real(self, data: bytes, at: int) -> float:
        """The float at an offset, 0 beyond the end."""
        word = data[at : at + 4]
        return float(self.reals(word)[0]) if len(word) == 4 else 0.0

    def build_integer(self, value: int) -> bytes:
        return struct.pack(f"{self.prefix}H", value)

    def build_real(self, value: float) -> bytes:
        ordinals, _ = self.grid.ordinals(np.array([value], np.float64))
        return self.grid.bits(ordinals).astype(f"{self.prefix}u4").tobytes()


@dataclass(frozen=True, slots=True)
class C3dParameter:
    """A parameter: its type, its dimensions (the first one varies fastest), where its data lie."""

    type: int
    dims: tuple[int, ...]
    at: int
    data: bytes = field(repr=False)


@dataclass(frozen=True)
class Parameters:
    """The parameters of a file by group and name, both in capitals."""

    order: ByteOrder
    start: int  # of the section
    found: dict[tuple[str, str], C3dParameter]
    end: int  # of the last entry

    def get(self, group: str, name: str) -> C3dParameter | None:
        return self.found.get((group, name))

    def number(self, group: str, name: str) -> float | None:
        """The first number of a parameter, integers unsigned; None if there is none."""
        parameter = self.get(group, name)
        if parameter is None or parameter.type == TEXT or not parameter.data:
            return None
        if parameter.type == FLOAT:
            return self.order.real(parameter.data, 0)
        if parameter.type == INTEGER:
            return float(self.order.integer(parameter.data, 0))
        return float(parameter.data[0])

    def count(self, group: str, name: str) -> int | None:
        """The first number of a parameter, None if it is no count."""
        value = self.number(group, name)
        return int(value) if value is not None and 0 <= value < 2**32 else None

    def texts(self, group: str, name: str) -> list[bytes]:
        """The texts of a parameter and of its continuations (LABELS, LABELS2, ...)."""
        texts: list[bytes] = []
        number = 1
        while True:
            parameter = self.get(group, name if number == 1 else f"{name}{number}")
            if parameter is None or parameter.type != TEXT:
                return texts
            width = parameter.dims[0] if parameter.dims else 1
            rows = range(0, len(parameter.data), width or 1)
            texts += [parameter.data[k : k + width].rstrip(b"\0 ").lstrip(b" ") for k in rows]
            number += 1

    def numbers(self, group: str, name: str) -> list[float]:
        """The numbers of a parameter and of its continuations; integers are signed."""
        numbers: list[float] = []
        count = 1
        while True:
            parameter = self.get(group, name if count == 1 else f"{name}{count}")
            if parameter is None or parameter.type == TEXT:
                return numbers
            numbers += self.numbers_of(parameter)
            count += 1

    def numbers_of(self, parameter: C3dParameter) -> list[float]:
        """The numbers of one parameter that is no text, integers with a sign."""
        if parameter.type == FLOAT:
            numbers: list[float] = self.order.reals(parameter.data).tolist()
            return numbers
        kind = f"{self.order.prefix}i2" if parameter.type == INTEGER else "u1"
        return list(map(float, np.frombuffer(parameter.data, kind)))

    @cached_property
    def first_frame(self) -> int | None:
        """TRIAL:ACTUAL_START_FIELD."""
        return self._long("ACTUAL_START_FIELD")

    @cached_property
    def last_frame(self) -> int | None:
        """TRIAL:ACTUAL_END_FIELD."""
        return self._long("ACTUAL_END_FIELD")

    def _long(self, name: str) -> int | None:
        """A number of TRIAL that is split into two words, the low one first."""
        parameter = self.get("TRIAL", name)
        if parameter is None or parameter.type != INTEGER or len(parameter.data) < 4:
            return None
        low, high = (self.order.integer(parameter.data, at) for at in (0, 2))
        return low + (high << 16)


def decode_texts(texts: list[bytes]) -> tuple[list[str], str]:
    """Texts and their encoding: "utf-8" if all of them are, otherwise "latin-1"."""
    encoding = "utf-8"
    try:
        b"".join(texts).decode(encoding)
        return [text.decode(encoding) for text in texts], encoding
    except UnicodeDecodeError:
        return [text.decode("latin-1") for text in texts], "latin-1"


def names_of(labels: list[str], n: int, noun: str) -> list[str]:
    """``n`` names: the labels, and ``noun`` with a number from 1 for those that lack one."""
    labels = labels[:n] + [""] * (n - len(labels))
    return [label or f"{noun} {number}" for number, label in enumerate(labels, 1)]


def find_parameters(data: bytes) -> tuple[ByteOrder, int]:
    """The byte order of a file and where its parameter section begins; raises SourceError."""
    if len(data) < BLOCK:
        raise SourceError("the file is truncated in its C3D header", offset=len(data))
    if data[1] != 0x50:
        raise SourceError(f"offset 1: {data[1]:#04x} is not the byte 0x50 of a C3D file")
    start = (data[0] - 1) * BLOCK
    if start < BLOCK or start + 4 > len(data):
        raise SourceError(
            f"offset 0: the parameters begin at block {data[0]}, which is not in the file"
        )
    processor = data[start + 3]
    if processor not in (INTEL, DEC, SGI):
        raise SourceError(
            f"processor {processor} is not 84 (Intel), 85 (DEC) or 86 (SGI)", offset=start + 3
        )
    return ByteOrder(processor), start


def parse_parameters(data: bytes, order: ByteOrder, start: int) -> Parameters:
    """The parameters of the section at ``start``, whose first four bytes are there."""
    blocks = data[start + 2] or MAX_BLOCKS  # some files have more of them than they state
    data_start = (order.integer(data, WORD_OF_START) - 1) * BLOCK
    stop = min(max(start + blocks * BLOCK, data_start), start + MAX_BLOCKS * BLOCK, len(data))
    groups: dict[int, str] = {}
    entries: list[tuple[int, str, C3dParameter]] = []
    at = start + 4
    while at + 2 <= stop:
        size, number = struct.unpack_from("bb", data, at)
        after = at + 2 + abs(size)
        if size == 0 or after + 2 > stop:
            break
        name = data[at + 2 : after].decode("latin-1").strip(" \0").upper()
        if number < 0:
            groups.setdefault(-number, name)
        else:
            parameter = _parameter(data, after + 2, stop)
            if parameter is not None:
                entries.append((number, name, parameter))
        step = order.integer(data, after)
        if step < 2:  # 0 marks the last entry; what lies before the next step is none
            at = after
            break
        at = after + step
    parameters: dict[tuple[str, str], C3dParameter] = {}
    for number, name, parameter in entries:
        if number in groups:
            parameters.setdefault((groups[number], name), parameter)
    return Parameters(order, start, parameters, min(at, stop))


def _parameter(data: bytes, at: int, stop: int) -> C3dParameter | None:
    """The parameter whose type is at ``at``, None if it exceeds its section."""
    if at + 2 > stop:
        return None
    kind, n_dims = struct.unpack_from("bB", data, at)
    first = at + 2 + n_dims
    if first > stop:
        return None
    dims = tuple(data[at + 2 : first])
    size = abs(kind) * prod(dims)
    if kind not in (TEXT, BYTE, INTEGER, FLOAT) or first + size > stop:
        return None
    return C3dParameter(kind, dims, first, data[first : first + size])


OUTPUTS = "outputs"
UNITS_OF = {  # parameters of POINT that list outputs, and the parameter with their unit
    "ANGLES": "ANGLE_UNITS",
    "FORCES": "FORCE_UNITS",
    "MOMENTS": "MOMENT_UNITS",
    "POWERS": "POWER_UNITS",
    "SCALARS": "SCALAR_UNITS",
}
PARTS = ("x", "y", "z")
USUAL = (  # units, and the usual list of outputs in each
    (r"(?i)deg|rad|°", "ANGLES"),
    (r"N.?m", "MOMENTS"),
    (r"N\b", "FORCES"),
    (r"k?W\b", "POWERS"),
)


@dataclass(frozen=True, slots=True)
class Split:
    """The points of a file, by their numbers in it: those that are points, and the outputs."""

    points: NDArray[np.int64]
    outputs: NDArray[np.int64]

    @property
    def order(self) -> NDArray[np.int64]:
        """The points, then the outputs: the order of their residuals."""
        return np.concatenate([self.points, self.outputs])

    @property
    def runs(self) -> tuple[int, ...]:
        """Lengths of alternating runs of points and outputs, points first; () without outputs."""
        if not len(self.outputs):
            return ()
        is_output = np.zeros(len(self.order), np.bool_)
        is_output[self.outputs] = True
        edges = np.flatnonzero(np.diff(is_output)) + 1
        sizes = np.diff([0, *edges, len(is_output)]).tolist()
        return (0, *sizes) if is_output[0] else tuple(sizes)


def split_of(runs: Sequence[int], n_points: int) -> Split:
    """The inverse of ``Split.runs``, which have ``n_points`` in all, or are ()."""
    is_output = np.zeros(n_points, np.bool_)
    at = 0
    for number, size in enumerate(runs):
        is_output[at : at + size] = number % 2
        at += size
    return Split(np.flatnonzero(~is_output), np.flatnonzero(is_output))


def find_outputs(parameters: Parameters, n_points: int) -> Split:
    """The outputs: all points with a label in one of the lists; see ``groups_of``."""
    labels = parameters.texts("POINT", "LABELS")[:n_points]
    groups = groups_of(parameters)
    is_output = np.zeros(n_points, np.bool_)
    is_output[: len(labels)] = [label in groups for label in labels]
    return Split(np.flatnonzero(~is_output), np.flatnonzero(is_output))


def groups_of(parameters: Parameters) -> dict[bytes, tuple[str, ...]]:
    """The lists that have each label, empty ones left out: ANGLES, FORCES, MOMENTS, ..."""
    groups: dict[bytes, tuple[str, ...]] = {}
    for group in UNITS_OF:
        for label in dict.fromkeys(parameters.texts("POINT", group)):
            if label:
                groups[label] = (*groups.get(label, ()), group)
    return groups


def unit_of(parameters: Parameters, groups: Sequence[str]) -> str:
    """The unit of an output that these lists have, "" if it is unknown or they disagree."""
    texts = [next(iter(parameters.texts("POINT", UNITS_OF[group])), b"") for group in groups]
    units = {text.decode("latin-1") for text in texts}
    return units.pop() if len(units) == 1 else ""


@dataclass(frozen=True, slots=True)
class OutputList:
    """The labels of outputs, and under the name of each list its labels and their unit."""

    labels: tuple[str, ...]
    groups: dict[str, tuple[list[str], str]]


def describe_outputs(outputs: Signal | None) -> OutputList:
    """Labels and lists that say what ``outputs``, channels ``NAME x``, ``NAME y``, ``NAME z``, are.

    The unit of an output tells its list. If there are more units than lists, the last list says
    none. Raises MotionError for other channels.
    """
    channels = outputs.channels or () if outputs is not None else ()
    labels: list[str] = []
    groups: dict[str, tuple[list[str], str]] = {}
    for first in range(0, len(channels), len(PARTS)):
        three = channels[first : first + len(PARTS)]
        label, unit = three[0].name.removesuffix(f" {PARTS[0]}"), three[0].unit
        if [channel.name for channel in three] != [f"{label} {part}" for part in PARTS]:
            raise MotionError(
                f"C3D outputs need x, y and z, but {three[0].name!r} does not have them"
            )
        group = _list_of(unit, groups)
        listed, group_unit = groups.get(group, ([], unit))
        groups[group] = ([*listed, *({label} - {*listed})], unit if group_unit == unit else "")
        labels.append(label)
    return OutputList(tuple(labels), groups)


def _list_of(unit: str, groups: dict[str, tuple[list[str], str]]) -> str:
    """The list for outputs of a unit: if it is usual, else one that has it or is free."""
    usual = [name for pattern, name in USUAL if re.match(pattern, unit)]
    for group in [*usual, *reversed(UNITS_OF)]:
        if groups.get(group, ([], unit))[1] == unit:
            return group
    return next(reversed(UNITS_OF))


def output_channels(parameters: Parameters, names: Sequence[str]) -> tuple[Channel, ...]:
    """The channels of the outputs of these names, which come in the order of the file."""
    n_points = len(parameters.texts("POINT", "LABELS"))
    split, groups = find_outputs(parameters, n_points), groups_of(parameters)
    labels = parameters.texts("POINT", "LABELS")
    units = [unit_of(parameters, groups[labels[number]]) for number in split.outputs]
    return tuple(
        Channel("", f"{name} {part}", unit)
        for name, unit in zip(names, units, strict=True)
        for part in PARTS
    )
