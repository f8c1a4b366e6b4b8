"""What two motions say beside their numbers, where it is not the same: events, parameters, ..."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from mcz.formats import FORMATS, arrays_of
from mcz.formats.c3d_events import Event
from mcz.formats.c3d_parameters import TEXT, Parameter, Parameters
from mcz.formats.c3d_recording import parameters_of
from mcz.motion import Motion
from mcz.reading.recording import ForcePlatform, recording

# Parameters that say where data lie and which frames there are, which is compared by itself.
OF_DATA = {"DATA_START", "FRAMES", "LONG_FRAMES", "ACTUAL_START_FIELD", "ACTUAL_END_FIELD"}
OF_READERS = {"source-note", "skeleton-note", "name-encoding", "frame-numbers"}


@dataclass(frozen=True, slots=True)
class Difference:
    """Something that two motions do not say alike: what each says, or how many of it each has.

    Of things with names or texts: which one alone has, and which are not the same in both.
    """

    what: str
    a: str | int | float | None
    b: str | int | float | None
    only_in_a: tuple[str, ...] = ()
    only_in_b: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()


def document_of(a: Motion, b: Motion) -> list[dict[str, Any]]:
    """The differences as JSON has them."""
    return [asdict(each) for each in differences(a, b)]


def differences(a: Motion, b: Motion) -> list[Difference]:
    """The differences of ``b`` from ``a`` beside their numbers; raises FormatError on bad bytes."""
    facts, things = (_facts(a), _facts(b)), (_things(a), _things(b))
    found = [
        Difference(what, facts[0][what], facts[1][what])
        for what in facts[0]
        if facts[0][what] != facts[1][what]
    ]
    for one, other in (things, things[::-1]):  # a group that is not there is enough to say
        groups = other["groups of parameters"]
        both = {key: value for key, value in one["parameters"].items() if key[0] in groups}
        one["parameters"] = {f"{group}:{name}": value for (group, name), value in both.items()}
    found += filter(None, (_compared(what, things[0][what], things[1][what]) for what in things[0]))
    if not found and _is_printed_otherwise(a, b):
        found.append(Difference("header or layout of the files", None, None))
    return found


def _compared(what: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> Difference | None:
    only_a, only_b = (tuple(name for name in x if name not in y) for x, y in ((a, b), (b, a)))
    changed = tuple(name for name in a if name in b and repr(a[name]) != repr(b[name]))
    if not (only_a or only_b or changed):
        return None
    return Difference(what, len(a), len(b), only_a, only_b, changed)


def _facts(motion: Motion) -> dict[str, str | int | float | None]:
    """Single things that a motion says."""
    numbers, rate, bones = motion.frame_numbers, motion.frame_rate, motion.skeleton
    return {
        "first frame": 1 if numbers is None or not len(numbers) else int(numbers[0]),
        "frame rate": None if rate is None else float(rate),
        "unit in cm": bones.unit_cm,
        "up axis": bones.up_axis or None,
    }


def _things(motion: Motion) -> dict[str, dict[Any, Any]]:
    """Things of which a motion may have several, by name or by what they say."""
    parameters, told = _parameters(motion), recording(motion)
    arrays = arrays_of(motion.source, [signal.name for signal in motion.signals]) or ()
    return {
        "signals": {s.name: (s.n_channels, s.samples_per_frame) for s in motion.signals},
        "events": {} if told is None else dict(_events(told.events)),
        "force platforms": {} if told is None else dict(_platforms(told.platforms)),
        "groups of parameters": {group: None for group, _ in parameters},
        "parameters": parameters,
        "arrays": {str(array["name"]): array["type"] for array in arrays},
        "metadata": {k: v for k, v in motion.metadata.items() if k not in OF_READERS},
    }


def _platforms(platforms: Iterable[ForcePlatform]) -> Iterator[tuple[str, ForcePlatform]]:
    return ((f"platform {number}", platform) for number, platform in enumerate(platforms, 1))


def _events(events: Iterable[Event]) -> Iterator[tuple[str, Event]]:
    """Each event under its words and time; of those that are the same each has a number."""
    seen: Counter[str] = Counter()
    for event in events:
        words = " ".join(filter(None, (event.subject, event.context, event.label)))
        text = f"{words} at {event.time:.6g} s"
        seen[text] += 1
        yield text if seen[text] == 1 else f"{text} #{seen[text]}", event


def _parameters(motion: Motion) -> dict[tuple[str, str], Any]:
    """The parameters of a C3D by group and name; of another file none."""
    source = motion.source
    if source is None or FORMATS[source.format].recording is None:
        return {}
    held = parameters_of(source.format, source.template, source.detail)
    return {
        (group, name): _value(held, parameter)
        for (group, name), parameter in held.found.items()
        if name not in OF_DATA
    }


def _value(held: Parameters, parameter: Parameter) -> Any:
    """Type, dimensions and values, whatever the byte order."""
    if parameter.type == TEXT:
        return parameter.type, parameter.dims, parameter.data
    return parameter.type, parameter.dims, held.numbers_of(parameter)


def _is_printed_otherwise(a: Motion, b: Motion) -> bool:
    """Whether two sources of one format differ in what is neither a number nor named above."""
    one, other = a.source, b.source
    if one is None or other is None or one.format != other.format:
        return False
    return one.template != other.template
