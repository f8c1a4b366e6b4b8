"""Source files: read from disk, with facts from the caller, and those that clips store.

For a stored one: its facts, its joined parts, and the meaning of its numbers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mcz.container import payloads
from mcz.container.reader import Container
from mcz.errors import FormatError, MczError, OptionError, SourceError, UnsupportedError, reason_of
from mcz.files.reading.signal_info import SignalInfo
from mcz.files.reading.views import pick_notes
from mcz.model.checks import PATH, check_arguments
from mcz.model.clock import SAME_RATE, usual_step
from mcz.model.motion import A_MOTION, FrameNotes, Motion, Skeleton, Source
from mcz.model.signal import Scaling
from mcz.model.text_format import compression_remark
from mcz.model.types import JsonObject
from mcz.model.units import in_unit, unit_cm_of, with_axes
from mcz.sources import (
    FORMATS,
    HEAD_BYTES,
    Format,
    format_by_id,
    format_of,
    has_known_suffix,
    likely_formats,
    recording_of,
)

if TYPE_CHECKING:
    from mcz.sources.c3d.recording import Recording


@check_arguments(path=PATH)
def read_skeleton(path: str | os.PathLike[str]) -> Skeleton:
    """The skeleton in an ASF file, with its source."""
    path = Path(path)
    source_format, data = load(path)
    if not source_format.is_skeleton:
        raise OptionError("the file is not a skeleton", path=path)
    skeleton: Skeleton = _read_with(path, source_format.read, data, path.stem)
    if skeleton.source is None:
        return skeleton
    return replace(skeleton, source=replace(skeleton.source, path=path.name))


def load(path: Path) -> tuple[Format, bytes]:
    """The format of a source file, see ``format_of``, and its bytes; raises SourceError."""
    if not has_known_suffix(path):  # refused with any content
        format_of(path, _start_of(path))
    data = read_bytes(path)
    return format_of(path, data), data


def content_note(path: str | os.PathLike[str], source_format: Format) -> str:
    """A remark on a file whose suffix does not fit its format, "" if it does."""
    suffix = Path(path).suffix.lower()
    if suffix in source_format.suffixes:
        return ""
    return f"its content is {source_format.suffix[1:].upper()}, but its suffix is {suffix}"


def read_source(
    path: Path, source_format: Format, skeleton: Skeleton | None, data: bytes
) -> Motion:
    """The motion in the bytes ``data`` of the file ``path``."""
    from mcz.sources.tables.motion_bids import MOTION_SUFFIX, with_side_files

    arguments = (skeleton,) if source_format.wants_skeleton else ()
    motion: Motion = _read_with(path, source_format.read, data, path.stem, *arguments)
    if path.name.endswith(MOTION_SUFFIX):
        motion = with_side_files(motion, path)
    if note := content_note(path, source_format):
        notes = filter(None, (note, motion.metadata.get("source-note", "")))
        metadata = dict(motion.metadata) | {"source-note": "; ".join(notes)}
        motion = replace(motion, metadata=metadata)
    if motion.source is None:
        return motion
    return replace(motion, source=replace(motion.source, path=path.name))


def _read_with(path: Path, reader: Any, data: bytes, *arguments: object) -> Any:
    if not data:
        raise SourceError("the file is empty", path=path)
    try:
        return reader(data, *arguments)
    except MczError as error:
        error.add(path=path, note=_other_content(path, data))
        raise


def _other_content(path: Path, data: bytes) -> str | None:
    """A note if an unreadable file is compressed, or begins like one of another suffix."""
    if remark := compression_remark(data):
        return remark
    formats = [FORMATS[name] for name in likely_formats(data)]
    suffixes = [
        known.suffix for known in formats if known.is_motion is None or known.is_motion(data)
    ]
    return (
        f"it looks like {suffixes[0]}" if suffixes and path.suffix.lower() not in suffixes else None
    )


def _start_of(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except OSError:
        return b""


def read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SourceError(reason_of(error), path=path) from None


@dataclass(frozen=True, slots=True)
class SourceOptions:
    """Facts about a source file that its caller states.

    ``skeleton`` is the ASF of an AMC, "none" for none. ``rate`` in frames a second, ``unit``,
    ``up``, the axis that points up ("y", "-z"), ``forward``, the facing of a figure, and
    ``handedness`` ("right", "left") apply if the file states none; ``force_rate``: the rate applies
    also if the file states one. ``arrays`` is the meaning of plain arrays, ``model`` has the
    lengths of bones of bodies, see ``mcz.read``. ``verbatim``: a file that cannot be parsed is kept
    as an attachment. ``keep_skeleton``: an ASF is restored as well, under its own name. ``flat``: a
    file with several possible skeletons nearby is read without one. Raises OptionError for an
    unknown unit, axis, kind of arrays, or a rate that is not a positive number.
    """

    skeleton: str | os.PathLike[str] | None = None
    rate: Fraction | float | None = None
    force_rate: bool = True
    unit: str | None = None
    up: str | None = None
    arrays: str | None = None
    model: str | os.PathLike[str] | None = None
    verbatim: bool = False
    keep_skeleton: bool = False
    flat: bool = False
    forward: str | None = None
    handedness: str | None = None

    def __post_init__(self) -> None:
        if self.rate is not None:
            parse_rate(self.rate)
        if self.unit is not None:
            unit_cm_of(self.unit)
        with_axes(Skeleton(()), *self.axes)
        if self.arrays is not None:
            from mcz.sources.arrays.skeletons import kinds_of

            kinds_of(self.arrays)

    @property
    def axes(self) -> tuple[str | None, str | None, str | None]:
        """The stated axes, as ``facing`` takes them."""
        return self.up, self.forward, self.handedness

    def applied_to(self, motion: Motion) -> Motion:
        """``motion`` with the facts that are stated; raises MotionError for arrays that differ."""
        if self.arrays is not None:
            from mcz.sources.arrays.skeletons import with_kinds

            motion = with_kinds(motion, self.arrays)
        if self.model is not None:
            from mcz.sources.arrays.body_models import with_model

            motion = with_model(motion, self.model)
        if self.rate is not None and (self.force_rate or motion.frame_rate is None):
            rate = parse_rate(self.rate)
            motion = motion.at_rate(rate)
        if self.unit is not None:
            motion = replace(motion, skeleton=in_unit(motion.skeleton, self.unit))
        if any(self.axes):
            motion = replace(motion, skeleton=with_axes(motion.skeleton, *self.axes))
        return motion

    def complete(self, motion: Motion) -> Motion:
        """``motion`` with the facts that it lacks."""
        skeleton = motion.skeleton
        unknown = replace(
            self,
            force_rate=False,
            unit=self.unit if skeleton.unit_cm is None else None,
            up=None if skeleton.up_axis else self.up,
            forward=None if skeleton.forward_axis else self.forward,
            handedness=None if skeleton.handedness else self.handedness,
        )
        return unknown.applied_to(motion)


def parse_rate(rate: Fraction | float) -> Fraction:
    """``rate`` as a Fraction; raises OptionError unless it is a positive number."""
    try:
        exact = rate if isinstance(rate, Fraction) else Fraction(float(rate))
        value = exact.limit_denominator(2**52)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(f"frame rate {rate!r} is not a number") from None
    if value <= 0:
        raise OptionError(f"frame rate {rate} must be positive")
    return value


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
        """The suffixes of its format and that of its name, in lower case."""
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


def stored_source(
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


@check_arguments(motion=A_MOTION)
def recording(motion: Motion) -> Recording | None:
    """The facts in the source of ``motion`` besides its numbers; None if there are none.

    A C3D has events, force platforms, units and descriptions. ``Clip.recording`` is a clip's.
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
    source = fields.source
    try:
        form = None if source is None else format_by_id(source.format)
    except UnsupportedError:
        return None
    if source is None or form is None or form.recording is None:
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
