"""Differences between an output and the source file of its clip, and between two motions.

An output gets one word, and notes on its times; motions are compared except for their values:
events, parameters, metadata, times.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from mcz.errors import FormatError
from mcz.files.reading.clip import Clip
from mcz.files.reading.source_files import contradiction, is_one_of, recording
from mcz.model.clock import TOLERANCE, numbers_or_rows, usual_step
from mcz.model.motion import Motion
from mcz.model.types import JsonObject, Params
from mcz.sources import FORMATS, arrays_of, format_by_id

if TYPE_CHECKING:
    from mcz.sources.c3d.parameters import C3dParameter, Parameters
    from mcz.sources.c3d.recording import Event

RESTORED = "restored"  # the file whose SHA-256 is stored, byte for byte
CUT = "cut"  # some of its frames, with all numbers unchanged
LOSSY = "lossy"  # approximate numbers, printed like the source's
FILTERED = "filtered"  # numbers of a post filter
SALVAGED = "salvaged"  # its intact parts
CONVERTED = "converted"  # a file of another format, or numbers
GIVEN_BACK = (RESTORED, CUT, LOSSY)  # words for all of a clip


def fidelity_of(clip: Clip) -> str:
    """The word for the file that all of ``clip`` restores; the file of a sound clip is checked."""
    record: Mapping[str, str] = {}
    with suppress(FormatError):  # of a damaged file
        record = clip.quality or {}
    if "cut-resolution" in record or not all(info.codec.lossless for info in clip.signals):
        return LOSSY
    return CUT if "cut-frames" in record else RESTORED


# With neither times, unless in an array, nor frame numbers.
UNTIMED = ("bvh", "npy", "npz", "pickle", "torch")


def _rate_note(clip: Clip, is_file: bool) -> str | None:
    """A note if the result of ``source_bytes`` states another rate than ``clip``.

    ``is_file``: it is the original file. Raises FormatError on bad bytes.
    """
    rate = clip.frame_rate
    if rate is None or clip.source is None:
        return None
    stated = _stated_rate(clip, rate, is_file=is_file)
    if stated is None:
        return None
    label = f"{float(stated):g} frames a second" if stated else "no frame rate"
    return f"its source states {label}, the clip has {float(rate):g}"


def _start_note(clip: Clip, start: int, is_file: bool) -> str | None:
    """A note if a part from frame ``start`` on is printed without the time of that frame.

    ``is_file``: the text is the original file, which never stated it.
    """
    source = clip.source
    if source is None or source.format not in UNTIMED or start >= clip.n_frames:
        return None
    if clip.timeline is None or clip.times_column() is not None or clip.times[start] == 0:
        return None
    if is_file and fidelity_of(clip) == RESTORED:
        return None
    name = source.format.upper()
    return f"left out: the time of the first frame, {clip.times[start]:.6g} s: {name} begins at 0 s"


def text_notes(clip: Clip, start: int = 0, *, is_file: bool | None = None) -> tuple[str, ...]:
    """All notes of the text of ``clip`` from frame ``start`` on; ``is_file``: None: of all."""
    is_file = clip.can_restore() if is_file is None else is_file
    notes = _rate_note(clip, is_file), _start_note(clip, start, is_file)
    return tuple(note for note in notes if note)


def states_rate(clip: Clip) -> bool:
    """Return whether the source of ``clip`` states a frame rate; raises FormatError."""
    rate, source = clip.frame_rate, clip.source
    if rate is None or source is None or not FORMATS[source.format].states_rate:
        return False
    stated_rate, _ = _read_contradiction(clip, rate)
    return stated_rate is None or bool(stated_rate.rate)


def _stated_rate(clip: Clip, rate: Fraction, *, is_file: bool) -> Fraction | None:
    """The rate that the text states, None if it is the clip's or absent."""
    try:
        stated_rate, template = _read_contradiction(clip, rate)
    except FormatError:
        if not clip.container.salvage:
            raise
        return None  # its loss is already reported
    if stated_rate is not None:
        stated: Fraction = stated_rate.rate
        return stated if is_file or stated_rate.template == template else None
    column = clip.times_column()
    if column is None:
        return None
    from mcz.sources.tables.times import rate_of_times

    own, _ = rate_of_times(column.times, [column.rounding])
    step = usual_step(clip.frame_numbers)
    return own if own is not None and not is_one_of(own / rate, step) else None


def _read_contradiction(clip: Clip, rate: Fraction) -> tuple[Any, bytes]:
    """The ``contradiction`` of the template of a clip, and the template."""
    source = clip._fields.source
    assert source is not None
    template = clip.container.template(source.template, source.format)
    name, step = format_by_id(source.format).name, usual_step(clip.frame_numbers)
    return contradiction(name, template, rate, step), template


# Parameters of the place and extent of the data; frames are compared separately.
LAYOUT = {"DATA_START", "FRAMES", "LONG_FRAMES", "ACTUAL_START_FIELD", "ACTUAL_END_FIELD"}
READER_METADATA = {"source-note", "skeleton-note", "name-encoding"}


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference: the value in each motion, or the count of things.

    For named things: names only in a, only in b, and in both but different.
    """

    what: str
    a: str | int | float | None
    b: str | int | float | None
    only_in_a: tuple[str, ...] = ()
    only_in_b: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()


def document_of(a: Motion, b: Motion) -> list[JsonObject]:
    return [asdict(each) for each in differences(a, b)]


def differences(a: Motion, b: Motion) -> list[Difference]:
    """The differences of ``b`` from ``a`` other than of values; raises FormatError on bad bytes."""
    facts, things = (_single_values(a), _single_values(b)), (_collections(a), _collections(b))
    result = [
        Difference(fact, facts[0][fact], facts[1][fact])
        for fact in facts[0]
        if facts[0][fact] != facts[1][fact]
    ]
    if facts[0]["first frame"] == facts[1]["first frame"]:
        result += _time_differences(
            a, b, is_rate_same=facts[0]["frame rate"] == facts[1]["frame rate"]
        )
    names = [list(side["joints"]) for side in things]
    if sorted(names[0]) == sorted(names[1]) and names[0] != names[1]:
        result.append(Difference("order of joints", None, None))
    for one, other in (things, things[::-1]):  # parameters of a missing group are not listed
        groups = other["groups of parameters"]
        both = {key: value for key, value in one["parameters"].items() if key[0] in groups}
        one["parameters"] = {f"{group}:{name}": value for (group, name), value in both.items()}
    result += filter(None, (_compare(fact, things[0][fact], things[1][fact]) for fact in things[0]))
    if not result and (fact := _source_difference(a, b)):
        result.append(Difference(fact, None, None))
    return result


def _time_differences(a: Motion, b: Motion, *, is_rate_same: bool) -> Iterator[Difference]:
    """Differences of frame numbers and times beyond the first frame's number and the rate."""
    numbers = numbers_or_rows(a.frame_numbers, a.n_frames)
    if not np.array_equal(numbers, numbers_or_rows(b.frame_numbers, b.n_frames)):
        yield Difference("frame numbers", None, None)
        return
    one, other = a.timeline, b.timeline
    if one is None or other is None or not is_rate_same or len(one.times) != len(other.times):
        return
    errors = np.abs(one.regular_times - other.regular_times)
    allowed = one.rounding + other.rounding + TOLERANCE
    if (errors[:1] > allowed).any():
        first, others = float(one.regular_times[0]), float(other.regular_times[0])
        yield Difference("time of the first frame in s", first, others)
    elif (errors > allowed).any():
        yield Difference("times", None, None)


def _compare(fact: str, a: Params, b: Params) -> Difference | None:
    only_a, only_b = (tuple(name for name in x if name not in y) for x, y in ((a, b), (b, a)))
    changed = tuple(name for name in a if name in b and repr(a[name]) != repr(b[name]))
    if not (only_a or only_b or changed):
        return None
    return Difference(fact, len(a), len(b), only_a, only_b, changed)


def _single_values(motion: Motion) -> dict[str, str | int | float | None]:
    numbers, rate, skeleton = motion.frame_numbers, motion.frame_rate, motion.skeleton
    return {
        "first frame": 1 if numbers is None or not len(numbers) else int(numbers[0]),
        "frame rate": None if rate is None else float(rate),
        "unit in cm": skeleton.unit_cm,
        "up axis": skeleton.up_axis or None,
        "forward axis": skeleton.forward_axis or None,
        "handedness": skeleton.handedness or None,
    }


def _collections(motion: Motion) -> dict[str, dict[Any, Any]]:
    """Counted facts of a motion, such as events, by name or by text."""
    parameters, recorded = _parameters(motion), recording(motion)
    arrays = arrays_of(motion.source, [signal.name for signal in motion.signals]) or ()
    platforms = () if recorded is None else recorded.platforms
    skeleton = motion.skeleton
    names = skeleton.addresses()
    return {
        "joints": {
            name: (names[joint.parent] if joint.parent >= 0 else "", joint.channels)
            for name, joint in zip(names, skeleton.joints, strict=True)
        },
        "signals": {
            s.name: (s.n_channels, s.samples_per_frame, s.channels) for s in motion.signals
        },
        "events": {} if recorded is None else dict(_events(recorded.events)),
        "force platforms": {f"platform {n}": one for n, one in enumerate(platforms, 1)},
        "groups of parameters": {group: None for group, _ in parameters},
        "parameters": parameters,
        "arrays": {str(array["name"]): array["type"] for array in arrays},
        "metadata": {k: v for k, v in motion.metadata.items() if k not in READER_METADATA},
    }


def _events(events: Iterable[Event]) -> Iterator[tuple[str, Event]]:
    """Events by words and time; the second of equal texts gets #1."""
    counts: Counter[str] = Counter()
    for event in events:
        words = " ".join(filter(None, (event.subject, event.context, event.label)))
        text = f"{words} at {event.time:.6g} s"
        yield f"{text} #{counts[text]}" if text in counts else text, event
        counts[text] += 1


def _parameters(motion: Motion) -> dict[tuple[str, str], Any]:
    """The parameters of a C3D by group and name; none for another file."""
    source = motion.source
    if source is None or FORMATS[source.format].recording is None:
        return {}
    from mcz.sources.c3d.recording import parameters_of

    parameters = parameters_of(source.format, source.template, source.detail)
    return {
        (group, name): _value(parameters, parameter)
        for (group, name), parameter in parameters.found.items()
        if name not in LAYOUT
    }


def _value(parameters: Parameters, parameter: C3dParameter) -> Any:
    from mcz.sources.c3d.parameters import TEXT

    if parameter.type == TEXT:
        return parameter.type, parameter.dims, parameter.data
    return parameter.type, parameter.dims, parameters.numbers_of(parameter)


def _source_difference(a: Motion, b: Motion) -> str:
    """A name for the difference of two sources whose values are equal, "" if there is none."""
    one, other = a.source, b.source
    if one is None or other is None or one.format != other.format:
        return ""
    if one.template != other.template:
        return "header or layout of the files"
    numbers = [[signal.masked() for signal in motion.signals] for motion in (a, b)]
    if not all(np.array_equal(x, y, equal_nan=True) for x, y in zip(*numbers, strict=True)):
        return ""  # changed values change the layout, which is no difference of its own
    notes = [source.notes and source.notes.cut(0, a.n_frames) for source in (one, other)]
    if (one.detail, notes[0]) == (other.detail, notes[1]):
        return ""
    has_arrays = FORMATS[one.format].arrays is not None
    return "arrays other than the signals" if has_arrays else "texts or layout of the rows"
