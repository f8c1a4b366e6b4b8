"""The faults of a file: of its checksums and index alone, or of all of it, decoded.

One pass at the speed of the disk checks all checksums, a block at a time, and reports every fault.
SPEC.md, "Chunks", "Open DATA and packets", "INDX" and "FOOT", are normative.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from functools import partial

from mcz.container.chunks import END, SHARED, Chunk, ChunkType
from mcz.container.directory import ClipRow, Directory
from mcz.container.encodings import chunk_id
from mcz.container.grammar import INDEX, START, ChunkEvent, Event, Fault, PacketEvent
from mcz.container.index_reader import directory_of, read_indexes
from mcz.container.limits import index_limit
from mcz.container.model_records import parse_head
from mcz.container.parser import WHOLE, Parser
from mcz.container.parser_drivers import events
from mcz.container.recovery import check_protection, recovery_chunks
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import (
    ChecksumError,
    FormatError,
    MczError,
    OptionError,
    UnsupportedError,
    error_context,
    remark_of,
)
from mcz.files.jobs import limit_jobs, share_clips
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import Where
from mcz.files.reading.file import File, open, open_bytes
from mcz.files.reading.signal_info import read_segments
from mcz.model.text_format import fields_text
from mcz.model.types import Target

KEPT = (ChunkType.HEAD, *SHARED)  # chunks whose payloads the pass needs
_PLACE = struct.Struct("<QQB")  # of a segment: offset, size, kind of its packet
Report = Callable[[int, int], object]


@dataclass(slots=True)
class ChecksumReport:
    """Findings of one pass; ``faults``: the place and kind of each, in file order.

    ``indexed``: the file ends with an INDX, which was compared with the chunks.
    """

    n_chunks: int = 0
    n_packets: int = 0
    indexed: bool = False
    faults: list[tuple[int, str]] = field(default_factory=list)


def check_checksums(source: ByteSource, progress: Report | None = None) -> ChecksumReport:
    """Check each checksum of ``source``, and compare INDX and FOOT with the chunks.

    Nothing is decoded: only a full check finds faults within sound checksums. ``progress`` is
    called with the number of bytes done and the size of the file. Raises UnsupportedError if the
    file needs a newer reader, AccessError if it cannot be read.
    """
    check = _Check(source)
    for event in events(source, check.parser):
        check.take(event)
        if progress is not None and not isinstance(event, PacketEvent):
            progress(min(check.parser.at, source.size), source.size)
    check.finish()
    return check.seen


class _Check:
    def __init__(self, source: ByteSource) -> None:
        self._source = source
        self.parser = Parser(source.size, want=lambda chunk: WHOLE * (chunk.type in KEPT))
        self.seen = ChecksumReport()
        self._places = _Places()
        self._index: Chunk | None = None  # that the last FOOT closes
        self._end = 0  # of the last FOOT
        self._has_lost = False  # an unknown part of the file was passed

    def take(self, event: Event) -> None:
        """Process an event; raises UnsupportedError."""
        if isinstance(event, PacketEvent):
            packet = event.packet
            if packet.kind != END:
                self.seen.n_packets += 1
                if self._places.clips:
                    self._places.clips[-1].segment(event.body, len(packet.body), packet.kind)
        elif isinstance(event, Fault):
            self._take_fault(event)
        elif isinstance(event, ChunkEvent):
            self._take_chunk(event)
        else:
            self._index, self._end = event.index, event.end

    def _note(self, at: int, text: str) -> None:
        self.seen.faults.append((at, text))

    def _take_fault(self, fault: Fault) -> None:
        """Record a fault of a checksum, or of the grammar after bytes that are all understood."""
        event, chunk = fault.event, fault.chunk
        if isinstance(fault.error, UnsupportedError):
            raise fault.error
        if fault.offset and fault.offset >= self._source.size:  # the end, see ``finish``
            return
        is_known = fault.state in (START, INDEX) or not (
            self._has_lost or isinstance(event, PacketEvent)
        )
        if event is None or is_known or isinstance(fault.error, ChecksumError):
            self._note(fault.offset, str(fault.error))
        if event is not None:
            self.take(event)
        elif fault.is_lost:
            self._has_lost = True
        elif chunk is not None:
            self._has_lost = self._has_lost or chunk.type in (*KEPT, ChunkType.INDX)
            self.seen.n_chunks += 1
            self._places.add(chunk)

    def _take_chunk(self, event: ChunkEvent) -> None:
        chunk = event.chunk
        self.seen.n_chunks += 1
        if chunk.type == ChunkType.HEAD:
            self._places.head = event.payload
            try:
                self.parser.profile = parse_head(event.payload)
            except UnsupportedError:
                raise
            except FormatError as error:
                self._note(chunk.offset, str(error))
        elif chunk.type in SHARED:
            with suppress(FormatError):  # its content is not checked here
                id_ = chunk_id(chunk.type, event.payload, self.parser.profile)
                self._places.shared.setdefault((chunk.type, id_), chunk)
        self._places.add(chunk)

    def finish(self) -> None:
        """Compare the last index with the file, if all of the file is known."""
        size, index = self._source.size, self._index
        if self._end != size:
            self._note(size, f"the file ends at {size} without a FOOT")
        elif index is not None and not self._has_lost:
            try:
                limit = index_limit(size)
                indexes = read_indexes(self._source.read, index.offset, index.size, limit)
                faults = self._places.differences(directory_of(indexes))
            except FormatError as error:
                faults = [str(error)]
            for text in faults:
                self._note(index.offset, f"chunk {index.label}: {text}")
            self.seen.indexed = True


@dataclass(slots=True)
class _ClipPlaces:
    """The chunks of a clip; its segments, which may be many, as a count and a CRC-32 of places."""

    clip: Chunk
    n_segments: int = 0
    segments: int = 0
    cend: Chunk | None = None
    ancillary: list[Chunk] = field(default_factory=list)

    def segment(self, offset: int, size: int, packet: int = 0) -> None:
        """Add a segment; ``packet`` is the kind of its packet, as in ``SegmentRow``."""
        self.n_segments += 1
        self.segments = zlib.crc32(_PLACE.pack(offset, size, packet), self.segments)


@dataclass(slots=True)
class _Places:
    head: bytes = b""
    shared: dict[tuple[bytes, bytes], Chunk] = field(default_factory=dict)
    attachments: list[Chunk] = field(default_factory=list)
    n_aliases: int = 0
    clips: list[_ClipPlaces] = field(default_factory=list)

    def add(self, chunk: Chunk) -> None:
        """Add the next chunk of any type; chunks of ``shared`` are added separately."""
        clip = self.clips[-1] if self.clips else None
        if chunk.type == ChunkType.CLIP:
            self.clips.append(_ClipPlaces(chunk))
        elif chunk.type == ChunkType.ATTA:
            self.attachments.append(chunk)
        elif chunk.type == ChunkType.ALIA:
            self.n_aliases += 1
        elif clip is None:
            return
        elif chunk.type == ChunkType.CEND:
            clip.cend = chunk
        elif chunk.type == ChunkType.DATA and chunk.length is not None:
            clip.segment(chunk.payload_offset, chunk.length)
        elif chunk.flags and chunk.type != ChunkType.INDX and clip.cend is not None:
            clip.ancillary.append(chunk)

    def differences(self, directory: Directory) -> list[str]:
        """The faults of an index, in words; empty if it is right."""
        faults = []
        if directory.head != self.head:
            faults.append("its copy of HEAD differs from HEAD")
        if list(directory.shared.items()) != list(self.shared.items()):
            faults.append("it lists other skeletons, models or sources than the file has")
        parts = [part for row in directory.attachments.values() for part in row.parts]
        if parts != self.attachments:
            faults.append("it lists other attachments than the file has")
        if self.n_aliases != len(directory.aliases):
            faults.append(
                f"it lists {len(directory.aliases)} aliases, but the file has {self.n_aliases}"
            )
        if len(self.clips) != len(directory.clips):
            return [*faults, f"it lists {len(directory.clips)} clips, there are {len(self.clips)}"]
        pairs = zip(self.clips, directory.clips.values(), strict=True)
        moved = (row.name for places, row in pairs if places != places_of(row))
        return faults + [f"clip {name!r} does not lie where it says" for name in moved]


def places_of(row: ClipRow) -> _ClipPlaces:
    """Places of a clip as listed by an index; raises FormatError for a wrong index."""
    places = _ClipPlaces(row.clip, cend=row.cend, ancillary=row.ancillary)
    for segment in row.segments:
        places.segment(segment.offset, segment.size, segment.packet)
    return places


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault: its place, the heading of SPEC.md, and a message.

    ``clip`` is the clip that the message names.
    """

    offset: int
    heading: str
    message: str
    clip: str | None = None

    __repr__ = fields_text


def heading(source: ByteSource, offset: int) -> str:
    """The heading of SPEC.md for the chunk at ``offset``."""
    kind = source.read(offset, min(4, source.size - offset))
    return kind.decode() if kind in set(ChunkType) else "Chunks"


def quick_check(
    target: Target, progress: Report | None = None
) -> tuple[ChecksumReport, list[Problem]]:
    """Check every checksum of a file and its index; returns the report and the faults.

    While another process appends to the file, this is of the file up to its last end. ``progress``
    is called with the number of bytes done and the size of the file. Raises UnsupportedError if
    it needs a newer reader, AccessError if it cannot be read.
    """
    with ExitStack() as stack:
        source = stack.enter_context(closing(open_bytes(target)))
        stack.enter_context(error_context(path=source.name))
        if source.grows():
            source = stack.enter_context(open(target)).container.source
        scanned = check_checksums(source, progress)
        return scanned, [Problem(at, heading(source, at), text) for at, text in scanned.faults]


Row = tuple[str, str, list[Problem]]  # kind, name and faults of a part of a file


def validate(file: File, clips: Sequence[Clip] | None = None) -> list[Problem]:
    """Every fault of the file, once: structure, checksums, values, sources, index.

    ``clips``: values and sources of these only.
    """
    problems = structure_problems(file)
    for _, _, problems_of_part in part_problems(file, clips):
        problems += problems_of_part
    first: dict[str, Problem] = {}
    for problem in problems:  # a chunk that is damaged hurts all that need it
        first.setdefault(problem.message, problem)
    return list(first.values())


def structure_problems(file: File) -> list[Problem]:
    """The faults of chunks, their order, their checksums and the index."""
    try:
        scan(file.container.source, whole=True)
    except FormatError as error:
        offset = error.offset or 0
        return [Problem(offset, heading(file.container.source, offset), remark_of(error))]
    return []


def verify(
    target: Target,
    max_decoded: int | None = None,
    threads: int | None = None,
    where: Where | None = None,
    quick: bool = False,
    jobs: int | None = None,
) -> list[Problem]:
    """Check every checksum of a file, decode everything, restore every source.

    Returns the faults, none for a sound file; raises FormatError if it cannot even be opened.
    ``max_decoded`` and ``threads`` are as in ``mcz.open``. ``where``: check every checksum, but
    decode and restore only the clips that match it, see ``File.find``; OptionError for none.
    ``quick``: check only the checksums and the index, at the speed of the disk; it also reports all
    faults of a file that cannot be opened. ``jobs`` processes work in parallel, by default one.
    """
    if quick:
        if where is not None:
            raise OptionError("a quick check covers the whole file, so where is not allowed")
        return quick_check(target)[1]
    with limit_jobs(jobs), open(target, max_decoded=max_decoded, threads=threads) as file:
        return validate(file, None if where is None else file.select_clips(where=where))


def part_problems(file: File, clips: Sequence[Clip] | None = None) -> Iterator[Row]:
    """Kind, name and faults of skeletons, clips (all, or ``clips``) and attachments in turn."""
    items = [("skeletons", "")]
    items += [("clip", clip.name) for clip in (file if clips is None else clips)]
    items += [("attachment", name) for name in (file.attachments if clips is None else ())]
    items += [("recovery data", "")] if clips is None else []
    names = None if clips is None else [clip.name for clip in clips]
    with share_clips(_problems_of, file, items, names) as answers:
        for answer in answers:
            yield from answer()


def _problems_of(shared: tuple[File, Sequence[str] | None], item: tuple[str, str]) -> list[Row]:
    (file, names), (kind, name) = shared, item
    if kind == "clip":
        return [(kind, name, clip_problems(file.clips[name]))]
    if kind == "recovery data":
        source, chunks = file.container.source, recovery_chunks(file.container)
        return [(kind, *_recovery_problems(source, chunk)) for chunk in chunks]
    if kind == "attachment":
        offset = file.container.directory.attachments[name].parts[0].offset
        return [(kind, name, _problems(offset, "ATTA", file.attachments[name].read))]
    return _skeleton_rows(file, None if names is None else [file.clips[name] for name in names])


def _skeleton_rows(file: File, clips: Sequence[Clip] | None) -> list[Row]:
    try:
        ids = None if clips is None else file.skeleton_ids(clips)
        skeletons = [one for one in file.skeletons if ids is None or one.id in ids]
    except MczError as error:
        return [("skeletons", "", [Problem(0, "SKEL", remark_of(error))])]
    rows: list[Row] = []
    for id_, skeleton in skeletons:
        offset = file.container.directory.shared[ChunkType.SKEL, id_].offset
        problems = _problems(offset, "SKEL", partial(_restore_skeleton, file, id_))
        rows.append(("skeleton", skeleton.name or id_.hex(), problems))
    return rows


def _restore_skeleton(file: File, id_: bytes) -> None:
    if file.skeleton(id_, with_source=True).source is not None:
        file.skeleton_bytes(id_)


def _problems(offset: int, heading: str, work: Callable[[], object]) -> list[Problem]:
    return [Problem(offset, heading, remark_of(error)) for error in _errors_of(work)]


def clip_problems(clip: Clip) -> list[Problem]:
    """The faults of one clip: its values and its restored source."""
    offset = clip.container.directory.clips[clip.name].clip.offset
    problems = [
        Problem(offset, _clip_heading(error), remark_of(error), error.clip)
        for error in _clip_errors(clip)
    ]
    return list(dict.fromkeys(problems))


def _clip_errors(clip: Clip) -> Iterator[MczError]:
    """The faults of each signal; one that is unsupported does not hide more."""
    errors = _errors_of(lambda: clip.signals)
    yield from errors
    sound = not errors
    for signal in clip.signals if sound else ():
        try:
            clip.check_values(signal.index)
        except MczError as error:
            sound = False
            yield error
            if isinstance(error, UnsupportedError):
                yield from _errors_of(read_segments, clip.container, signal)
    if sound and clip.source is not None:
        yield from _errors_of(clip.source_bytes)


def _errors_of(work: Callable[..., object], *arguments: object) -> list[MczError]:
    try:
        work(*arguments)
    except MczError as error:
        return [error]
    return []


def _clip_heading(error: MczError) -> str:
    if isinstance(error, UnsupportedError):
        return "Codecs"
    return "CEND" if isinstance(error, ChecksumError) else "CLIP"


def _recovery_problems(source: ByteSource, chunk: Chunk) -> tuple[str, list[Problem]]:
    """The protected bytes of a RECV, and its faults."""
    try:
        return check_protection(source, chunk), []
    except MczError as error:
        return f"at {chunk.offset}", [Problem(chunk.offset, "RECV", remark_of(error))]
