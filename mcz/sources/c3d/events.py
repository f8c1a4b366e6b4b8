"""The events of a C3D file: those of its group EVENT, else those of its header."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mcz.sources.c3d.parameters import FLOAT, Parameters, decode_texts

KEY = 12_345  # says that labels in the header have four characters
WORD_OF_KEY, WORD_OF_COUNT = 298, 300  # offsets in the header
TIMES, LABELS = 304, 396
MOST = 18  # events in a header
LABEL = 4  # bytes


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened during a recording.

    ``time`` is in seconds on the clock of the frames, ``mcz.times``: frame number 1 is at 0.
    ``context`` is the side or sort ("Left", "Right", "General"), ``subject`` who did it,
    ``description`` what the label means; each is "" where the file does not say.
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
