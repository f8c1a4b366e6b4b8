"""A clip's source file: what is known of it, and its stored parts put together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.reader import Container
from mcz.errors import UnsupportedError
from mcz.formats import FORMATS, Format, format_by_id
from mcz.motion import FrameNotes, Skeleton, Source
from mcz.reading.decimation import picked_notes
from mcz.reading.signal_info import SignalInfo


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What is known of a source file without restoring it."""

    format: str
    path: str
    size: int
    sha256: bytes

    @property
    def suffixes(self) -> tuple[str, ...]:
        """The suffixes, in lower case, of its format, and that of its name."""
        own = PurePosixPath(self.path).suffix.lower()
        return (*FORMATS[self.format].suffixes, *([own] if own else []))


def source_info(fields: payloads.Clip, cend: payloads.Cend | None) -> SourceInfo | None:
    """The facts in CLIP and CEND of a clip (None: it has no CEND); None where it has no source."""
    if not fields.source:
        return None
    source = fields.source
    digest = cend.source_sha256 if cend is not None else None
    name = format_by_id(source.format).name
    return SourceInfo(name, source.path, source.size, digest or b"")


def known_format(fields: payloads.Clip) -> Format | None:
    """The source format of a clip whose CLIP is ``fields``; None: none that is known."""
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

    ``signal`` is the clip's motion, whose segments hold the notes. Raises FormatError.
    """
    source_format = format_by_id(fields.format)
    template = container.template(fields.template, fields.format)
    return Source(
        format=info.format,
        template=template,
        detail=bytes(fields.detail),
        notes=_notes(container, source_format, signal, frames),
        path=info.path,
        size=info.size,
        sha256=info.sha256,
    )


def _notes(
    container: Container, source_format: Format, signal: SignalInfo, frames: range
) -> FrameNotes | None:
    """The notes of ``frames``, numbered from 0."""
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
    return picked_notes(source_format.join_notes, notes, picked)


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
