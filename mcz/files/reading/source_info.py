"""A clip's source file: its facts, its parts joined, and the meaning of its numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcz.container import payloads
from mcz.container.reader import Container
from mcz.errors import FormatError, UnsupportedError
from mcz.files.reading.signal_info import SignalInfo
from mcz.files.reading.views import pick_notes
from mcz.model.clock import SAME_RATE, usual_step
from mcz.model.motion import FrameNotes, Motion, Skeleton, Source
from mcz.model.signal import Scaling
from mcz.model.types import JsonObject
from mcz.sources import FORMATS, Format, format_by_id, recording_of

if TYPE_CHECKING:
    from mcz.sources.c3d.recording import Recording

ANALOG = "analog"  # the role of signals whose stored numbers a source may scale


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """Facts of a source file that need no restoring."""

    format: str
    path: str
    size: int
    sha256: bytes

    @property
    def suffixes(self) -> tuple[str, ...]:
        """The suffixes, in lower case, of its format, and that of its name."""
        own = PurePosixPath(self.path).suffix.lower()
        return (*FORMATS[self.format].suffixes, *([own] if own else []))


def source_facts(source: SourceInfo | Source | None) -> JsonObject:
    """Path, size and hash for documents, None without a source."""
    return {
        "source_path": source.path if source else None,
        "source_bytes": source.size if source else None,
        "source_sha256": source.sha256.hex() if source else None,
    }


def source_info(fields: payloads.Clip, cend: payloads.Cend | None) -> SourceInfo | None:
    """The facts in CLIP and CEND of a clip (None: it has no CEND); None without a source."""
    if not fields.source:
        return None
    source = fields.source
    digest = cend.source_sha256 if cend is not None else None
    name = format_by_id(source.format).name
    return SourceInfo(name, source.path, source.size, digest or b"")


def known_format(fields: payloads.Clip) -> Format | None:
    """The source format of a clip whose CLIP is ``fields``; None if unknown."""
    if not fields.source:
        return None
    try:
        return format_by_id(fields.source.format)
    except UnsupportedError:
        return None


def read_source(
    container: Container,
    fields: payloads.ClipSource,
    info: SourceInfo,
    signal: SignalInfo,
    frames: range,
) -> Source:
    """The source of the stored ``frames`` of a clip; ``fields`` are those of CLIP_SOURCE.

    ``signal`` is the clip's motion, whose segments contain the notes. Raises FormatError.
    """
    source_format = format_by_id(fields.format)
    template = container.template(fields.template, fields.format)
    return Source(
        format=info.format,
        template=template,
        detail=bytes(fields.detail),
        notes=_frame_notes(container, source_format, signal, frames),
        path=info.path,
        size=info.size,
        sha256=info.sha256,
    )


def _frame_notes(
    container: Container, source_format: Format, signal: SignalInfo, frames: range
) -> FrameNotes | None:
    if source_format.join_notes is None:
        return None
    base, parts = frames.start, []
    for row in (signal.rows[i] for i in signal.covering(frames.start, frames.stop)):
        table, streams = container.streams(row, signal.counts, None)
        index = table.frame_notes()
        part = b"" if index is None else streams[index]
        base = min(base, row.header.first)
        parts.append((row.header.first, row.header.stop, part))
    notes = source_format.join_notes([(a - base, b - base, part) for a, b, part in parts])
    whole = range(base, max((b for _, b, _ in parts), default=base))
    if frames == whole:
        return notes
    picked = range(frames.start - base, frames.stop - base, frames.step)
    return pick_notes(source_format.join_notes, notes, picked)


def sourced_skeleton(container: Container, id_: bytes) -> Skeleton:
    """The skeleton ``id_`` with its own source file, if it has one."""
    return replace(container.skeleton(id_), source=_skeleton_source(container, id_))


def _skeleton_source(container: Container, id_: bytes) -> Source | None:
    """The source file of the skeleton ``id_``, under the first name that the file has for it."""
    fields = container.skeleton_fields(id_)
    if not fields.source:
        return None
    source = fields.source
    own = (payloads.OF_SKELETON, id_)
    return Source(
        format=format_by_id(source.format, of_skeleton=True).name,
        template=container.template(bytes(source.template), source.format),
        path=next((n for n, alias in container.directory.aliases.items() if alias == own), ""),
        size=source.size,
        sha256=bytes(source.sha256),
    )


def stating_rate(motion: Motion, numbers: NDArray[np.int64] | None = None) -> Motion:
    """``motion`` with a source that states its rate; unchanged if it cannot, or states none.

    ``numbers``: all frame numbers of a clip that it is a part of. Raises FormatError on bad bytes.
    """
    source, rate = motion.source, motion.frame_rate
    if source is None or rate is None:
        return motion
    step = usual_step(motion.frame_numbers if numbers is None else numbers)
    restated = contradiction(source.format, source.template, rate, step)
    if restated is None:
        return motion
    return replace(motion, source=replace(source, template=restated.template))


def is_one_of(ratio: Fraction, step: int) -> bool:
    """Return whether two rates of this ratio agree, where frame numbers rise by ``step``."""
    return any(abs(ratio - n) <= SAME_RATE * n for n in (1, step))


def contradiction(format_name: str, template: bytes, rate: Fraction, step: int) -> Any:
    """The result of ``Format.restate`` if the template states another rate; else None."""
    restate = FORMATS[format_name].restate
    restated = restate(template, rate) if restate is not None else None
    return None if restated is None or is_one_of(restated.rate / rate, step) else restated


def recording(motion: Motion) -> Recording | None:
    """The facts that the source of ``motion`` states besides all numbers; None if there are none.

    Of a C3D: events, force platforms, units and descriptions. ``Clip.recording`` is a clip's.
    Raises FormatError on bad bytes.
    """
    source = motion.source
    return None if source is None else _on_clock(source, motion.frame_rate)


def _on_clock(source: Source, rate: Fraction | None) -> Recording | None:
    """The recording of a source, its times corrected if the clip's ``rate`` corrects its own."""
    recorded: Recording | None = recording_of(source)
    if recorded is None or rate is None:
        return recorded
    stated = contradiction(source.format, source.template, rate, 1)
    if stated is None or not stated.rate:
        return recorded
    factor = float(stated.rate / rate)
    events = tuple(replace(event, time=event.time * factor) for event in recorded.events)
    samples = recorded.analog_rate and recorded.analog_rate / factor
    return replace(recorded, events=events, analog_rate=samples)


def read_recording(
    container: Container, fields: payloads.Clip, rate: Fraction | None = None
) -> Recording | None:
    """The recording in the source of a clip, whose CLIP is ``fields``."""
    form = known_format(fields)
    source = fields.source
    if form is None or form.recording is None or source is None:
        return None
    template = container.template(source.template, source.format)
    return _on_clock(Source(form.name, template, bytes(source.detail)), rate)


def scaling_of(
    signals: Sequence[SignalInfo], index: int, recording: Callable[[], Recording | None]
) -> Scaling | None:
    """The scaling of the stored numbers of a signal; None if they are the values themselves."""
    analog = next((info for info in signals if info.role == ANALOG), None)
    if analog is None or analog.index != index:
        return None
    recorded = recording()
    scaling = None if recorded is None else recorded.scaling
    n_channels = analog.layout.n_channels
    if scaling is not None and len(scaling.scales) != n_channels:
        raise FormatError(
            f"source template: {len(scaling.scales)} analog channels, but signal {ANALOG!r} has "
            f"{n_channels}"
        )
    return scaling
