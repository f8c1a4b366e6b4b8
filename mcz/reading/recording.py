"""What a clip's source says beside all numbers, and what the stored numbers of a signal mean."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

from mcz.container import payloads
from mcz.container.reader import Container
from mcz.errors import FormatError, OptionError
from mcz.formats import recording_of
from mcz.formats.c3d_events import Event as Event
from mcz.formats.c3d_recording import ForcePlatform as ForcePlatform
from mcz.formats.c3d_recording import Recording as Recording
from mcz.motion import Motion, Source
from mcz.numbers.scaling import Scaling
from mcz.reading.signal_info import SignalInfo
from mcz.reading.source_info import known_format
from mcz.reading.source_rates import contradiction

ANALOG = "analog"  # the role of the signal whose stored numbers a source may have a meaning for


def recording(motion: Motion) -> Recording | None:
    """What the source of ``motion`` says beside all numbers; None where it says nothing.

    Of a C3D: events, force platforms, units and descriptions. ``Clip.recording`` is that of a clip.
    Raises FormatError on bad bytes.
    """
    source = motion.source
    return None if source is None else _on_clock(source, motion.frame_rate)


def _on_clock(source: Source, rate: Fraction | None) -> Recording | None:
    """The recording of a source, its times corrected where the clip's ``rate`` corrects its own."""
    found: Recording | None = recording_of(source)
    if found is None or rate is None:
        return found
    stated = contradiction(source.format, source.template, rate, 1)
    if stated is None or not stated.rate:
        return found
    factor = float(stated.rate / rate)
    events = tuple(replace(event, time=event.time * factor) for event in found.events)
    samples = found.analog_rate and found.analog_rate / factor
    return replace(found, events=events, analog_rate=samples)


def read_recording(
    container: Container, fields: payloads.Clip, rate: Fraction | None = None
) -> Recording | None:
    """The recording that the source of a clip, whose CLIP is ``fields``, tells of."""
    form = known_format(fields)
    source = fields.source
    if form is None or form.recording is None or source is None:
        return None
    template = container.template(source.template, source.format)
    return _on_clock(Source(form.name, template, bytes(source.detail)), rate)


def scaling_of(
    signals: Sequence[SignalInfo], index: int, recording: Callable[[], Recording | None]
) -> Scaling | None:
    """What the stored numbers of a signal mean; None where they are the values themselves."""
    analog = next((info for info in signals if info.role == ANALOG), None)
    if analog is None or analog.index != index:
        return None
    told = recording()
    scaling = None if told is None else told.scaling
    n_channels = analog.layout.n_channels
    if scaling is not None and len(scaling.scales) != n_channels:
        raise FormatError(
            f"source template: {len(scaling.scales)} analog channels, but signal {ANALOG!r} has "
            f"{n_channels}"
        )
    return scaling


def index_of(signals: Sequence[SignalInfo], name: str, clip: str) -> int:
    """The index of the first signal of a name; raises OptionError where the clip has none."""
    names = [info.name for info in signals]
    if name not in names:
        raise OptionError(f"clip {clip!r} has no signal {name!r}, but {', '.join(names)}")
    return names.index(name)
