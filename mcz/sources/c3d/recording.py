"""Recording metadata of C3D files: names, units, events, force platforms, screen axes.

All of it is in the header and the parameter section, which the template of a clip holds.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcz.model.motion import Source
from mcz.model.signal import Scaling
from mcz.sources.c3d.layout import C3dLayout, parse_layout
from mcz.sources.c3d.parameters import (
    BLOCK,
    FLOAT,
    MAX_BLOCKS,
    Parameters,
    decode_texts,
    groups_of,
    names_of,
    parse_parameters,
    unit_of,
)

Vector = tuple[float, float, float]
UNSIGNED = b"UNSIGNED"
UP = {sign + axis.upper(): axis for sign in ("+", "") for axis in "xyz"} | {
    f"-{axis.upper()}": f"-{axis}" for axis in "xyz"
}


@dataclass(frozen=True, slots=True)
class Point:
    """A point of a C3D file, or an output of a model.

    ``unit`` is that of its numbers, "" while unknown. ``groups`` are the lists of outputs that have
    it (ANGLES, FORCES, MOMENTS, POWERS, SCALARS), none for a point.
    """

    name: str
    description: str = ""
    unit: str = ""
    groups: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class AnalogChannel:
    """An analog channel of a C3D file.

    A value in ``unit``, "" while unknown, is (word - offset) * scale * general scale.
    """

    name: str
    description: str = ""
    unit: str = ""
    offset: float = 0.0
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class ForcePlatform:
    """A force platform of a C3D file; facts that the file lacks are () or None.

    ``type`` is that of FORCE_PLATFORM:TYPE (1 to 7, ...). ``corners`` are four, in the length unit
    and the axes of the points; ``origin`` is in the length unit and the axes of the platform.
    ``channels`` are its analog channels, counted from 1. ``calibration`` are the rows of its
    matrix, in the units of its channels.
    """

    type: int | None = None
    corners: tuple[Vector, ...] = ()
    origin: Vector | None = None
    channels: tuple[int, ...] = ()
    calibration: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Recording:
    """Recording metadata of a C3D file, unconverted.

    ``first_frame`` is the number of its first frame. ``unit`` is that of the points' coordinates,
    "" if unknown; ``analog_rate`` is in samples a second, None if unknown. ``general_scale`` is
    part of what every analog word means. ``x_screen`` and ``y_screen`` are the axes that point
    right and up on a screen, as printed ("+X", "-Z"), "" if unknown. ``zero_frames`` are the
    frames, from 1 on, in which no platform is loaded, None if the file does not state it.
    """

    first_frame: int
    unit: str = ""
    analog_rate: float | None = None
    general_scale: float = 1.0
    x_screen: str = ""
    y_screen: str = ""
    points: tuple[Point, ...] = ()
    analog: tuple[AnalogChannel, ...] = ()
    events: tuple[Event, ...] = ()
    platforms: tuple[ForcePlatform, ...] = ()
    zero_frames: tuple[int, int] | None = None

    @property
    def up_axis(self) -> str:
        """The axis that points up: "x" to "-z", or "" while that is unknown.

        It is that of POINT:Y_SCREEN, the axis that points up on a screen. An axis that is
        X_SCREEN's as well remains unknown.
        """
        up = UP.get(self.y_screen.upper(), "")
        return "" if up and self.x_screen.upper().endswith(up[-1].upper()) else up

    @property
    def scaling(self) -> Scaling | None:
        """Scaling of the analog signal; None if its words are the values."""
        offsets = np.array([channel.offset for channel in self.analog], np.float64)
        scales = np.array([channel.scale for channel in self.analog], np.float64)
        if not offsets.any() and (scales == 1).all() and self.general_scale == 1:
            return None
        return Scaling(offsets, scales, self.general_scale)


def recording(source_format: str, template: bytes, detail: bytes) -> Recording:
    """The recording that a clip's source tells of; raises FormatError on bad bytes."""
    return recording_of(parse_layout(source_format, template, detail))


def parameters_of(source_format: str, template: bytes, detail: bytes) -> Parameters:
    """The parameters of a clip's source; raises FormatError on bad bytes."""
    return _parameters(parse_layout(source_format, template, detail))


def recording_of(layout: C3dLayout) -> Recording:
    """The recording in the header and the parameter section of a file."""
    parameters = _parameters(layout)
    return Recording(
        layout.first,
        _text(parameters, "POINT", "UNITS"),
        parameters.number("ANALOG", "RATE"),
        next(iter(parameters.numbers("ANALOG", "GEN_SCALE")), 1.0),
        _text(parameters, "POINT", "X_SCREEN"),
        _text(parameters, "POINT", "Y_SCREEN"),
        tuple(_points(parameters, layout.n_points)),
        tuple(_channels(parameters, layout.n_channels)),
        find_events(layout.head, parameters),
        tuple(_platforms(parameters)),
        _zero_frames(parameters),
    )


def with_analog_scales(source: Source, scales: Mapping[int, float]) -> Source | None:
    """``source`` with other scales of analog channels; None if it does not state theirs."""
    layout = parse_layout(source.format, source.template, source.detail)
    parameters, head = _parameters(layout), bytearray(layout.head)
    places: list[int] = []
    number = 1
    while stated := parameters.get("ANALOG", f"SCALE{number}" if number > 1 else "SCALE"):
        if stated.type != FLOAT or head[stated.at : stated.at + len(stated.data)] != stated.data:
            return None
        places += range(stated.at, stated.at + len(stated.data), 4)
        number += 1
    if max(scales, default=0) >= len(places):
        return None
    for channel, scale in scales.items():
        head[places[channel] : places[channel] + 4] = layout.order.build_real(scale)
    template, detail = replace(layout, head=bytes(head)).build()
    return replace(source, template=template, detail=detail)


def _parameters(layout: C3dLayout) -> Parameters:
    """The parameter section, before or after the data; empty if there is none."""
    head = layout.head
    none = Parameters(layout.order, 0, {}, 0)
    if len(head) < BLOCK:
        return none
    start = (head[0] - 1) * BLOCK
    if BLOCK <= start <= len(head) - 4:
        return parse_parameters(head, layout.order, start)
    start -= layout.behind
    if not 0 <= start <= len(layout.tail) - 4:
        return none
    section = layout.tail[start : start + MAX_BLOCKS * BLOCK]
    return parse_parameters(head[:BLOCK] + section, layout.order, BLOCK)


def _text(parameters: Parameters, group: str, name: str) -> str:
    return next(iter(decode_texts(parameters.texts(group, name))[0]), "")


def _pad_texts(texts: Sequence[str], n: int) -> list[str]:
    return [*texts[:n], *[""] * (n - len(texts))]


def _points(parameters: Parameters, n: int) -> Iterator[Point]:
    labels = [*parameters.texts("POINT", "LABELS")[:n]]
    names = names_of(decode_texts(labels)[0], n, "point")
    labels += [b""] * (n - len(labels))
    descriptions = _pad_texts(decode_texts(parameters.texts("POINT", "DESCRIPTIONS"))[0], n)
    unit, groups = _text(parameters, "POINT", "UNITS"), groups_of(parameters)
    for name, label, description in zip(names, labels, descriptions, strict=True):
        own = groups.get(label, ())
        yield Point(name, description, unit_of(parameters, own) if own else unit, own)


def _channels(parameters: Parameters, n: int) -> Iterator[AnalogChannel]:
    names = names_of(decode_texts(parameters.texts("ANALOG", "LABELS"))[0], n, "channel")
    descriptions = _pad_texts(decode_texts(parameters.texts("ANALOG", "DESCRIPTIONS"))[0], n)
    units = _pad_texts(decode_texts(parameters.texts("ANALOG", "UNITS"))[0], n)
    offsets = [_offset(parameters, number) for number in parameters.numbers("ANALOG", "OFFSET")]
    offsets = [*offsets[:n], *[0.0] * (n - len(offsets))]
    scales = parameters.numbers("ANALOG", "SCALE")[:n]
    scales += [1.0] * (n - len(scales))
    yield from map(AnalogChannel, names, descriptions, units, offsets, scales)


def _offset(parameters: Parameters, number: float) -> float:
    """An offset, signed if the words are.

    -32768 is the middle of 16 bits without a sign, whatever ANALOG:FORMAT says.
    """
    if number < 0 and (is_unsigned(parameters) or number == -0x8000):
        return number + 0x10000
    return number


def is_unsigned(parameters: Parameters) -> bool:
    """Return True if the file declares analog integers unsigned."""
    texts = parameters.texts("ANALOG", "FORMAT")
    return bool(texts) and texts[0].upper() == UNSIGNED


def _platforms(parameters: Parameters) -> Iterator[ForcePlatform]:
    numbers = {
        name: parameters.numbers("FORCE_PLATFORM", name)
        for name in ("TYPE", "CORNERS", "ORIGIN", "CHANNEL", "CAL_MATRIX")
    }
    used = parameters.count("FORCE_PLATFORM", "USED") or 0
    widths = {"TYPE": 1, "CORNERS": 12, "ORIGIN": 3}
    described = max(len(numbers[name]) // width for name, width in widths.items())
    n_channels, _ = _dimensions(parameters, "CHANNEL")
    rows, columns = _dimensions(parameters, "CAL_MATRIX")
    for number in range(min(used, described)):
        type_ = _item(numbers["TYPE"], number, 1)
        corners = _vectors(_item(numbers["CORNERS"], number, 12))
        origin = _vectors(_item(numbers["ORIGIN"], number, 3))
        channels = _item(numbers["CHANNEL"], number, n_channels)
        matrix = _item(numbers["CAL_MATRIX"], number, rows * columns)
        yield ForcePlatform(
            _whole(type_[0]) if type_ else None,
            corners,
            origin[0] if origin else None,
            tuple(map(_whole, channels)),
            tuple(tuple(matrix[row::rows]) for row in range(rows)) if matrix else (),
        )


def _whole(number: float) -> int:
    return int(number) if np.isfinite(number) else 0


def _dimensions(parameters: Parameters, name: str) -> tuple[int, int]:
    """The first two dimensions of a parameter of platforms, 0 if it has none."""
    parameter = parameters.get("FORCE_PLATFORM", name)
    dims = (*(parameter.dims if parameter else ()), 0, 0)
    return dims[0], dims[1]


def _item(numbers: Sequence[float], index: int, size: int) -> Sequence[float]:
    """Item ``index`` of ``size`` numbers; empty if it is incomplete."""
    item = numbers[index * size : (index + 1) * size]
    return item if len(item) == size else []


def _vectors(numbers: Sequence[float]) -> tuple[Vector, ...]:
    return tuple((x, y, z) for x, y, z in zip(*[iter(numbers)] * 3, strict=True))


def _zero_frames(parameters: Parameters) -> tuple[int, int] | None:
    """The two frame numbers of FORCE_PLATFORM:ZERO, of which 0 and less mean none."""
    parameter = parameters.get("FORCE_PLATFORM", "ZERO")
    if parameter is None or parameter.type != 2 or len(parameter.data) < 4:
        return None
    first, last = struct.unpack_from(f"{parameters.order.prefix}2H", parameter.data)
    return (first, last) if 0 < first <= last else None


KEY = 12_345  # states that labels in the header have four characters
WORD_OF_KEY, WORD_OF_COUNT = 298, 300  # offsets in the header
TIMES, LABELS = 304, 396
MOST = 18  # events in a header
LABEL = 4  # bytes


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened during a recording.

    ``time`` is in seconds on the clock of the frames, ``mcz.times``: frame number 1 is at 0.
    ``context`` is the side or sort ("Left", "Right", "General"), ``subject`` who did it,
    ``description`` what the label means; each is "" if the file does not say.
    """

    label: str
    time: float
    context: str = ""
    subject: str = ""
    description: str = ""


def find_events(header: bytes, parameters: Parameters) -> tuple[Event, ...]:
    """The events, in the order of the file."""
    return _of_parameters(parameters) or _of_header(header, parameters)


def event_times(header: bytes, parameters: Parameters) -> Iterator[int]:
    """Offsets in ``header`` of the binary32 times of events: minutes and seconds, or seconds."""
    times = parameters.get("EVENT", "TIMES")
    if times is not None and times.type == FLOAT:
        yield from range(times.at, times.at + len(times.data), 4)
    if parameters.order.integer(header, WORD_OF_KEY) == KEY:
        n_events = min(parameters.order.integer(header, WORD_OF_COUNT), MOST)
        yield from range(TIMES, TIMES + 4 * n_events, 4)


def _of_parameters(parameters: Parameters) -> tuple[Event, ...]:
    """TIMES holds minutes and seconds; some files hold seconds alone."""
    times = parameters.numbers("EVENT", "TIMES")
    parameter = parameters.get("EVENT", "TIMES")
    if parameter is not None and len(parameter.dims) > 1 and parameter.dims[0] == 2:
        times = [60 * m + s for m, s in zip(times[::2], times[1::2], strict=False)]
    used = parameters.count("EVENT", "USED")
    times = times if used is None else times[:used]
    columns = [
        decode_texts(parameters.texts("EVENT", name))[0]
        for name in ("LABELS", "CONTEXTS", "SUBJECTS", "DESCRIPTIONS")
    ]
    filled = ([*texts, *[""] * len(times)] for texts in columns)
    return tuple(
        Event(label, time, *more) for time, label, *more in zip(times, *filled, strict=False)
    )


def _of_header(header: bytes, parameters: Parameters) -> tuple[Event, ...]:
    order = parameters.order
    if order.integer(header, WORD_OF_KEY) != KEY:
        return ()
    n_events = min(order.integer(header, WORD_OF_COUNT), MOST)
    labels = [header[LABELS + LABEL * k :][:LABEL].strip(b" \0") for k in range(n_events)]
    times = [order.real(header, TIMES + 4 * k) for k in range(n_events)]
    return tuple(map(Event, decode_texts(labels)[0], times))
