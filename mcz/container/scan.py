"""Walking a file chunk by chunk: the way to a Directory without, or in spite of, INDX.

A strict scan raises at the first fault. A salvaging scan writes it down, looks for the next
valid chunk and goes on. SPEC.md, "Grammar" and "Salvage", are normative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

from mcz.container import payloads, strict
from mcz.container.bounds import NOBODY, Bounds, Owners
from mcz.container.chunks import (
    ANCILLARY,
    FLAGS_OF,
    FOOT,
    HEADER,
    META,
    REPEAT,
    REPEATED,
    SIGNATURE,
    Chunk,
    check_signature,
    chunks_in,
    is_foot_at,
    named_chunk,
    parse_foot,
    read_chunk,
    read_payload,
    resynchronize,
)
from mcz.container.directory import (
    AttachmentRow,
    ClipRow,
    Found,
    SegmentRow,
    parse_head,
    signal_rows,
)
from mcz.container.limits import PROFILES, Search, check, index_limit
from mcz.container.packets import CHECK_SIZE, read_packets, whole_until
from mcz.container.segments import header_of, parse_header
from mcz.container.source import ByteSource, Forward
from mcz.container.strict_ancillary import check_ancillary
from mcz.container.writer import payload_id
from mcz.errors import FormatError, LimitError, TruncatedError, UnsupportedError
from mcz.schema import parse

PEEK = 64  # enough for the fields of a segment before its table


def scan(
    source: ByteSource, *, salvage: bool = False, whole: bool = False, owners: Owners = NOBODY
) -> Found:
    """Walk the file. ``whole`` also checks the crc of every chunk (salvage always does) and,
    unless salvaging, what is in it and whether INDX agrees with it; ``owners``: see ``Bounds``.

    Raises FormatError at the first fault unless ``salvage``; a TruncatedError carries the end
    of the last valid FOOT.
    """
    walker = Walker(source, salvage, whole or salvage, Bounds(owners))
    try:
        walker.walk()
    except TruncatedError as error:
        feet = walker.found.feet
        error.last_foot = feet[-1] + FOOT.size if feet else None
        raise
    return walker.found


class Walker:
    """The state of a walk; ``chunk`` is the one that it is in."""

    def __init__(self, source: ByteSource, salvage: bool, whole: bool, bounds: Bounds) -> None:
        self.source = source
        self.bounds = bounds
        self.salvage = salvage
        self.whole = whole
        self.strict = whole and not salvage
        self.found = Found()
        self.profile = PROFILES[0]
        self.templates: dict[bytes, int] = {}  # the source format of each SRCE
        self.model_bytes = 0
        self.search = Search()
        self.clip: ClipRow | None = None
        self.first: list[int] = []  # the next frame of each signal of the open clip
        self.index: Chunk | None = None  # an INDX that waits for its FOOT
        self.chunk: Chunk | None = None
        self.sourced: set[tuple[int, bytes]] = set()  # what aliases may stand for

    def walk(self) -> None:
        try:
            check_signature(self.source)
        except FormatError as error:
            if not self.salvage:
                raise
            self._note(error)
        at: int | None = len(SIGNATURE)
        while at is not None and at != self._whole_until():  # GRAM-09
            begin = at
            try:
                for end in self.steps(begin):
                    at = end
            except FormatError as error:
                if not self.salvage:
                    error.offset = begin
                    raise
                self._note(error)  # SALV-03
                self.found.broken.append((begin, named_chunk(self.source, begin)))
                at = self._skip(begin, at)  # SALV-01, SALV-02, SALV-04
            else:
                self.bounds.is_sound()
        self._finish()

    def _whole_until(self) -> int | None:
        """The end of the file once a FOOT has closed it, else None."""
        closed = self.found.directory.end == self.source.size and self.clip is None  # STRICT-01
        return self.source.size if closed else None

    def steps(self, at: int) -> Iterator[int]:
        """Take in what begins at ``at``; yields where it ends, of an open DATA packet by packet."""
        self.chunk = None
        if at >= self.source.size:
            raise TruncatedError(f"the file ends at {at} without a FOOT")
        if is_foot_at(self.source, at):
            yield self._foot(at)
            return
        chunk = self.chunk = read_chunk(self.source, at)
        if self.index is not None:  # GRAM-01
            raise FormatError(f"INDX is followed by {chunk.label}, not by a FOOT")
        if not (self.found.directory.head or self.salvage) and chunk.type != b"HEAD":
            raise FormatError(f"the first chunk is {chunk.label}, not HEAD")
        if chunk.length is None and not chunk.flags:  # CHUNK-10, PACK-10
            end = chunk.payload_offset
            for end in self._packets(chunk):
                yield end
            self.found.ends[chunk.offset] = end
        else:
            self._take(chunk)
            yield chunk.offset + chunk.size
        self.found.chunks.append(chunk)

    def _take(self, chunk: Chunk) -> None:
        if self.salvage and self._is_repeated(chunk):
            return
        handlers: dict[bytes, Callable[[Chunk], None]] = {
            b"HEAD": self._head,
            b"SKEL": self._shared,
            b"MODL": self._shared,
            b"SRCE": self._shared,
            b"ATTA": self._attachment,
            b"ALIA": self._alias,
            b"CLIP": self._begin_clip,
            b"DATA": self._data,
            b"CEND": self._end_clip,
            b"INDX": self._index,
        }
        handler = handlers.get(chunk.type)
        if handler is not None:
            if chunk.flags:  # CHUNK-15
                raise FormatError(f"chunk {chunk.label}: flags {chunk.flags:#x} on a critical type")
            handler(chunk)
        elif chunk.flags != FLAGS_OF.get(chunk.type, chunk.flags):
            raise FormatError(f"chunk {chunk.label}: flags {chunk.flags:#x}, not those of its type")
        elif chunk.flags & ANCILLARY:  # CHUNK-12
            self._ancillary(chunk)
        else:
            raise UnsupportedError(f"chunk {chunk.label} is critical and unknown")  # CHUNK-11

    def _is_repeated(self, chunk: Chunk) -> bool:
        """Whether it lies in a REPT whose own header is damaged: the clip that is open goes on."""
        if self.clip is None or chunk.type not in REPEATED:
            return False
        payload = self._payload(chunk)
        if chunk.type == b"HEAD":
            return payload == self.found.directory.head
        if chunk.type == b"CLIP":
            return payload == self._payload(self.clip.clip)
        return (chunk.type, payload_id(payload)) in self.found.directory.shared

    def _payload(self, chunk: Chunk) -> bytes:
        return read_payload(self.source, chunk, self.profile.chunk_bytes)

    def _head(self, chunk: Chunk) -> None:
        if self.found.directory.head:  # GRAM-01
            raise FormatError(f"a second HEAD at {chunk.offset}")
        payload = self._payload(chunk)
        self.profile = parse_head(payload)
        self.found.directory.head = payload

    def _shared(self, chunk: Chunk) -> None:
        self._outside(chunk)
        payload = self._payload(chunk)
        id_ = payload_id(payload)
        if self.strict:
            self._check_shared(chunk, id_, payload)
        self.found.directory.shared.setdefault((chunk.type, id_), chunk)  # GRAM-05

    def _check_shared(self, chunk: Chunk, id_: bytes, payload: bytes) -> None:
        if chunk.type == b"SKEL":
            directory = self.found.directory
            # ALIA-01
            if strict.check_skeleton(payload, chunk.label, directory, self.templates, self.profile):
                self.sourced.add((payloads.OF_SKELETON, id_))
        elif chunk.type == b"SRCE":
            self.templates[id_] = strict.check_template(payload, chunk.label, self.profile)
        else:
            parse(payloads.Modl, payload, chunk.label)
            self.model_bytes += len(payload)
            # LIMIT-06
            check(f"chunk {chunk.label}: all models", self.model_bytes, self.profile.model_bytes)

    def _attachment(self, chunk: Chunk) -> None:
        self._outside(chunk)
        fields = parse(payloads.Atta, self._payload(chunk), chunk.label)
        rows = self.found.directory.attachments
        if self.strict:
            strict.check_path(fields.name, chunk.label)
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
        self.sourced.add((payloads.OF_ATTACHMENT, fields.name.encode()))

    def _alias(self, chunk: Chunk) -> None:
        self._outside(chunk)
        fields = parse(payloads.Alia, self._payload(chunk), chunk.label)
        if fields.name in self.found.directory.aliases:  # GRAM-08
            raise FormatError(f"chunk {chunk.label}: a second alias {fields.name!r}")
        if self.strict:
            strict.check_path(fields.name, chunk.label)
            strict.check_target(fields, chunk.label, self.sourced)
        self.found.directory.aliases[fields.name] = (fields.of, fields.target)

    def _begin_clip(self, chunk: Chunk) -> None:
        self._outside(chunk)
        self.clip, self.first = None, []
        self.bounds.begin()
        fields = parse(payloads.Clip, self._payload(chunk), chunk.label)
        if not fields.name or fields.name in self.found.directory.clips:  # CLIP-01, GRAM-06
            raise FormatError(f"chunk {chunk.label}: clip name {fields.name!r} is empty or taken")
        if not fields.signals:  # CLIP-05
            raise FormatError(f"chunk {chunk.label}: a clip without a signal")
        if self.strict and strict.check_clip(
            fields, chunk.label, self.found.directory, self.templates
        ):  # ALIA-02
            self.sourced.add((payloads.OF_CLIP, fields.name.encode()))
        signals = signal_rows(fields, chunk.label)
        rate = fields.rate_numerator, fields.rate_denominator
        self.clip = ClipRow(fields.name, fields.skeleton, fields.n_frames, *rate, signals, chunk)
        self.first = [0] * len(signals)

    def _data(self, chunk: Chunk) -> None:
        assert chunk.length is not None
        if self.whole:
            payload = self._payload(chunk)
        else:
            payload = self.source.read(chunk.payload_offset, min(chunk.length, PEEK))
        row = SegmentRow(chunk.payload_offset, chunk.length, parse_header(payload)[0])
        self._segment(row)

    def _packets(self, chunk: Chunk) -> Iterator[int]:
        """Take in the packets of an open DATA; yields where each one ends."""
        if self.clip is None:  # PACK-10
            raise FormatError(f"chunk {chunk.label} is outside a clip")
        read = Forward(self.source, chunk.payload_offset)
        told = False  # a segment of signal 0 has said which frame it is
        for packet in read_packets(read, self.profile.packet_bytes):
            start = read.at - CHECK_SIZE - len(packet.body)
            header = header_of(packet, start, self.first[0], is_known=told)
            self._segment(SegmentRow(start, len(packet.body), header, packet.kind))
            told = told or header.signal == 0
            yield read.at
        yield read.at

    def _segment(self, row: SegmentRow) -> None:
        header, offset = row.header, row.offset
        if self.clip is None:
            raise FormatError(f"DATA at {offset - HEADER.size} is outside a clip")
        self.bounds.check(self.clip.name, "DATA", offset, row.size)
        if header.signal >= len(self.first):
            raise FormatError(f"DATA at {offset - HEADER.size}: signal {header.signal}")  # DATA-06
        due = self.first[header.signal]
        if header.first != due and not (self.salvage and header.first > due):  # DATA-08
            raise FormatError(
                f"DATA at {offset - HEADER.size}: first frame {header.first}, {due} is due"
            )
        self.first[header.signal] = header.stop  # DATA-08
        self.clip.segments.append(row)

    def _end_clip(self, chunk: Chunk) -> None:
        if self.clip is None:
            raise FormatError(f"{chunk.label} is outside a clip")
        fields = parse(payloads.Cend, self._payload(chunk), chunk.label)
        self.bounds.check(self.clip.name, "CEND", chunk.offset, chunk.size)
        self.clip.n_frames, self.clip.cend = fields.n_frames, chunk
        self._close_clip()

    def _close_clip(self) -> None:
        self.bounds.begin()
        if self.clip is None:
            return
        clip, self.clip = self.clip, None
        if clip.cend is None:
            clip.damage.append(f"clip {clip.name!r} has no CEND")
            clip.n_frames = clip.frames_found(self.first)
        for signal, (frames, row) in enumerate(zip(self.first, clip.signals, strict=True)):
            stored = row.stored(clip.n_frames)
            if frames != stored:
                error = FormatError(
                    f"clip {clip.name!r}: signal {signal} has {frames} of {stored} frames"
                )
                if not self.salvage:
                    raise error
                clip.damage.append(str(error))
        self.found.directory.clips[clip.name] = clip

    def _index(self, chunk: Chunk) -> None:
        self._outside(chunk)
        payload = self._payload(chunk)
        if self.strict:  # STRICT-04
            limit = index_limit(self.source.size)
            strict.check_index(payload, chunk, self.found.directory, limit)  # INDX-02, STRICT-04
        self.index = chunk

    def _ancillary(self, chunk: Chunk) -> None:
        if self.whole:
            payload = self._payload(chunk)
            if self.strict:
                if chunk.type == META and self.clip is not None:  # META-02
                    raise FormatError(f"chunk {chunk.label} is inside the clip {self.clip.name!r}")
                self._check_ancillary(chunk, payload)
            if self.salvage and chunk.type == REPEAT:  # REPT-03
                self._repeat(chunk, payload)
        if self.clip is None and self.found.directory.clips:
            last = next(reversed(self.found.directory.clips))
            self.found.directory.clips[last].ancillary.append(chunk)

    def _check_ancillary(self, chunk: Chunk, payload: bytes) -> None:
        check_ancillary(chunk, payload, self.source.size, self.found, self._payload)

    def _repeat(self, chunk: Chunk, payload: bytes) -> None:
        """Take in the chunks of a REPT: of a clip that is open, those that may have been lost."""
        held = self.found.directory
        own = b"" if self.clip is None else self._payload(self.clip.clip)
        if self.bounds.doubt and not self.bounds.settle(payload, chunk.offset, own):
            self._close_clip()
        if self.clip is None:
            for inner in chunks_in(payload, chunk.payload_offset):
                if inner.type != b"HEAD" or not held.head:
                    self._take(inner)
        elif self.found.damage:
            with suppress(FormatError):  # what is no REPT says nothing
                for inner in chunks_in(payload, chunk.payload_offset):
                    if inner.type in (b"SKEL", b"MODL"):
                        id_ = payload_id(self._payload(inner))
                        held.shared.setdefault((inner.type, id_), inner)

    def _foot(self, at: int) -> int:
        self._outside(Chunk(b"FOOT", 0, at, 0))
        foot = parse_foot(self.source.read(at, FOOT.size), at)
        index = (self.index.offset, self.index.size) if self.index else (0, 0)
        if foot is None or (foot.index_offset, foot.index_length) != index:  # FOOT-04
            raise FormatError(f"FOOT at {at} points to {foot}, the index is at {index}")
        if not (self.found.directory.head or self.salvage):
            raise FormatError(f"FOOT at {at} comes before HEAD")
        self.index = None
        self.found.feet.append(at)
        self.found.directory.end = at + FOOT.size
        return at + FOOT.size

    def _outside(self, chunk: Chunk) -> None:
        if self.clip is not None:
            if not self.salvage:  # GRAM-01
                raise FormatError(f"chunk {chunk.label} is inside the clip {self.clip.name!r}")
            self._close_clip()  # GRAM-01

    def _note(self, error: FormatError) -> None:
        self.found.damage.append(str(error))
        if self.clip is not None:
            self.clip.damage.append(str(error))

    def _skip(self, at: int, done: int) -> int | None:
        """Where to go on after a fault in what begins at ``at`` and was good up to ``done``."""
        self.index = None
        end, profile = None, self.profile
        with suppress(FormatError):
            chunk = read_chunk(self.source, at)
            start, most = chunk.payload_offset, profile.packet_bytes
            end = None if chunk.length is None else chunk.offset + chunk.size
            done = done if end else max(done, whole_until(self.source, start, most))
        self.bounds.begin_fault(max(at, done))
        if end is not None:
            return end  # its header is sound, so its end is known
        try:
            spend = partial(self.search.spend, came=self.source.size, what="a chunk")
            at = max(at + 1, done)
            found = resynchronize(self.source, at, profile.chunk_bytes, spend)
        except LimitError as error:
            self._note(error)
            return None
        if self.clip is not None and found is not None:
            self.found.doubts |= self.bounds.skip(found)
        return found

    def _finish(self) -> None:
        self._close_clip()
        if self.salvage and not self.found.feet:
            self.found.damage.append("the file has no valid FOOT")
