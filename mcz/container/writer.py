"""Writing a file front to back without seeking, so a pipe will do.

The writer keeps the Directory of the written chunks and ends with INDX and FOOT. SPEC.md,
"Grammar", is normative.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import Protocol

from mcz.container import payloads
from mcz.container.chunks import (
    CHECK_SIZE,
    COPIED,
    END,
    FRAME,
    OPEN_LENGTH,
    SEGMENT,
    SIGNATURE,
    Chunk,
    ChunkFlag,
    ChunkType,
    Packet,
    build_chunk,
    build_foot,
    build_header,
    build_packet,
    implied_by,
)
from mcz.container.directory import AttachmentRow, ClipRow, Directory, SegmentRow
from mcz.container.encodings import (
    Copy,
    build_copies,
    chunk_id,
    encode_smallest,
    group_copies,
    is_worth_copying,
    plain_id,
)
from mcz.container.index import build_index
from mcz.container.limits import BASE, MIB, Profile, check
from mcz.container.metadata import Record, build_metas
from mcz.container.model_records import build_head
from mcz.container.scanner import check_plain
from mcz.container.segments import FRESH, MASKS, SegmentHeader, build_segment, mask_of
from mcz.errors import FormatError, MotionError
from mcz.model.motion import Skeleton
from mcz.model.schema import build
from mcz.model.types import Params

ATTACHMENT_PART = MIB  # decoded bytes of one ATTA


class Sink(Protocol):
    def write(self, data: bytes, /) -> int | None: ...


UNINDEXED = 8192  # a shorter file is walked as fast as its index is read


class Writer:
    """Appends chunks to ``sink``; ``directory`` and ``offset`` continue an existing file.

    With ``copies``, chunks that all others depend on are stored a second time before INDX, and with
    them the ``uncopied`` ones of the existing file. ``short``: texts and skeletons may refer to the
    words of the annex, and a file of at most ``UNINDEXED`` bytes has no INDX.
    """

    def __init__(
        self,
        sink: Sink,
        *,
        profile: Profile = BASE,
        directory: Directory | None = None,
        offset: int = 0,
        head_extension: bytes = b"",
        copies: bool = False,
        uncopied: Iterable[Copy] = (),
        short: bool = False,
    ) -> None:
        self._sink = sink
        self.short = short and not profile.is_plain
        self.profile = profile
        self.offset = offset
        self.directory = directory or Directory()
        self._clip: ClipRow | None = None
        self._next_packet: int | None = None  # while a DATA is open
        # the segment with the mask of frames
        self._implying: tuple[SegmentRow, bytes] | None = None
        self.last_skeleton: tuple[Skeleton, bytes] | None = None  # and its id
        self._copies = list(uncopied) if copies and not profile.is_plain else None
        if offset == 0:
            self._write_head(head_extension)

    def _write_head(self, extension: bytes) -> None:
        self._write(SIGNATURE)
        self.directory.head = build_head(self.profile) + extension
        self.chunk(ChunkType.HEAD, self.directory.head)

    def _write(self, data: bytes) -> None:
        self._sink.write(data)
        self.offset += len(data)

    def chunk(self, kind: bytes, payload: bytes, flags: int = 0) -> Chunk:
        check(f"chunk {kind.decode()}: bytes", len(payload), self.profile.chunk_bytes)
        if self.profile.is_plain:
            check_plain(kind, payload, kind.decode())
        chunk = Chunk(kind, flags, self.offset, len(payload))
        self._write(build_chunk(kind, payload, flags))
        if self._copies is not None and kind in COPIED:
            self._copies.append(Copy(chunk.offset, kind, payload))
        return chunk

    def shared(self, kind: bytes, payload: bytes) -> bytes:
        """Write a SKEL, MODL or SRCE unless the file has it already; return its id."""
        id_ = chunk_id(kind, payload, self.profile)
        if (kind, id_) not in self.directory.shared:
            self._between_clips(kind.decode())
            self.directory.shared[kind, id_] = self.chunk(kind, payload)
        return id_

    def template(self, format_id: int, template: bytes) -> bytes:
        """Write a SRCE and return its id."""
        check("template: bytes", len(template), self.profile.text_bytes)
        record = payloads.Srce(format=format_id, size=len(template), data=template)
        id_ = plain_id(ChunkType.SRCE, build(record, "SRCE"))
        if (ChunkType.SRCE, id_) in self.directory.shared:
            return id_
        plain = self.profile.is_plain
        record.flags, record.data = encode_smallest(template, short=self.short, plain=plain)
        return self.shared(ChunkType.SRCE, build(record, "SRCE"))

    def attachment(self, name: str, data: bytes) -> None:
        """Write a whole file, opaque, in parts of 1 MiB."""
        most = min(ATTACHMENT_PART, self.profile.coded_bytes)
        pieces = [data[at : at + most] for at in range(0, len(data), most)] or [b""]
        digest = hashlib.sha256(data).digest()
        parts = []
        for part, piece in enumerate(pieces):
            flags, packed = encode_smallest(piece, short=self.short, plain=self.profile.is_plain)
            record = payloads.Atta(
                name=name,
                part=part,
                n_parts=len(pieces),
                size=len(data),
                sha256=digest,
                flags=flags,
                part_size=len(piece),
                data=packed,
            )
            parts.append(build(record, "ATTA"))
        self.attachment_parts(name, len(data), parts)

    def attachment_parts(self, name: str, size: int, parts: Sequence[bytes]) -> None:
        """Write an attachment from the payloads of its ATTA chunks."""
        self._between_clips("ATTA")
        self._new_name(name, self.directory.attachments)
        row = AttachmentRow(name, size, [self.chunk(ChunkType.ATTA, part) for part in parts])
        self.directory.attachments[name] = row

    def alias(self, name: str, of: int, target: bytes) -> None:
        """Write that the file ``name`` is identical to a stored one."""
        self._between_clips("ALIA")
        self._new_name(name, self.directory.aliases)
        self.chunk(ChunkType.ALIA, build(payloads.Alia(name=name, of=of, target=target), "ALIA"))
        self.directory.aliases[name] = (of, target)

    def ancillary(self, kind: bytes, payload: bytes, *, safe_to_copy: bool = True) -> None:
        """Write an ancillary chunk; between clips it belongs to the clip before."""
        flags = ChunkFlag.ANCILLARY | (ChunkFlag.SAFE_TO_COPY if safe_to_copy else 0)
        chunk = self.chunk(kind, payload, flags)
        last = self.directory.clips.last
        if self._clip is None and last is not None:
            last.ancillary.append(chunk)

    def begin_clip(self, record: payloads.Clip) -> None:
        self._between_clips("CLIP")
        name = record.name
        if not name:
            raise MotionError("a clip must have a name")
        self._new_name(name, self.directory.clips)
        chunk = self.chunk(ChunkType.CLIP, build(record, f"clip {name!r}"))
        self._clip = ClipRow.of(record, chunk)

    def segment(
        self, header: SegmentHeader, streams: Sequence[bytes], extension: bytes = b""
    ) -> None:
        """Write one segment as a closed DATA, or as a packet while a DATA is open."""
        clip = self._in_clip("DATA")
        payload = build_segment(header, streams, extension)
        if self._next_packet is None:
            chunk = self.chunk(ChunkType.DATA, payload)
            clip.segments.append(SegmentRow(chunk.payload_offset, len(payload), header))
        else:
            fresh = bool(header.flags & FRESH)
            packet = Packet(SEGMENT, self._next_packet, payload, fresh)
            row = self._packet(clip, header, packet)
            if header.signal == 0:
                self._implying = row, payload

    def frame(self, first: int, stream: bytes, *, fresh: bool) -> None:
        """Write a segment of one frame of signal 0, which has one stream, as a packet of kind 2.

        A DATA is open, and contains frame ``first`` - 1 of signal 0. The mask is the one of the
        last segment written there by ``segment``.
        """
        clip = self._in_clip("DATA")
        if self._next_packet is None or self._implying is None:
            raise FormatError("no open DATA has a segment of signal 0")
        model, segment = self._implying
        masks = model.header.flags & MASKS  # PACK-20
        header = SegmentHeader(0, first, 1, flags=fresh * FRESH | masks)
        implied = implied_by(first, mask_of(segment))
        packet = Packet(FRAME, self._next_packet, stream, fresh, implied)
        self._packet(clip, header, packet, model if masks else None)

    def _packet(
        self, clip: ClipRow, header: SegmentHeader, packet: Packet, model: SegmentRow | None = None
    ) -> SegmentRow:
        size = len(packet.body)
        check("packet: bytes", size, self.profile.packet_bytes)
        data = build_packet(packet)
        start = self.offset + len(data) - CHECK_SIZE - size
        self._write(data)
        self._next_packet = packet.sequence + 1
        row = SegmentRow(start, size, header, packet.kind, model)
        clip.segments.append(row)
        return row

    def open_data(self) -> None:
        """Begin an open DATA: until ``close_data``, each segment is one packet."""
        self._in_clip("DATA")
        if self._next_packet is not None:
            raise FormatError("a DATA is already open")
        self._write(build_header(ChunkType.DATA, 0, OPEN_LENGTH))
        self._next_packet, self._implying = 0, None

    def close_data(self) -> None:
        if self._next_packet is None:
            raise FormatError("no DATA is open")
        self._write(build_packet(Packet(END, self._next_packet, b"")))
        self._next_packet = None

    def end_clip(
        self,
        n_frames: int,
        source_sha256: bytes,
        value_sha256: Sequence[bytes],
        extension: bytes = b"",
        missing: Sequence[payloads.MissingRun] = (),
    ) -> None:
        """Write CEND; an empty ``source_sha256`` means that there is no source.

        ``missing`` are the runs of missing frames of a clip that was open.
        """
        clip = self._in_clip("CEND")
        if self._next_packet is not None:
            self.close_data()
        record = payloads.Cend(
            n_frames=n_frames,
            missing=list(missing),
            source_sha256=source_sha256 or None,
            value_sha256=list(value_sha256),
            extension=extension,
        )
        clip.n_frames = n_frames
        clip.cend = self.chunk(ChunkType.CEND, build(record, "CEND"))
        self.directory.clips[clip.name] = clip
        self._clip = None

    def metadata(self, records: Sequence[Record]) -> None:
        """Write metadata of stored clips, or of the file, in META chunks.

        Raises MotionError in a file without a clip: no index would find them.
        """
        self._between_clips("META")
        if records and not self.directory.clips:
            raise MotionError("metadata need a clip, and the file has none")  # META-01
        metas = build_metas(records, short=self.short, profile=self.profile, file_bytes=self.offset)
        for payload in metas:
            self.ancillary(ChunkType.META, payload)

    def begin_carried(self, row: ClipRow, payload: bytes) -> None:
        """Write the CLIP ``payload`` of a clip whose chunks are copied from another file.

        They are written with ``chunk`` and ``raw``, CEND among them; ``row`` gets the place of its
        CLIP, and is in the directory from ``end_carried`` on.
        """
        self._between_clips("CLIP")
        self._new_name(row.name, self.directory.clips)
        row.clip = self.chunk(ChunkType.CLIP, payload)
        self._clip = row

    def raw(self, data: bytes) -> None:
        """Write a part of an open DATA of another file."""
        self._in_clip("DATA")
        self._write(data)

    def end_carried(self) -> None:
        row = self._in_clip("CEND")
        self.directory.clips[row.name] = row
        self._clip = None

    def finish(self, *, index: bool = True) -> None:
        """Write the requested copies, INDX, unless disabled, and FOOT."""
        self._between_clips("FOOT")
        if self._copies:
            copies = (copy for copy in self._copies if is_worth_copying(copy, self.offset))
            for run in group_copies(copies):
                self.ancillary(ChunkType.COPY, build_copies(run, self.offset), safe_to_copy=False)
        start, length = 0, 0
        if index and not (self.profile.is_plain or (self.short and self.offset <= UNINDEXED)):
            chunk = build_index(self.directory)
            check("INDX: bytes", len(chunk), self.profile.chunk_bytes)
            start, length = self.offset, len(chunk)
            self._write(chunk)
        self._write(build_foot(start, length))
        self.directory.end = self.offset

    def rewind(self, directory: Directory, offset: int) -> None:
        """Forget the chunks written since, which the caller has kept from the sink."""
        self.directory, self.offset = directory, offset
        self._clip = self._next_packet = None
        if self._copies is not None:
            self._copies = [copy for copy in self._copies if copy.offset < offset]

    def _between_clips(self, chunk: str) -> None:
        if self._clip is not None:
            raise FormatError(f"{chunk} inside the clip {self._clip.name!r}")

    def _in_clip(self, chunk: str) -> ClipRow:
        if self._clip is None:
            raise FormatError(f"{chunk} outside a clip")
        return self._clip

    def _new_name(self, name: str, table: Params) -> None:
        if name in table:
            raise MotionError(f"the file already has {name!r}")
