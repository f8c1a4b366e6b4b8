"""A strict scan: the events of a file, checked and collected, up to the first fault.

``check_plain`` has the rules of the profile small. Decoding clips finds further faults. SPEC.md,
"Grammar", "Strict reading", "QUAL", "META", "COPY" and "Limits and profiles", are normative.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

from mcz.container import payloads
from mcz.container.chunks import HEADER, SEGMENT, Chunk, ChunkType
from mcz.container.directory import AttachmentRow, ClipRow, Directory, SegmentRow
from mcz.container.encodings import check_copies, is_packed, parse_copies, plain_id, plain_payload
from mcz.container.grammar import NAMED, OTHER, ChunkEvent, Event, Fault, FootEvent, PacketEvent
from mcz.container.index_reader import IndexCheck
from mcz.container.limits import Profile, check, index_limit
from mcz.container.metadata import parse_meta
from mcz.container.model_records import parse_clip, parse_head, parse_skeleton
from mcz.container.parser import UNCHECKED, WHOLE, Parser
from mcz.container.segments import GROUP_NOTES, parse_segment_header
from mcz.errors import FormatError, LimitError
from mcz.model.numbers import GridKind
from mcz.model.schema import Record, parse

Templates = Mapping[bytes, int]  # id of a SRCE -> its source format
# The source formats of the registry, by the kind of their content.
OF_SKELETONS, OF_CLIPS = frozenset({1}), frozenset({*range(2, 15), 16, 17})


def is_plain_path(name: str) -> bool:
    """Return True for a relative path that stays below its folder on every system."""
    parts = name.split("/")
    # PATH-01, PATH-02, PATH-03, PATH-04
    is_odd = any(part in ("", ".", "..") for part in parts) or "\\" in name or "\0" in name
    return not (is_odd or PurePosixPath(name).is_absolute() or ":" in parts[0])  # PATH-05


def check_path(name: str, where: str) -> None:
    if not is_plain_path(name):
        raise FormatError(f"path {name!r} is not a plain relative path", where=where)


def check_skeleton(
    plain: bytes, where: str, directory: Directory, templates: Templates, profile: Profile
) -> bool:
    """Check a SKEL that is not packed; return whether it has a source file of its own."""
    fields = parse(payloads.Skel, plain, where, profile.counts)
    parse_skeleton(fields, profile, where)
    if fields.base is not None:
        _require_shared(directory, ChunkType.SKEL, fields.base, where)  # SKEL-02
    if fields.source is not None:
        _check_source(fields.source, where, directory, templates, OF_CLIPS)
    return bool(fields.source)


def _check_source(
    source: payloads.ClipSource | payloads.SkeletonSource,
    where: str,
    directory: Directory,
    templates: Templates,
    others: frozenset[int],
) -> None:
    """Raise FormatError for a bad source; ``others``: formats that this chunk cannot have."""
    id_ = bytes(source.template)
    _require_shared(directory, ChunkType.SRCE, id_, where)  # GRAM-03
    if templates.get(id_, source.format) != source.format:  # CLIP-03, SKEL-04
        raise FormatError(
            f"source format is {source.format}, but its SRCE has {templates[id_]}", where=where
        )
    if source.format in others:  # CLIP-04, SKEL-03
        raise FormatError(
            f"source format {source.format} is not allowed in this chunk", where=where
        )


def check_clip(
    fields: payloads.Clip, where: str, directory: Directory, templates: Templates
) -> bool:
    """Check the references and names of CLIP; return whether it has a source file."""
    _require_shared(directory, ChunkType.SKEL, fields.skeleton, where)  # GRAM-02
    if fields.source is not None:
        _check_source(fields.source, where, directory, templates, OF_SKELETONS)
        if fields.source.path:
            check_path(fields.source.path, where)
    keys = [pair.key for pair in fields.metadata]
    if len(keys) != len(set(keys)):  # CLIP-02, CLIP-21
        raise FormatError(f"a key of the metadata occurs twice: {sorted(keys)}", where=where)
    return bool(fields.source)


def _require_shared(directory: Directory, kind: bytes, id_: bytes, where: str) -> None:
    if (kind, bytes(id_)) not in directory.shared:
        raise FormatError(f"no earlier {kind.decode()} has the id {bytes(id_).hex()}", where=where)


def check_target(fields: payloads.Alia, where: str, sourced: Collection[tuple[int, bytes]]) -> None:
    """Check that the target of an alias precedes it, and can be restored."""
    if (fields.of, bytes(fields.target)) not in sourced:  # GRAM-04
        raise FormatError(
            f"chunk {where}: its target {fields.target!r} is no earlier clip or skeleton with "
            "a source"
        )


def check_ancillary(
    chunk: Chunk,
    payload: bytes,
    file_bytes: int,
    directory: Directory,
    before: Sequence[Chunk],
    payload_of: Callable[[Chunk], bytes] | None,
) -> None:
    """Check ``chunk`` of a file of ``file_bytes``, after ``directory`` and the chunks ``before``.

    Raises FormatError. Without ``payload_of``, which reads earlier chunks again, copies are not
    compared with them.
    """
    if chunk.type == ChunkType.QUAL:
        parse(payloads.Qual, payload, chunk.label)  # QUAL-02
    elif chunk.type == ChunkType.META:
        if not directory.clips:  # META-01
            raise FormatError(f"chunk {chunk.label} precedes the first clip")
        parse_meta(payload, chunk, file_bytes)
    elif chunk.type == ChunkType.COPY:
        copies = parse_copies(payload, chunk, file_bytes)
        if payload_of is not None:
            check_copies(copies, chunk, before, payload_of)


CODECS = {0, 1}  # raw and fast
ENCODED: dict[bytes, type[Record]] = {
    ChunkType.SRCE: payloads.Srce,
    ChunkType.ATTA: payloads.Atta,
    ChunkType.META: payloads.Meta,
}
ABSENT = {ChunkType.INDX, ChunkType.COPY, ChunkType.MODL}


def check_plain(kind: bytes, payload: bytes, where: str) -> None:
    """Raise LimitError for a chunk that the profile small does not allow."""
    record = ENCODED.get(kind)
    if record is not None:
        packed = vars(parse(record, payload, where))["flags"] & payloads.ENCODING != payloads.STORED
    else:
        packed = kind == ChunkType.SKEL and is_packed(payload, where)
    if packed:  # LIMIT-22
        raise LimitError("profile small does not allow packed contents", where=where)
    if kind in ABSENT:  # LIMIT-23
        raise LimitError("profile small does not allow this chunk", where=where)
    if kind == ChunkType.CLIP:
        _check_clip(parse(payloads.Clip, payload, where), where)


def _check_clip(fields: payloads.Clip, where: str) -> None:
    for signal in fields.signals:
        if signal.codec not in CODECS:  # LIMIT-20
            raise LimitError(
                f"profile small allows only codecs raw and fast, not codec {signal.codec}",
                where=where,
            )
        if any(run.grid.kind == GridKind.PRINTED for run in signal.grids):  # LIMIT-21
            raise LimitError("profile small does not allow grid PRINTED", where=where)


PEEK = 64  # enough for the fields of a segment before its table

Payloads = Callable[[Chunk], bytes]


@dataclass(slots=True)
class ScanResult:
    """The result of a scan."""

    directory: Directory = field(default_factory=Directory)
    chunks: list[Chunk] = field(default_factory=list)
    feet: list[int] = field(default_factory=list)  # offsets of the FOOTs
    damage: list[str] = field(default_factory=list)
    ends: dict[int, int] = field(default_factory=dict)  # ends of open DATA chunks by their offsets
    # Parts that salvage could not use: offset, and the chunk if its header is sound.
    broken: list[tuple[int, Chunk | None]] = field(default_factory=list)
    doubts: bool = False  # the clip of some part is uncertain


class Scanner:
    """A strict scan of the events of a parser.

    ``size`` is the size of the file, None for a stream: then processed bytes are dropped, and INDX
    and COPY are not compared with the file. ``payload_of`` reads earlier payloads.
    """

    def __init__(
        self, size: int | None, *, whole: bool = True, payload_of: Payloads | None = None
    ) -> None:
        self.parser = Parser(size, want=self._needed_bytes, check=whole)
        self.result = ScanResult()
        self.strict = whole
        self.clip: ClipRow | None = None
        self.first: list[int] = []  # the next frame of each signal of the open clip
        self._size, self._whole, self._payload_of = size, whole, payload_of
        self._indexes = IndexCheck()
        self._templates: dict[bytes, int] = {}  # the source format of each SRCE
        self._model_bytes = 0
        self._mask_row: SegmentRow | None = None  # has the mask of frames of the open DATA
        self._sourced: set[tuple[int, bytes]] = set()  # possible targets of aliases
        self._handlers: dict[str, Callable[[Chunk, bytes], None]] = {
            "HEAD": self._head,
            "SKEL": self._shared,
            "MODL": self._shared,
            "SRCE": self._shared,
            "ATTA": self._attachment,
            "ALIA": self._alias,
            "CLIP": self._begin_clip,
            "DATA": self._data,
            "CEND": self._end_clip,
            "INDX": self._index,
            OTHER: self._ancillary,
        }

    def _needed_bytes(self, chunk: Chunk) -> int:
        if self._whole:
            return WHOLE
        if chunk.type == ChunkType.DATA:
            return PEEK
        return WHOLE if chunk.type in NAMED else UNCHECKED

    def take(self, event: Event) -> None:
        """Process an event; raises FormatError for a Fault, and for other broken rules."""
        try:
            if isinstance(event, Fault):
                raise event.error
            self._take(event)
        except FormatError as error:
            chunk = getattr(event, "chunk", None)
            error.offset = (event.offset if chunk is None else chunk.offset) or None
            raise

    def _take(self, event: ChunkEvent | PacketEvent | FootEvent) -> None:
        if isinstance(event, PacketEvent):
            self._packet(event)
        elif isinstance(event, FootEvent):
            self.result.feet.append(event.offset)
            self.result.directory.end = event.end
        elif event.chunk.length is not None:
            chunk, is_read = event.chunk, event.payload or not event.chunk.length
            if self.parser.profile.is_plain and is_read and chunk.type != ChunkType.DATA:
                check_plain(chunk.type, event.payload, chunk.label)
            self._handlers[event.thing](chunk, event.payload)
            self.result.chunks.append(event.chunk)

    def finish(self) -> None:
        """End the scan; a subclass closes what is open."""

    def forget(self) -> None:
        """Drop the places of chunks and segments, which are useless in a stream."""
        self.result.chunks.clear()
        self.result.ends.clear()
        if self.clip is not None:
            self.clip.segments.clear()

    def _head(self, chunk: Chunk, payload: bytes) -> None:
        self.parser.profile = parse_head(payload)
        self.result.directory.head = payload

    def _shared(self, chunk: Chunk, payload: bytes) -> None:
        plain = plain_payload(chunk.type, payload, chunk.label, self.parser.profile)
        id_ = plain_id(chunk.type, plain)
        if self.strict:
            self._check_shared(chunk, id_, plain)
        self.result.directory.shared.setdefault((chunk.type, id_), chunk)  # GRAM-05

    def _check_shared(self, chunk: Chunk, id_: bytes, plain: bytes) -> None:
        if chunk.type == ChunkType.SKEL:
            directory = self.result.directory
            # ALIA-01
            if check_skeleton(plain, chunk.label, directory, self._templates, self.parser.profile):
                self._sourced.add((payloads.OF_SKELETON, id_))
        elif chunk.type == ChunkType.SRCE:
            self._templates[id_] = parse(payloads.Srce, plain, chunk.label).format
        else:
            parse(payloads.Modl, plain, chunk.label)
            self._model_bytes += len(plain)
            # LIMIT-06
            check(
                f"chunk {chunk.label}: all models",
                self._model_bytes,
                self.parser.profile.model_bytes,
            )

    def _attachment(self, chunk: Chunk, payload: bytes) -> None:
        fields = parse(payloads.Atta, payload, chunk.label)
        rows = self.result.directory.attachments
        if self.strict:
            check_path(fields.name, chunk.label)
        # ATTA-01, GRAM-07
        row = rows.get(fields.name) or AttachmentRow(fields.name, fields.size, [])
        follows = row.parts and row.parts[-1].offset + row.parts[-1].size == chunk.offset
        if (
            fields.part != len(row.parts)  # ATTA-01
            or fields.size != row.size  # ATTA-02
            or (fields.part and not follows)  # ATTA-01
        ):
            raise FormatError(f"chunk {chunk.label}: part {fields.part} is out of order")
        if fields.part >= fields.n_parts:  # ATTA-01
            raise FormatError(f"chunk {chunk.label}: part {fields.part} of {fields.n_parts}")
        row.parts.append(chunk)
        rows[fields.name] = row
        self._sourced.add((payloads.OF_ATTACHMENT, fields.name.encode()))

    def _alias(self, chunk: Chunk, payload: bytes) -> None:
        fields = parse(payloads.Alia, payload, chunk.label)
        if fields.name in self.result.directory.aliases:  # GRAM-08
            raise FormatError(f"chunk {chunk.label}: a second alias {fields.name!r}")
        if self.strict:
            check_path(fields.name, chunk.label)
            check_target(fields, chunk.label, self._sourced)
        self.result.directory.aliases[fields.name] = (fields.of, fields.target)

    def _begin_clip(self, chunk: Chunk, payload: bytes) -> None:
        fields = parse_clip(payload, self.result.directory.head, chunk.label)
        if not fields.name or fields.name in self.result.directory.clips:  # CLIP-01, GRAM-06
            raise FormatError(
                f"chunk {chunk.label}: clip name {fields.name!r} is empty or already used"
            )
        if not fields.signals:  # CLIP-05
            raise FormatError(f"chunk {chunk.label}: the clip has no signal")
        # LIMIT-18
        check(f"chunk {chunk.label}: signals", len(fields.signals), self.parser.profile.signals)
        if self.strict and check_clip(
            fields, chunk.label, self.result.directory, self._templates
        ):  # ALIA-02
            self._sourced.add((payloads.OF_CLIP, fields.name.encode()))
        self.clip = ClipRow.of(fields, chunk)
        self.first = [0] * len(fields.signals)

    def _data(self, chunk: Chunk, payload: bytes) -> None:
        assert chunk.length is not None
        header, _ = parse_segment_header(payload)
        self._segment(SegmentRow(chunk.payload_offset, chunk.length, header))

    def _packet(self, event: PacketEvent) -> None:
        packet, header = event.packet, event.header
        if header is not None:
            row = SegmentRow(event.body, len(packet.body), header, packet.kind)
            if event.is_masked:
                row = replace(row, mask_row=self._mask_row)
            elif packet.kind == SEGMENT and header.signal == 0:
                self._mask_row = row
            self._segment(row)
            return
        self.result.ends[event.chunk.offset] = event.end
        self.result.chunks.append(event.chunk)

    def _segment(self, row: SegmentRow) -> None:
        header, at = row.header, row.offset - HEADER.size
        assert self.clip is not None
        if self.parser.profile.is_plain and header.flags & GROUP_NOTES:  # LIMIT-21
            raise LimitError(f"DATA at {at}: profile small does not allow group notes")
        if header.signal >= len(self.first):
            raise FormatError(f"DATA at {at}: signal {header.signal} does not exist")  # DATA-06
        frame = self.first[header.signal]
        if not self._may_follow(header.first, frame):  # DATA-08
            raise FormatError(
                f"DATA at {at}: the segment begins at frame {header.first}; expected {frame}"
            )
        self.first[header.signal] = header.stop  # DATA-08
        self.clip.segments.append(row)

    def _may_follow(self, first: int, frame: int) -> bool:
        return first == frame

    def _end_clip(self, chunk: Chunk, payload: bytes) -> None:
        assert self.clip is not None
        fields = parse(payloads.Cend, payload, chunk.label)
        self.clip.n_frames, self.clip.cend = fields.n_frames, chunk
        for error in self._close_clip():
            raise error

    def _close_clip(self) -> list[FormatError]:
        """End the open clip; return the faults of its signals."""
        clip, self.clip = self.clip, None
        assert clip is not None
        self.result.directory.clips[clip.name] = clip
        stored = [row.stored(clip.n_frames) for row in clip.signals]
        return [
            FormatError(
                f"clip {clip.name!r}: signal {signal} has {frames} frames; expected {n_frames}"
            )
            for signal, (frames, n_frames) in enumerate(zip(self.first, stored, strict=True))
            if frames != n_frames
        ]

    def _index(self, chunk: Chunk, payload: bytes) -> None:
        if self.strict and self._size is not None:  # STRICT-04
            limit = index_limit(self._size)
            self._indexes.check(payload, chunk, self.result.directory, limit)  # INDX-02, STRICT-04

    def _ancillary(self, chunk: Chunk, payload: bytes) -> None:
        if self.strict:
            self._check_ancillary(chunk, payload)
        last = self.result.directory.clips.last
        if self.clip is None and last is not None:
            last.ancillary.append(chunk)

    def _check_ancillary(self, chunk: Chunk, payload: bytes) -> None:
        if chunk.type == ChunkType.META and self.clip is not None:  # META-02
            raise FormatError(f"chunk {chunk.label} is inside the clip {self.clip.name!r}")
        size = chunk.offset + chunk.size if self._size is None else self._size
        check_ancillary(
            chunk, payload, size, self.result.directory, self.result.chunks, self._payload_of
        )
