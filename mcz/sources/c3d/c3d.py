"""C3D: bytes -> Motion, and back.

SPEC.md, "Source reconstruction", is normative for the way back. Every point is a joint without a
parent; its fourth word, the residual, the outputs of models and the analog samples are signals of
their own. Stored is what the file holds; the values of analog samples are in their units.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from mcz.model.motion import POSITION_KINDS, Channel, Joint, Motion, Signal, Skeleton, Source
from mcz.model.numbers import Grid, GridKind
from mcz.model.numbers.rules import MAX_SCALE, MIN_SCALE
from mcz.model.signal import Scaling
from mcz.model.types import Items, Values
from mcz.sources.c3d.data_section import DataShape, find_shape, restore_c3d
from mcz.sources.c3d.layout import FORMAT, OUTPUTS_FORMAT, C3dLayout, FieldKind, ordered_fields
from mcz.sources.c3d.parameters import (
    FLOAT,
    INTEGER,
    OUTPUTS,
    ROTATION_WORDS,
    WORD_OF_FIRST,
    WORD_OF_LAST,
    Parameters,
    Split,
    decode_texts,
    find_outputs,
    find_parameters,
    names_of,
    output_channels,
    parse_parameters,
)
from mcz.sources.c3d.plain import plain_c3d
from mcz.sources.c3d.recording import is_unsigned, recording_of

UNIT_CM = {"mm": 0.1, "cm": 1.0, "m": 100.0, "in": 2.54}
POSITION = tuple(Channel(kind) for kind in POSITION_KINDS)
FIELDS = (  # parameters that follow the number of frames: group, name, type, size, kind
    ("POINT", "FRAMES", INTEGER, 2, FieldKind.COUNT),
    ("POINT", "FRAMES", FLOAT, 4, FieldKind.COUNT_FLOAT),
    ("POINT", "LONG_FRAMES", INTEGER, 2, FieldKind.COUNT),
    ("POINT", "LONG_FRAMES", FLOAT, 4, FieldKind.COUNT_FLOAT),
    ("TRIAL", "ACTUAL_START_FIELD", INTEGER, 4, FieldKind.FIRST_LONG),
    ("TRIAL", "ACTUAL_END_FIELD", INTEGER, 4, FieldKind.LAST_LONG),
    ("ROTATION", "DATA_START", INTEGER, 2, FieldKind.ROTATIONS),
)


def read(data: bytes, name: str = "motion") -> Motion:
    """The motion in a C3D file; ``name`` becomes its name.

    Raises SourceError, with the offset at fault. Signals: the points, their residuals, outputs,
    analog, rotations; all but the first only if the file has some.
    """
    order, start = find_parameters(data)
    parameters = parse_parameters(data, order, start)
    shape = find_shape(data, parameters)
    split = find_outputs(parameters, shape.n_points)
    layout = _layout(data, parameters, shape, split)
    recording = recording_of(layout)
    points, encoding = decode_texts(parameters.texts("POINT", "LABELS"))
    names = names_of(points, shape.n_points, "point")
    joints = tuple(Joint(names[number], channels=POSITION) for number in split.points)
    unit_cm = _unit_cm(parameters)
    skeleton = Skeleton(joints, unit_cm=unit_cm, angle_unit="", up_axis=recording.up_axis)
    rate, exact = rate_of(data, parameters)
    numbers = np.arange(shape.first, shape.first + shape.n_frames, dtype=np.int64)
    scale, note = _scale(data, parameters) if shape.word == 2 and shape.n_points else (1.0, "")
    notes = [*shape.notes, *([note] if note else [])]
    if len(points) < shape.n_points:
        notes.append(f"{len(points)} labels for {shape.n_points} points")
    metadata = {"source-note": "; ".join(notes)} if notes else {}
    if encoding != "utf-8":
        metadata["name-encoding"] = encoding
    grid = Grid(GridKind.SCALED, scale=scale)
    signals = [
        *_point_signals(data, parameters, shape, grid, [names[n] for n in split.order], split),
        *_other_signals(data, parameters, shape, recording.scaling),
    ]
    return Motion(
        skeleton,
        tuple(signals),
        rate,
        exact,
        name,
        metadata,
        _source(data, layout),
        None if shape.first == 1 or not shape.n_frames else numbers,
    )


def _unit_cm(parameters: Parameters) -> float | None:
    unit = next(iter(parameters.texts("POINT", "UNITS")), b"")
    return UNIT_CM.get(unit.decode("latin-1").strip().lower())


def rate_of(data: bytes, parameters: Parameters) -> tuple[Fraction | None, bool]:
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


def _words(data: bytes, parameters: Parameters, shape: DataShape) -> Items:
    """The data section, a row a frame."""
    kind = "i2" if shape.word == 2 else "u4"
    n_words = shape.n_frames * shape.frame_words
    words = np.frombuffer(data, f"{parameters.order.prefix}{kind}", n_words, shape.start)
    return words.reshape(shape.n_frames, shape.frame_words)


def _point_signals(
    data: bytes,
    parameters: Parameters,
    shape: DataShape,
    grid: Grid,
    names: list[str],
    split: Split,
) -> list[Signal]:
    """Points, residuals, outputs; ``grid`` is that of integer coordinates.

    ``names`` are those of all points in the order of their residuals.
    """
    words, raw = _words(data, parameters, shape), Grid(GridKind.INTEGER)
    if shape.word == 4:
        grid = raw = parameters.order.grid
    points = _signal("motion", words[:, _columns(split.points)], grid)
    if not shape.n_points:
        return [points]
    n_points = len(split.points)
    labels = tuple(Channel("", name) for name in names)
    residuals = _signal("residuals", words[:, 4 * split.order + 3], raw, labels)
    signals = [_mask_points(points, residuals.values[:, :n_points]), residuals]
    if len(split.outputs):
        channels = output_channels(parameters, names[n_points:])
        outputs = _signal(OUTPUTS, words[:, _columns(split.outputs)], grid, channels)
        signals.append(_mask_points(outputs, residuals.values[:, n_points:]))
    return signals


def _columns(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """The words of a frame that hold the coordinates of these points."""
    return (4 * points[:, None] + np.arange(3)).ravel()


def _other_signals(
    data: bytes, parameters: Parameters, shape: DataShape, scaling: Scaling | None
) -> list[Signal]:
    """Analog samples, whose words mean what ``scaling`` says, and rotations."""
    order, raw, signals = parameters.order, Grid(GridKind.INTEGER), []
    if shape.n_channels:
        words = _words(data, parameters, shape)
        samples = words[:, 4 * shape.n_points :].reshape(-1, shape.n_channels)
        if shape.word == 2 and is_unsigned(parameters):
            samples = samples.astype(np.int64) & 0xFFFF
        channels = _channels(parameters, shape)
        grid = order.grid if shape.word == 4 else raw
        analog = _signal("analog", samples, grid, channels, shape.subframes)
        signals.append(analog.in_units(scaling))
    if shape.n_rotations:
        n_words = shape.n_frames * shape.rotations_size // 4
        words = np.frombuffer(data, f"{order.prefix}u4", n_words, shape.rotations_at)
        channels = _rotation_channels(parameters, shape)
        samples = words.reshape(-1, len(channels))
        signals.append(_signal("rotations", samples, order.grid, channels, shape.ratio))
    return signals


def _signal(
    name: str,
    words: Items,
    grid: Grid,
    channels: tuple[Channel, ...] | None = None,
    per_frame: int = 1,
) -> Signal:
    """A signal of words as stored, integers or the bits of floats, with its role as its name."""
    grids = (grid,) * words.shape[1]
    values: Values = words.astype(np.int64)
    ordinals = None
    if grid.kind != GridKind.INTEGER:
        scaled = grid.kind == GridKind.SCALED
        ordinals = words.astype(np.int64) if scaled else grid.ordinals_of_bits(words)
        values = grid.values(ordinals)
    of = 0 if name == "residuals" else None
    return Signal(
        values, grids, name, per_frame, channels=channels, ordinals=ordinals, role=name, of=of
    )


def _mask_points(points: Signal, residuals: Values) -> Signal:
    """The points with their mask: valid if the residual is not negative and nothing is NaN."""
    valid = residuals >= 0
    if points.values.dtype == np.float64:
        nan = np.isnan(points.values)
        if nan.any():
            valid &= ~nan.reshape(*valid.shape, 3).any(axis=2)
    return points if valid.all() else replace(points, mask=np.repeat(valid, 3, axis=1))


def _channels(parameters: Parameters, shape: DataShape) -> tuple[Channel, ...]:
    """The analog channels. Names and units that are no UTF-8 are read as Latin-1."""
    labels, _ = decode_texts(parameters.texts("ANALOG", "LABELS"))
    units, _ = decode_texts(parameters.texts("ANALOG", "UNITS"))
    units += [""] * (shape.n_channels - len(units))
    names = names_of(labels, shape.n_channels, "channel")
    return tuple(Channel("", name, unit) for name, unit in zip(names, units, strict=False))


def _rotation_channels(parameters: Parameters, shape: DataShape) -> tuple[Channel, ...]:
    """Channels of every rotation: its matrix column by column, and its reliability."""
    labels, _ = decode_texts(parameters.texts("ROTATION", "LABELS"))
    elements = [f"m{row}{column}" for column in range(1, 5) for row in range(1, 5)]
    parts = (*elements, "reliability")
    assert len(parts) == ROTATION_WORDS
    names = names_of(labels, shape.n_rotations, "rotation")
    return tuple(Channel("", f"{name} {part}") for name in names for part in parts)


def _layout(data: bytes, parameters: Parameters, shape: DataShape, split: Split) -> C3dLayout:
    """All that lies around the data, and which fields count frames."""
    fields = [(WORD_OF_FIRST, FieldKind.FIRST), (WORD_OF_LAST, FieldKind.LAST)]
    for group, name, type_, size, kind in FIELDS:
        parameter = parameters.get(group, name)
        is_needed = kind != FieldKind.ROTATIONS or shape.n_rotations
        if parameter and is_needed and (parameter.type, len(parameter.data)) == (type_, size):
            fields.append((parameter.at, kind))
    gap, tail = b"", data[shape.stop :]
    if shape.n_rotations:
        gap = data[shape.stop : shape.rotations_at]
        tail = data[shape.rotations_at + shape.n_frames * shape.rotations_size :]
    return C3dLayout(
        parameters.order,
        shape.word,
        shape.n_points,
        shape.n_channels,
        shape.subframes if shape.n_channels else 1,
        shape.word == 2 and is_unsigned(parameters),
        shape.n_frames,
        shape.first,
        data[: shape.start],
        ordered_fields(fields, shape.start),
        shape.n_rotations,
        shape.ratio,
        gap,
        tail,
        split.runs,
    )


def _source(data: bytes, layout: C3dLayout) -> Source:
    template, detail = layout.build()
    digest = hashlib.sha256(data).digest()
    return Source(layout.format, template, detail, size=len(data), sha256=digest)


def write(motion: Motion) -> bytes:
    """The C3D file of ``motion``: its own source with its values, or a plain one.

    Raises MotionError for what C3D cannot say; see ``plain_c3d``.
    """
    if motion.source is None or motion.source.format not in (FORMAT, OUTPUTS_FORMAT):
        motion = plain_c3d(motion)
    assert motion.source is not None
    return restore_c3d(motion, motion.source)
