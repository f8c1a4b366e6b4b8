"""C3D: bytes -> Motion, and back.

SPEC.md, "Source reconstruction", is normative for the way back. Every point is a joint without a
parent; its fourth word, the residual, and the analog samples are signals of their own, all of them
raw as the file stores them.
"""

from __future__ import annotations

import hashlib
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcz.formats.c3d_layout import Kind, Layout, ordered_fields
from mcz.formats.c3d_parameters import FLOAT, INTEGER, Parameters, find_parameters, parse_parameters
from mcz.formats.c3d_plain import plain
from mcz.formats.c3d_restore import restore
from mcz.formats.c3d_shape import ROTATION_WORDS, WORD_OF_FIRST, WORD_OF_LAST, Shape, find_shape
from mcz.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton, Source
from mcz.numbers import Grid, GridKind
from mcz.numbers.rules import MAX_SCALE, MIN_SCALE

UNIT_CM = {"mm": 0.1, "cm": 1.0, "m": 100.0, "in": 2.54}
UNSIGNED = b"UNSIGNED"
POSITION = tuple(Channel(kind) for kind in POSITION_KINDS)
FIELDS = (  # parameters that follow the number of frames: group, name, type, size, kind
    ("POINT", "FRAMES", INTEGER, 2, Kind.COUNT),
    ("POINT", "FRAMES", FLOAT, 4, Kind.COUNT_FLOAT),
    ("POINT", "LONG_FRAMES", INTEGER, 2, Kind.COUNT),
    ("POINT", "LONG_FRAMES", FLOAT, 4, Kind.COUNT_FLOAT),
    ("TRIAL", "ACTUAL_START_FIELD", INTEGER, 4, Kind.FIRST_LONG),
    ("TRIAL", "ACTUAL_END_FIELD", INTEGER, 4, Kind.LAST_LONG),
    ("ROTATION", "DATA_START", INTEGER, 2, Kind.ROTATIONS),
)


def read(data: bytes, name: str = "motion") -> Motion:
    """The motion in a C3D file; ``name`` becomes its name.

    Raises SourceError, with the offset at fault. Signals: the points, their residuals, analog,
    rotations; all but the first only where the file has some.
    """
    order, start = find_parameters(data)
    parameters = parse_parameters(data, order, start)
    shape = find_shape(data, parameters)
    points, encoding = _texts(parameters.texts("POINT", "LABELS"))
    names = _names(points, shape.n_points, "point")
    joints = tuple(Joint(label, channels=POSITION) for label in names)
    skeleton = Skeleton(joints, unit_cm=_unit_cm(parameters), angle_unit="")
    rate, exact = _rate(data, parameters)
    numbers = np.arange(shape.first, shape.first + shape.n_frames, dtype=np.int64)
    scale, note = _scale(data, parameters) if shape.word == 2 and shape.n_points else (1.0, "")
    notes = [*shape.notes, *([note] if note else [])]
    if len(points) < shape.n_points:
        notes.append(f"{len(points)} labels for {shape.n_points} points")
    metadata = {"source-note": "; ".join(notes)} if notes else {}
    if encoding != "utf-8":
        metadata["name-encoding"] = encoding
    return Motion(
        skeleton,
        tuple(_signals(data, parameters, shape, Grid(GridKind.SCALED, scale=scale), names)),
        rate,
        exact,
        name,
        metadata,
        _source(data, parameters, shape),
        None if shape.first == 1 or not shape.n_frames else numbers,
    )


def _texts(texts: list[bytes]) -> tuple[list[str], str]:
    """Texts and their encoding: "utf-8" where all of them are, otherwise "latin-1"."""
    encoding = "utf-8"
    try:
        b"".join(texts).decode(encoding)
        return [text.decode(encoding) for text in texts], encoding
    except UnicodeDecodeError:
        return [text.decode("latin-1") for text in texts], "latin-1"


def _names(labels: list[str], n: int, what: str) -> list[str]:
    """``n`` names: the labels, and ``what`` with a number from 1 for those that lack one."""
    labels = labels[:n] + [""] * (n - len(labels))
    return [label or f"{what} {number}" for number, label in enumerate(labels, 1)]


def _unit_cm(parameters: Parameters) -> float | None:
    unit = next(iter(parameters.texts("POINT", "UNITS")), b"")
    return UNIT_CM.get(unit.decode("latin-1").strip().lower())


def _rate(data: bytes, parameters: Parameters) -> tuple[Fraction | None, bool]:
    """Frames a second, and whether that is exactly the float of the file.

    The simplest rate that the float is nearest to: an integer, one divided by 1.001, one of at
    most 3 decimals; else the float itself.
    """
    stated = parameters.number("POINT", "RATE") or parameters.order.real(data, 20)
    if not 1e-6 <= stated <= 1e9:
        return None, True
    value = Fraction(stated)
    for unit in (Fraction(1), Fraction(1000, 1001), *(Fraction(1, 10**n) for n in (1, 2, 3))):
        rate = round(value / unit) * unit
        if rate and parameters.order.build_real(float(rate)) == (
            parameters.order.build_real(stated)
        ):
            return rate, rate == value
    return value, True


def _scale(data: bytes, parameters: Parameters) -> tuple[float, str]:
    """The unit of integer coordinates and what is odd about it."""
    for stated in (parameters.number("POINT", "SCALE"), parameters.order.real(data, 12)):
        if stated is not None and MIN_SCALE <= abs(stated) <= MAX_SCALE:
            return abs(stated), ""
    return 1.0, "no scale that can be used: coordinates are the integers of the file"


def _signals(
    data: bytes, parameters: Parameters, shape: Shape, grid: Grid, names: list[str]
) -> list[Signal]:
    """The signals; ``grid`` is that of integer coordinates."""
    order, end = parameters.order, 4 * shape.n_points
    n_words = shape.n_frames * shape.frame_words
    kind = "i2" if shape.word == 2 else "u4"
    words = np.frombuffer(data, f"{order.prefix}{kind}", n_words, shape.start)
    words = words.reshape(shape.n_frames, shape.frame_words)
    raw = Grid(GridKind.INTEGER)
    if shape.word == 4:
        grid = raw = order.grid
    columns = np.delete(np.arange(end), np.s_[3::4])
    points = _signal("motion", words[:, columns], grid)
    found = [points]
    if shape.n_points:
        labels = tuple(Channel("", name) for name in names)
        residuals = _signal("residuals", words[:, 3:end:4], raw, labels)
        found = [_masked(points, residuals), residuals]
    if shape.n_channels:
        samples = words[:, end:].reshape(-1, shape.n_channels)
        if shape.word == 2 and _unsigned(parameters):
            samples = samples.astype(np.int64) & 0xFFFF
        channels = _channels(parameters, shape)
        found.append(_signal("analog", samples, raw, channels, shape.subframes))
    if shape.n_rotations:
        n_words = shape.n_frames * shape.rotations_size // 4
        words = np.frombuffer(data, f"{order.prefix}u4", n_words, shape.rotations_at)
        channels = _rotation_channels(parameters, shape)
        samples = words.reshape(-1, len(channels))
        found.append(_signal("rotations", samples, order.grid, channels, shape.ratio))
    return found


def _signal(
    name: str,
    words: NDArray[Any],
    grid: Grid,
    channels: tuple[Channel, ...] | None = None,
    per_frame: int = 1,
) -> Signal:
    """A signal of words as stored: integers, or the bits of floats."""
    grids = (grid,) * words.shape[1]
    if grid.kind == GridKind.INTEGER:
        return Signal(words.astype(np.int64), grids, name, per_frame, channels=channels)
    scaled = grid.kind == GridKind.SCALED
    ordinals = words.astype(np.int64) if scaled else grid.ordinals_of_bits(words)
    return Signal(
        grid.values(ordinals), grids, name, per_frame, channels=channels, ordinals=ordinals
    )


def _masked(points: Signal, residuals: Signal) -> Signal:
    """The points with their mask: valid where the residual is not negative and nothing is NaN."""
    valid = residuals.values >= 0
    if points.values.dtype == np.float64:
        nan = np.isnan(points.values)
        if nan.any():
            valid &= ~nan.reshape(*valid.shape, 3).any(axis=2)
    if valid.all():
        return points
    return Signal(
        points.values, points.grids, mask=np.repeat(valid, 3, axis=1), ordinals=points.ordinals
    )


def _unsigned(parameters: Parameters) -> bool:
    texts = parameters.texts("ANALOG", "FORMAT")
    return bool(texts) and texts[0].upper() == UNSIGNED


def _channels(parameters: Parameters, shape: Shape) -> tuple[Channel, ...]:
    """The analog channels. Names and units that are no UTF-8 are read as Latin-1."""
    labels, _ = _texts(parameters.texts("ANALOG", "LABELS"))
    units, _ = _texts(parameters.texts("ANALOG", "UNITS"))
    units += [""] * (shape.n_channels - len(units))
    names = _names(labels, shape.n_channels, "channel")
    return tuple(Channel("", name, unit) for name, unit in zip(names, units, strict=False))


def _rotation_channels(parameters: Parameters, shape: Shape) -> tuple[Channel, ...]:
    """Of every rotation the elements of its matrix, column after column, and its reliability."""
    labels, _ = _texts(parameters.texts("ROTATION", "LABELS"))
    elements = [f"m{row}{column}" for column in range(1, 5) for row in range(1, 5)]
    parts = (*elements, "reliability")
    assert len(parts) == ROTATION_WORDS
    names = _names(labels, shape.n_rotations, "rotation")
    return tuple(Channel("", f"{name} {part}") for name in names for part in parts)


def _source(data: bytes, parameters: Parameters, shape: Shape) -> Source:
    """All that lies around the data, and which fields count frames."""
    fields = [(WORD_OF_FIRST, Kind.FIRST), (WORD_OF_LAST, Kind.LAST)]
    for group, name, type_, size, kind in FIELDS:
        parameter = parameters.get(group, name)
        wanted = kind != Kind.ROTATIONS or shape.n_rotations
        if parameter and wanted and (parameter.type, len(parameter.data)) == (type_, size):
            fields.append((parameter.at, kind))
    gap, tail = b"", data[shape.stop :]
    if shape.n_rotations:
        gap = data[shape.stop : shape.rotations_at]
        tail = data[shape.rotations_at + shape.n_frames * shape.rotations_size :]
    layout = Layout(
        parameters.order,
        shape.word,
        shape.n_points,
        shape.n_channels,
        shape.subframes if shape.n_channels else 1,
        shape.word == 2 and _unsigned(parameters),
        shape.n_frames,
        shape.first,
        data[: shape.start],
        ordered_fields(fields, shape.start),
        shape.n_rotations,
        shape.ratio,
        gap,
        tail,
    )
    template, detail = layout.build()
    digest = hashlib.sha256(data).digest()
    return Source("c3d", template, detail, size=len(data), sha256=digest)


def write(motion: Motion) -> bytes:
    """The C3D file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for what C3D cannot say; see ``plain``.
    """
    if motion.source is None or motion.source.format != "c3d":
        motion = plain(motion)
    assert motion.source is not None
    return restore(motion, motion.source)
