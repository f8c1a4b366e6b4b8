"""Random access to the parts of a file through its Directory.

Opening reads only the end of the file; a file without INDX is scanned. SPEC.md, "Strict reading"
and "Salvage", are normative.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from operator import attrgetter
from weakref import finalize

from mcz.container import payloads
from mcz.container.caches import DecodedCache, MetadataCache
from mcz.container.chunk_repair import is_like, scan_for_salvage
from mcz.container.chunks import (
    CHECK_SIZE,
    FOOT,
    FRAME,
    FRAMING,
    MOST_HEAD,
    SIGNATURE,
    Chunk,
    ChunkType,
    Foot,
    Packet,
    build_chunk,
    check_chunk,
    check_signature,
    implied_by,
    is_packet,
    parse_foot,
    read_chunk,
    read_payload,
)
from mcz.container.directory import AttachmentRow, ClipRow, Directory, SegmentRow
from mcz.container.encodings import (
    Copy,
    chunk_id,
    copy_chunks,
    find_uncopied,
    join_parts,
    plain_id,
    plain_payload,
)
from mcz.container.index_reader import directory_of, read_indexes
from mcz.container.limits import BASE, Profile, check, check_decoded, index_limit, output_limit
from mcz.container.metadata import Placed, Record, apply_records, read_records
from mcz.container.model_records import parse_clip, parse_head, read_skeleton
from mcz.container.scan import scan
from mcz.container.segments import (
    FRESH,
    MASKS,
    StreamCounts,
    StreamTable,
    frame_table,
    mask_of,
    parse_stream_table,
)
from mcz.container.source import ByteSource, Overlay
from mcz.errors import ChecksumError, FormatError, TruncatedError
from mcz.model.motion import Skeleton
from mcz.model.schema import parse, parse_until
from mcz.model.types import Settings

_row_text = attrgetter(
    "name", "skeleton", "n_frames", "rate_numerator", "rate_denominator", "signals"
)  # fields of a clip in both CLIP and the index
KEPT_SKELETONS = 8  # parsed skeletons of a file
FEW_CLIPS = 16  # of a file, whose CLIPs are parsed one by one
TABLE_PEEK = 32  # bytes of a segment, plus 7/4 a stream, that are read first for its table


class Container:
    """An open file. ``unverified`` counts the segments of which only a part was read.

    That happens only if ``reads_parts`` allows it. ``directory`` may come from the writer of a
    file that is not finished.
    """

    def __init__(
        self,
        source: ByteSource,
        *,
        salvage: bool = False,
        max_decoded: int | None = None,
        reads_parts: bool = False,
        threads: int | None = None,
        verify: bool = False,
        directory: Directory | None = None,
    ) -> None:
        self.source, self.salvage, self.verify = source, salvage, verify
        self.reads_parts = reads_parts and not salvage
        self.max_decoded = output_limit(source.size) if max_decoded is None else max_decoded
        self.threads = threads  # for decoding; None: the limit of ``threads``
        self.damage: list[str] = []
        self.broken: list[tuple[int, Chunk | None]] = []
        self.feet: list[int] = []  # offsets of FOOTs found by salvage
        self.unverified = 0
        self.runs = DecodedCache()
        self._metadata = MetadataCache()
        self._last_mask = 0, b""  # a segment in a packet, and its mask
        self._skeletons: dict[bytes, tuple[payloads.Skel, Skeleton]] = {}
        self.directory = directory or (self._salvage() if salvage else self._open())
        self.profile: Profile = parse_head(self.directory.head)

    def __reduce__(self) -> tuple[object, ...]:
        names = "salvage", "max_decoded", "reads_parts", "threads", "verify"
        return _reopen, (self.source, {n: getattr(self, n) for n in names})

    def strictly(self) -> Container:
        """A copy that reads with all checks, as from an intact file."""
        other = Container.__new__(Container)
        other.__dict__.update(self.__dict__ | {"salvage": False, "verify": True})
        return other

    def _salvage(self) -> Directory:
        self.source, scanned, notes = scan_for_salvage(self.source)
        self.damage = notes + scanned.damage
        self.broken, self.feet = scanned.broken, scanned.feet
        return scanned.directory

    def _open(self) -> Directory:
        tail_size = min(self.source.size, self.source.tail)
        tail = self.source.read(self.source.size - tail_size, tail_size)
        if not self.source.remote:  # if requests are slow, INDX's copy of HEAD suffices
            check_signature(self.source)
        foot = self._read_foot(tail)
        if not foot.index_length:
            return scan(self.source).directory
        head = None if self.source.remote else self._read_head()  # HEAD-01
        directory = self._read_directory(foot, tail)
        directory.end = self.source.size
        if head not in (None, directory.head):
            raise FormatError("HEAD differs from the index")
        return directory

    def _read_head(self) -> bytes:
        """The payload of HEAD; raises UnsupportedError, since nothing after it is known then."""
        head = read_chunk(self.source, len(SIGNATURE))
        if head.type != ChunkType.HEAD:
            raise FormatError(f"the first chunk is {head.label}, not HEAD")
        payload = read_payload(self.source, head, BASE.chunk_bytes)
        parse_head(payload)
        return payload

    def _read_foot(self, tail: bytes) -> Foot:
        foot = None
        at = self.source.size - FOOT.size
        if at >= len(SIGNATURE):
            foot = parse_foot(tail[-FOOT.size :], at)
        if foot is None:
            check_signature(self.source)  # STRICT-01
            scan(self.source)  # finds the place and the last FOOT, and raises
            raise TruncatedError(f"the file ends at {self.source.size} without a FOOT")
        return foot

    def _read_directory(self, foot: Foot, tail: bytes) -> Directory:
        if foot.index_length < FRAMING:
            raise FormatError(f"FOOT: {foot.index_length} bytes are too few for an index")
        begin = self.source.size - len(tail)

        def fetch(offset: int, length: int) -> bytes:
            if offset >= begin:
                return tail[offset - begin :][:length]
            missing = self.source.read(offset, min(begin - offset, length))
            return missing + tail[: length - len(missing)]

        limit = index_limit(self.source.size)
        return directory_of(read_indexes(fetch, foot.index_offset, foot.index_length, limit))

    def payload(self, chunk: Chunk) -> bytes:
        assert chunk.length is not None
        # CHUNK-04, LIMIT-07
        check(f"chunk {chunk.label}: bytes", chunk.length, self.profile.chunk_bytes)
        return check_chunk(self.source.read(chunk.offset, chunk.size), chunk)

    @cached_property
    def _records(self) -> Placed:
        chunks = self.directory.clips.ancillary(ChunkType.META)
        return read_records(chunks, self.payload, self.source.size, lenient=self.salvage)

    def metadata_records(self, name: str) -> list[Record]:
        """META records of the clip ``name``, or of the file if it is ""."""
        row = self.directory.clips.get(name)
        start = row.clip.offset if row is not None else 0
        return [record for at, record in self._records.get(name, ()) if at > start]

    def metadata(self, row: ClipRow) -> dict[str, str]:
        """Metadata of a clip from CLIP, updated by later META chunks."""
        return apply_records(self._metadata.of(row, self.payload), self.metadata_records(row.name))

    def copies(self) -> list[Chunk]:
        """The COPY chunks of the file, in order."""
        return copy_chunks(self.source, self.directory)

    def uncopied(self) -> list[Copy]:
        """Copies of the chunks after the last COPY."""
        return find_uncopied(self.source, self.directory, self.payload)

    def add_shared(self, kind: bytes, payload: bytes) -> None:
        """Add a lost SKEL, MODL or SRCE to a damaged file, past its end."""
        overlay = self.source if isinstance(self.source, Overlay) else Overlay(self.source, {})
        end = max([self.source.size, *(at + len(part) for at, part in overlay.parts.items())])
        chunk = build_chunk(kind, payload)
        self.broken = [row for row in self.broken if not is_like(self.source, row[0], chunk)]
        self.source = overlay.with_more({end: chunk})
        self.directory.shared[kind, chunk_id(kind, payload)] = Chunk(kind, 0, end, len(payload))

    def model(self, id_: bytes) -> payloads.Modl:
        """The MODL with this id, its hash checked."""
        return parse(payloads.Modl, *self._shared_payload(ChunkType.MODL, id_))

    def _shared_payload(self, kind: bytes, id_: bytes) -> tuple[bytes, str]:
        chunk = self.directory.shared.get((kind, id_))
        if chunk is None:
            raise FormatError(f"no {kind.decode()} has the id {id_.hex()}")
        where, payload = f"{kind.decode()} {id_.hex()}", self.payload(chunk)
        plain = plain_payload(kind, payload, where, self.profile, self.max_decoded)
        if plain_id(kind, plain) != id_:
            raise ChecksumError(f"its id should be {id_.hex()}", where=f"chunk {chunk.label}")
        return plain, chunk.label

    def skeleton(self, id_: bytes) -> Skeleton:
        """The skeleton in the SKEL with this id, its own source file not read."""
        return self._find_skeleton(id_)[1]

    def skeleton_fields(self, id_: bytes) -> payloads.Skel:
        """The fields of the SKEL with this id, its hash checked."""
        return self._find_skeleton(id_)[0]

    def _find_skeleton(self, id_: bytes) -> tuple[payloads.Skel, Skeleton]:
        """The fields and the skeleton; the last ones are cached, since clips share them."""
        entry = self._skeletons.get(id_)
        if entry is None:
            payload, label = self._shared_payload(ChunkType.SKEL, id_)
            entry = read_skeleton(payload, self.profile, label, f"SKEL {id_.hex()}")
            while len(self._skeletons) >= KEPT_SKELETONS:
                self._skeletons.pop(next(iter(self._skeletons)), None)
            self._skeletons[id_] = entry
        return entry

    def template(self, id_: bytes, format_id: int) -> bytes:
        """The template in the SRCE with this id."""
        fields = parse(payloads.Srce, *self._shared_payload(ChunkType.SRCE, id_))
        if fields.format != format_id:  # CLIP-03, SKEL-04
            raise FormatError(f"SRCE {id_.hex()} has format {fields.format}, not {format_id}")
        return fields.data

    def clip(self, row: ClipRow, *, shared: bool = False) -> payloads.Clip:
        """The fields of CLIP, compared with the index; ``shared`` ones are read-only."""
        head, shared = self.directory.head, shared and len(self.directory.clips) > FEW_CLIPS
        fields = parse_clip(self.payload(row.clip), head, row.clip.label, shared=shared)
        row_of_fields = ClipRow.of(fields, row.clip)
        if fields.flags & payloads.OPEN_CLIP:
            if fields.n_frames:  # CLIP-16
                raise FormatError(f"clip {row.name!r} is open, but has {fields.n_frames} frames")
            row_of_fields.n_frames = row.n_frames
        differs = _row_text(row_of_fields) != _row_text(row)  # CLIP-17
        if differs and row.damage and not self.salvage:
            raise FormatError(row.damage[0], clip=row.name)
        if differs and not row.damage:
            raise FormatError(
                f"clip {row.name!r} is {_row_text(row_of_fields)}, but the index says "
                f"{_row_text(row)}"
            )
        return fields

    def clip_head(self, row: ClipRow) -> payloads.Clip:
        """The fields of CLIP before its signals, for a quick pass over many clips."""
        return parse_until(payloads.Clip, self.payload(row.clip), row.clip.label, "signals")

    def whole_cend(self, row: ClipRow) -> payloads.Cend:
        """The fields of CEND; raises FormatError if a damaged file has none."""
        record = self.cend(row)
        if record is None:
            raise FormatError(f"clip {row.name!r} has no CEND")
        return record

    def cend(self, row: ClipRow) -> payloads.Cend | None:
        """The fields of CEND; None if a salvaged clip has none."""
        if row.cend is None:
            return None
        fields = parse(payloads.Cend, self.payload(row.cend), row.cend.label)
        if fields.n_frames != row.n_frames:
            raise FormatError(
                f"{row.cend.label} states {fields.n_frames} frames, not {row.n_frames}"
            )
        return fields

    def attachment(self, row: AttachmentRow) -> bytes:
        """The bytes of an attached file, its hash checked."""
        check_decoded(f"attachment {row.name!r}", row.size, self.max_decoded)
        return join_parts(row, self.payload)

    def table(self, row: SegmentRow, counts: StreamCounts) -> StreamTable:
        """The stream table of a segment, with as few reads as possible."""
        self._check_row(row)
        if row.packet == FRAME:
            return frame_table(row.header, counts, row.size, len(self._implied_mask(row)))
        size = min(row.size, TABLE_PEEK + counts.total(row.header.flags) * 7 // 4)
        while True:
            data = self.source.read(row.offset, size)
            try:
                return _parse_table(data, row, counts)
            except TruncatedError:
                size = min(row.size, 4 * size)

    def streams(
        self,
        row: SegmentRow,
        counts: StreamCounts,
        indices: Sequence[int] | None,
        table: StreamTable | None = None,
    ) -> tuple[StreamTable, dict[int, bytes]]:
        """At least the streams with these ``indices`` (None: all) of a segment.

        ``table`` is the table of the segment if it was read before. Everything in the segment is
        read and checked (CHUNK-03), unless parts may be.
        """
        self._check_row(row)
        if indices is None or not self.in_part(row):
            return self._all_streams(row, counts)
        table = table or self.table(row, counts)
        self.unverified += 1  # CHUNK-07
        got: dict[int, bytes] = {}
        for run in table.runs(sorted(indices), self.source.gap):
            start = table.offsets[run[0]]
            stop = table.offsets[run[-1]] + table.lengths[run[-1]]
            data = self.source.read(row.offset + start, stop - start)
            for index in run:
                at = table.offsets[index] - start
                got[index] = data[at : at + table.lengths[index]]
        return table, got

    def in_part(self, row: SegmentRow) -> bool:
        """Return True if parts of a segment are read alone: not if one request returns it all."""
        return self.reads_parts and row.packet != FRAME and row.size > self.source.gap

    def _all_streams(
        self, row: SegmentRow, counts: StreamCounts
    ) -> tuple[StreamTable, dict[int, bytes]]:
        payload = self._read_packet(row) if row.packet else self.payload(row.chunk())
        if row.packet == FRAME:
            mask = self._implied_mask(row)
            streams = [mask, payload] if row.header.flags & MASKS else [payload]
            return frame_table(row.header, counts, row.size, len(mask)), dict(enumerate(streams))
        table = _parse_table(payload, row, counts)
        return table, {
            index: payload[offset : offset + length]
            for index, (offset, length) in enumerate(zip(table.offsets, table.lengths, strict=True))
        }

    def _read_packet(self, row: SegmentRow) -> bytes:
        before = min(row.offset, MOST_HEAD)
        data = self.source.read(row.offset - before, before + row.size + CHECK_SIZE)
        body = data[before:-CHECK_SIZE]
        number, fresh = row.header.first, bool(row.header.flags & FRESH)
        implied = implied_by(number, self._implied_mask(row)) if row.packet == FRAME else b""
        # INDX-02, INDX-03, PACK-04, PACK-08, PACK-09, PACK-11, PACK-15
        if not is_packet(data, Packet(row.packet, 0, body, fresh, implied)):
            raise ChecksumError(
                f"packet at {row.offset}: its crc is wrong, or it is not frame {number}",
                offset=row.offset,
            )
        return body

    def _implied_mask(self, row: SegmentRow) -> bytes:
        if row.mask_row is None:
            return b""
        if self._last_mask[0] != row.mask_row.offset:
            mask = mask_of(self._read_packet(row.mask_row))  # PACK-20
            self._last_mask = row.mask_row.offset, mask
        return self._last_mask[1]

    def _check_row(self, row: SegmentRow) -> None:
        if row.stop > self.source.size:
            raise FormatError(
                f"the index places a segment at {row.offset}, past the end of the file",
                offset=row.offset,
            )
        limit = self.profile.packet_bytes if row.packet else self.profile.chunk_bytes
        check(f"DATA at {row.offset}: bytes", row.size, limit)


def _reopen(source: ByteSource, options: Settings) -> Container:
    """Reopen the file of a pickled Container; it is closed with the Container."""
    try:
        container = Container(source, **options)
    except BaseException:
        source.close()
        raise
    finalize(container, source.close)
    return container


def _parse_table(data: bytes, row: SegmentRow, counts: StreamCounts) -> StreamTable:
    """The table of a segment; raises TruncatedError if ``data`` is too short."""
    try:
        table = parse_stream_table(data, counts)
    except TruncatedError as error:
        if len(data) < row.size:
            raise
        raise FormatError(f"DATA payload at {row.offset}: {error}", offset=row.offset) from None
    if table.header != row.header:
        raise FormatError(
            f"segment at {row.offset} is {table.header}, but the index says {row.header}",
            offset=row.offset,
        )
    if table.payload_size != row.size:  # DATA-01
        raise FormatError(
            f"segment at {row.offset}: its streams end at byte {table.payload_size} of {row.size}",
            offset=row.offset,
            value=table.payload_size,
        )
    return table
