"""The scan of a file: builds a Directory without, or in spite of, INDX.

A strict scan raises at the first fault. A salvaging scan notes it, and continues with the next
event; it leaves out parts after lost bytes that may belong to another clip. SPEC.md, "Grammar" and
"Salvage", are normative.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from types import MappingProxyType

from mcz.container.chunks import END, FOOT, FRAMING, REPEATED, Chunk, ChunkType, read_payload
from mcz.container.directory import SegmentRow
from mcz.container.encodings import chunk_id
from mcz.container.grammar import (
    BODY,
    CLIP,
    GRAMMAR,
    INDEX,
    NAMED,
    OTHER,
    START,
    ChunkEvent,
    Event,
    Fault,
    FootEvent,
    PacketEvent,
)
from mcz.container.parser_drivers import events, repeated_chunks
from mcz.container.scanner import Scanner, ScanResult
from mcz.container.source import ByteSource
from mcz.errors import FormatError, LimitError, TruncatedError, UnsupportedError

LEAST_BETWEEN = 2 * FRAMING  # least number of bytes with a CEND and the next CLIP
Owners = Mapping[tuple[int, int], str]  # offset and size of segments and CENDs -> name of the clip
NOBODY: Owners = MappingProxyType({})


def scan(
    source: ByteSource, *, salvage: bool = False, whole: bool = False, owners: Owners = NOBODY
) -> ScanResult:
    """Scan the file; ``owners``: those of segments and CENDs in an index.

    ``whole`` also checks the crc of every chunk (salvage always does) and, unless salvaging, the
    contents of chunks and of INDX. Raises FormatError at the first fault unless ``salvage``; a
    TruncatedError carries the end of the last valid FOOT.
    """

    def payload(chunk: Chunk) -> bytes:
        return read_payload(source, chunk, scanner.parser.profile.chunk_bytes)

    if salvage:
        scanner: Scanner = Salvager(source.size, owners)
    else:
        scanner = Scanner(source.size, whole=whole, payload_of=payload)
    try:
        for event in events(source, scanner.parser):
            scanner.take(event)
    except TruncatedError as error:
        feet = scanner.result.feet
        error.last_foot = feet[-1] + FOOT.size if feet else None
        raise
    scanner.finish()
    return scanner.result


class Salvager(Scanner):
    """A salvaging scan: it notes faults, and uses what it can."""

    def __init__(self, size: int, owners: Owners) -> None:
        super().__init__(size)
        self.strict = False
        self._owners = owners
        self._doubt = False  # the open clip may have ended, and another begun, in lost bytes
        self._fault: int | None = None  # start of the present unusable bytes
        self._opening = b""  # the payload of the CLIP that is open
        self._is_draining = False  # after a bad packet, later ones are skipped
        self._is_lost = False  # bytes before the next event are unknown

    def take(self, event: Event) -> None:
        """Process an event; faults are noted."""
        if self._is_lost:
            self._is_lost = False
            if isinstance(event, Fault) and event.offset == self._size:
                return
            if self.clip is not None:
                self._doubt |= event.offset - (self._fault or 0) >= LEAST_BETWEEN
                self.result.doubts |= self._doubt
        if self._is_draining:
            self._drain(event)
        else:
            try:
                if isinstance(event, Fault):
                    self._take_misplaced(event)
                else:
                    self._take(event)
            except FormatError as error:
                of_head = getattr(getattr(event, "chunk", None), "type", b"") == ChunkType.HEAD
                if of_head and isinstance(error, UnsupportedError):
                    raise  # other versions are unreadable
                self._note(error)  # SALV-03
                self._skip(event)
            else:
                if not _is_inside(event):
                    self._fault = None
        if self.parser.state in (START, BODY, CLIP):
            self.parser.state = BODY if self.clip is None else CLIP

    def _take_misplaced(self, fault: Fault) -> None:
        """Use an intact thing at a wrong place; raises an error if it cannot."""
        event, chunk = fault.event, fault.chunk
        if isinstance(event, FootEvent):
            self._close_clip()  # GRAM-01
            if event.is_right:
                self._take(event)
                return
        elif isinstance(event, ChunkEvent) and fault.state != INDEX:
            kind, head = event.chunk.type, self.result.directory.head
            if self.clip is not None and self._is_repeated(event):
                self.result.chunks.append(event.chunk)
                return
            if BODY in GRAMMAR[event.thing]:
                self._close_clip()  # GRAM-01
            if BODY in GRAMMAR[event.thing] or (kind == ChunkType.HEAD and not head):
                self._take(event)
                return
        elif event is None and chunk is not None and not fault.is_lost:
            thing = NAMED.get(chunk.type, OTHER)
            if (
                chunk.type not in REPEATED
                and CLIP not in GRAMMAR[thing]
                and chunk.length is not None
            ):
                self._close_clip()
        raise fault.error

    def _is_repeated(self, event: ChunkEvent) -> bool:
        """Return True for a chunk in a REPT with a damaged header: the open clip continues."""
        kind = event.chunk.type
        if kind not in REPEATED:
            return False
        payload = event.payload
        if kind == ChunkType.HEAD:
            return payload == self.result.directory.head
        if kind == ChunkType.CLIP:
            return payload == self._opening
        try:
            return (kind, chunk_id(kind, payload)) in self.result.directory.shared
        except FormatError:
            return False

    def _note(self, error: FormatError) -> None:
        self.result.damage.append(str(error))
        if self.clip is not None:
            self.clip.damage.append(str(error))

    def _skip(self, event: Event) -> None:
        fault = event if isinstance(event, Fault) else None
        inner, chunk = (fault.event if fault else event), getattr(event, "chunk", None)
        if not event.offset or (
            self.parser.is_done and fault and isinstance(fault.error, LimitError)
        ):
            return  # the signature, or the end of an exhausted search
        self.result.broken.append((event.offset if chunk is None else chunk.offset, chunk))
        if isinstance(inner, FootEvent):
            self._search(inner.offset, inner.offset + 1)
        elif inner is not None and _is_inside(inner):
            self._is_draining = True  # SALV-04
        elif chunk is not None and chunk.length is None:
            self._search(event.offset, event.offset)
        else:
            self._fault = event.offset if self._fault is None else self._fault
            self._is_lost = fault is not None and fault.is_lost

    def _search(self, fault: int, at: int) -> None:
        """Search from ``at`` on for an intact thing; unusable bytes began at ``fault``."""
        self._fault = fault if self._fault is None else self._fault
        self.parser.search(at)  # SALV-02
        self._is_lost = True

    def _drain(self, event: Event) -> None:
        inner = event.event if isinstance(event, Fault) else event
        if not isinstance(inner, PacketEvent):
            self._search(event.offset, event.offset)
        elif inner.packet.kind == END:
            self._search(inner.end, inner.end)
        else:
            return
        self._is_draining = False

    # Salvaged parts, used in other ways ----------------------------------------

    def _begin_clip(self, chunk: Chunk, payload: bytes) -> None:
        self._doubt = False
        super()._begin_clip(chunk, payload)
        self._opening = payload

    def _segment(self, row: SegmentRow) -> None:
        self._check_owner("DATA", row.offset, row.size)
        super()._segment(row)

    def _may_follow(self, first: int, frame: int) -> bool:
        return first >= frame

    def _end_clip(self, chunk: Chunk, payload: bytes) -> None:
        self._check_owner("CEND", chunk.offset, chunk.size)
        super()._end_clip(chunk, payload)

    def _check_owner(self, kind: str, offset: int, size: int) -> None:
        """Raise FormatError for a part that may belong to another clip than the open one."""
        assert self.clip is not None
        owner = self._owners.get((offset, size))
        if owner == self.clip.name:
            self._doubt = False
        elif owner is not None or self._doubt:  # SALV-10
            raise FormatError(
                f"{kind} at {offset} lies behind bytes that may have ended clip {self.clip.name!r}"
            )

    def _close_clip(self) -> list[FormatError]:
        clip = self.clip
        self._doubt = False
        if clip is not None:
            if clip.cend is None:
                clip.damage.append(f"clip {clip.name!r} has no CEND")
                clip.n_frames = clip.frames_found(self.first)
            clip.damage += map(str, super()._close_clip())
        return []

    def _ancillary(self, chunk: Chunk, payload: bytes) -> None:
        if chunk.type == ChunkType.REPT:  # REPT-03
            self._repeat(chunk, payload)
        super()._ancillary(chunk, payload)

    def _repeat(self, chunk: Chunk, payload: bytes) -> None:
        """Use the chunks of a REPT; within a clip only those that may have been lost."""
        directory = self.result.directory
        if self._doubt and not self._settle_doubt(payload, chunk.offset):
            self._close_clip()
        if self.clip is None:
            for inner in repeated_chunks(payload, chunk.payload_offset):
                if inner.thing != "HEAD" or not directory.head:
                    self._handlers[inner.thing](inner.chunk, inner.payload)
        elif self.result.damage:
            with suppress(FormatError):  # a bad REPT is skipped
                for inner in repeated_chunks(payload, chunk.payload_offset):
                    if inner.thing in ("SKEL", "MODL"):
                        kind = inner.chunk.type
                        key = kind, chunk_id(kind, inner.payload)
                        directory.shared.setdefault(key, inner.chunk)

    def _settle_doubt(self, payload: bytes, offset: int) -> bool:
        """Settle it by a REPT with ``payload`` at ``offset``; False if that is in another clip."""
        try:
            chunks = repeated_chunks(payload, offset)
        except FormatError:  # a bad REPT settles nothing
            return True
        clips = [event.payload for event in chunks if event.chunk.type == ChunkType.CLIP]
        own = b"" if self.clip is None else self._opening
        self._doubt = clips != [own]
        return not clips or not self._doubt

    def finish(self) -> None:
        self._close_clip()
        if not self.result.feet:
            self.result.damage.append("the file has no valid FOOT")


def _is_inside(event: Event) -> bool:
    """Return True for an open DATA and its packets but the end: more of the chunk follows."""
    if isinstance(event, ChunkEvent):
        return event.chunk.length is None
    return isinstance(event, PacketEvent) and event.packet.kind != END
