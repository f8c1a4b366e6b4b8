"""Every checksum of a file in one pass over its bytes, nothing decoded.

The pass runs at the speed of the disk, holds a block at a time, and goes on after a fault, so that
all are named. SPEC.md, "Chunks", "Open DATA and packets", "INDX" and "FOOT", are normative.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from mcz.container.chunks import (
    ANCILLARY,
    CRC,
    FOOT,
    HEADER,
    SIGNATURE,
    Chunk,
    check_chunk,
    check_signature,
    parse_foot,
    parse_header,
    resynchronize,
)
from mcz.container.directory import parse_head
from mcz.container.index import parse_index
from mcz.container.limits import PROFILES, Search, check, index_limit
from mcz.container.packets import CHECK_SIZE, END, NUMBERED, SEGMENT
from mcz.container.places import Places
from mcz.container.segments import parse_header as parse_segment
from mcz.container.source import ByteSource
from mcz.errors import ChecksumError, FormatError, LimitError, TruncatedError, UnsupportedError
from mcz.schema import read_varint

BLOCK = 2 * 1024 * 1024  # bytes that are read at a time; a packet has at most 1 MiB
PEEK = 64  # enough for the fields of a segment before its table
MOST_FRAMING = 1 + 8 + 8 + 2 * CHECK_SIZE  # bytes of a packet around its body
SHARED = (b"SKEL", b"MODL", b"SRCE")
CRITICAL = (b"HEAD", *SHARED, b"ATTA", b"ALIA", b"CLIP", b"DATA", b"CEND", b"INDX")

Told = Callable[[int, int], object]


@dataclass(slots=True)
class Checked:
    """What a pass has seen; ``faults``: where each is, and what is wrong, in file order.

    ``indexed``: whether the file ends with an INDX, which was compared with what is there.
    """

    n_chunks: int = 0
    n_packets: int = 0
    indexed: bool = False
    faults: list[tuple[int, str]] = field(default_factory=list)


def check_checksums(source: ByteSource, progress: Told | None = None) -> Checked:
    """Check each checksum of ``source``, and INDX and FOOT against the chunks that are there.

    Nothing is decoded: only a full check finds what is wrong within sound checksums. ``progress``
    is called with the bytes that are done and those of the file.
    Raises UnsupportedError where the file needs a newer reader, AccessError where it cannot be
    read.
    """
    walk = _Walk(source, progress)
    walk.run()
    return walk.seen


class _Blocks:
    """Parts of a source in rising order, from blocks of ``BLOCK`` bytes."""

    def __init__(self, source: ByteSource) -> None:
        self._source = source
        self._start, self._block = 0, memoryview(b"")

    def __call__(self, at: int, size: int) -> memoryview:
        """The ``size`` bytes at ``at``, at most ``BLOCK``; fewer where the file ends before."""
        size = min(size, self._source.size - at)
        first = at - self._start
        if first < 0 or first + size > len(self._block):
            block = min(BLOCK, self._source.size - at)
            self._start, self._block = at, memoryview(self._source.read(at, block))
            first = 0
        return self._block[first : first + size]

    def each(self, at: int, size: int) -> Iterator[memoryview]:
        """The ``size`` bytes at ``at``, however many, in parts."""
        while size:
            part = self(at, min(size, BLOCK))
            yield part
            at, size = at + len(part), size - len(part)


class _Walk:
    """The state of the pass."""

    def __init__(self, source: ByteSource, progress: Told | None) -> None:
        self.source, self.read = source, _Blocks(source)
        self.progress = progress
        self.seen = Checked()
        self.profile = PROFILES[0]
        self.places = Places()
        self.due: int | None = None  # the next frame of signal 0, where a segment has said it
        self.index: Chunk | None = None  # that waits for its FOOT
        self.end = 0  # of the last FOOT
        self.lost = False  # some of what is there is not known
        self.search = Search()

    def run(self) -> None:
        try:
            check_signature(self.source)
        except FormatError as error:
            self._fault(0, str(error))
        at, last = len(SIGNATURE), None
        while at < self.source.size:
            begin, before = at, self.index
            try:
                at = self._step(begin)
            except UnsupportedError:
                raise
            except FormatError as error:
                self._fault(begin, str(error))
                at = self._resumed(begin)
            last = before if self.end == at else last  # the index that the last FOOT closes
            if self.progress is not None:
                self.progress(at, self.source.size)
        if self.end != self.source.size:
            self._fault(self.source.size, f"the file ends at {self.source.size} without a FOOT")
        elif last is not None:
            self._compare(last)

    def _fault(self, at: int, text: str) -> None:
        self.seen.faults.append((at, text))

    def _resumed(self, begin: int) -> int:
        """Where the next sound chunk begins after a fault that hides where this one ends."""
        self.lost, self.index, self.due = True, None, None
        limit = self.profile.chunk_bytes
        try:
            found = resynchronize(self.source, begin + 1, limit, self._spend)
        except LimitError as error:
            self._fault(begin, str(error))
            found = None
        return self.source.size if found is None else found

    def _spend(self, size: int) -> None:
        self.search.spend(size, self.source.size, "a chunk")

    def _step(self, at: int) -> int:
        """Check the chunk or FOOT at ``at``; return where it ends."""
        if not self.read(at, 1).tobytes().isalpha():
            return self._foot(at)
        chunk = self._header(at)
        if self.index is not None:  # GRAM-01
            self._fault(at, f"INDX is followed by {chunk.label}, not by a FOOT")
            self.index = None
        if not self.seen.n_chunks and chunk.type != b"HEAD":
            self._fault(at, f"the first chunk is {chunk.label}, not HEAD")
        self.seen.n_chunks += 1
        if chunk.length is None:
            return self._packets(chunk)
        if self._is_sound(chunk):
            self._take(chunk)
        else:
            self.due = None
            self.lost = self.lost or chunk.type in (b"HEAD", b"INDX", *SHARED)
        self.places.add(chunk)
        return at + chunk.size

    def _header(self, at: int) -> Chunk:
        chunk = parse_header(bytes(self.read(at, HEADER.size)), at)
        if chunk.length is not None and at + chunk.size > self.source.size:  # CHUNK-05
            raise TruncatedError(
                f"chunk {chunk.label} ends at {at + chunk.size}, the file at {self.source.size}"
            )
        if chunk.type not in CRITICAL and not chunk.flags & ANCILLARY:  # CHUNK-11
            raise UnsupportedError(f"chunk {chunk.label} is critical and unknown")
        return chunk

    def _is_sound(self, chunk: Chunk) -> bool:
        """Whether its crc is right and it is not too long; else the fault is noted."""
        assert chunk.length is not None
        if chunk.length > self.profile.chunk_bytes:  # CHUNK-04, LIMIT-07
            limit = self.profile.chunk_bytes
            text = f"chunk {chunk.label}: {chunk.length} bytes are over the limit of {limit}"
            self._fault(chunk.offset, text)
            return False
        computed, covered = 0, chunk.size - CRC.size
        for part in self.read.each(chunk.offset, covered):
            computed = zlib.crc32(part, computed)
        (stored,) = CRC.unpack(self.read(chunk.offset + covered, CRC.size))
        if stored != computed:  # CHUNK-03
            text = f"crc of chunk {chunk.label} is {computed:#010x}, stored is {stored:#010x}"
            self._fault(chunk.offset, text)
        return bool(stored == computed)

    def _take(self, chunk: Chunk) -> None:
        """Learn what the pass has to know of a sound chunk."""
        assert chunk.length is not None
        if chunk.type == b"DATA":
            self._heed(self.read(chunk.payload_offset, min(chunk.length, PEEK)))
        elif chunk.type == b"HEAD":
            self.places.head = self.source.read(chunk.payload_offset, chunk.length)
            self.profile = parse_head(self.places.head)
        elif chunk.type in SHARED:
            digest = hashlib.sha256()
            for part in self.read.each(chunk.payload_offset, chunk.length):
                digest.update(part)
            self.places.shared.setdefault((chunk.type, digest.digest()[:16]), chunk)
        elif chunk.type == b"CLIP":
            self.due = 0
        elif chunk.type == b"INDX":
            self.index = chunk

    def _heed(self, segment: memoryview) -> None:
        """Learn from a segment which frame of signal 0 is due after it."""
        header, _ = parse_segment(bytes(segment[:PEEK]))
        if header.signal == 0:
            self.due = header.stop

    def _packets(self, chunk: Chunk) -> int:
        """Check the packets of an open DATA; return where it ends."""
        if not self.places.clips:  # PACK-10
            raise FormatError(f"chunk {chunk.label} is outside a clip")
        need = self.profile.packet_bytes + MOST_FRAMING  # a packet is no longer than this
        at, sequence = chunk.payload_offset, 0
        while True:
            block = self.read(at, BLOCK)
            rest = at + len(block) == self.source.size
            last = len(block) if rest else len(block) - need
            pos, ended = 0, False
            while pos < last and not ended:
                pos, ended = self._packet(block, pos, at, sequence)
                sequence += 1
            at += pos
            if ended:
                self.seen.n_packets += sequence - 1
                return at
            if rest:  # PACK-01
                raise TruncatedError(f"the file ends at {at}, in chunk {chunk.label}")

    def _packet(self, block: memoryview, pos: int, start: int, sequence: int) -> tuple[int, bool]:
        """Check the packet at ``pos`` of ``block``, which lies at ``start`` of the file.

        Returns where it ends in the block, and whether it is the last of its chunk.
        """
        number, body = read_varint(block, pos + 1)
        length, body = read_varint(block, body)
        first, where = block[pos], f"packet at {start + pos}"
        if int.from_bytes(block[body : body + 2], "little") != zlib.crc32(block[pos:body]) & 0xFFFF:
            raise ChecksumError(f"head_check of the {where} is wrong")  # PACK-03
        kind = first & 0x0F
        if number != sequence or kind > NUMBERED or first & 0x70:  # PACK-02, PACK-08, PACK-09
            raise FormatError(f"{where}: kind {first:#04x}, number {number}, {sequence} is due")
        check(where, length, self.profile.packet_bytes)  # LIMIT-08
        body += CHECK_SIZE
        stop = body + length + CHECK_SIZE
        if stop > len(block):
            raise TruncatedError(f"the file ends at {start + len(block)}, in the {where}")
        self._check_body(start + pos, block[body : stop - CHECK_SIZE], block[stop - 2 : stop], kind)
        if kind != END:
            self.places.clips[-1].segment(start + body, length, kind)
        return stop, kind == END

    def _check_body(self, at: int, body: memoryview, stored: memoryview, kind: int) -> None:
        """Check the body of the packet at ``at``, as far as the frame that it needs is known."""
        known = kind != NUMBERED or self.due is not None
        computed = zlib.crc32(body)
        if kind == NUMBERED and self.due is not None:
            computed = zlib.crc32(self.due.to_bytes(8, "little"), computed)
        sound = stored[0] | stored[1] << 8 == computed & 0xFFFF
        if known and not sound:  # PACK-04, PACK-06, PACK-15
            self._fault(at, f"body_check of the packet at {at} is wrong")
        if kind == SEGMENT:
            self.due = None
            if sound:
                self._heed(body)
        elif self.due is not None:
            self.due += 1

    def _foot(self, at: int) -> int:
        data = bytes(self.read(at, FOOT.size))
        if len(data) < FOOT.size:
            raise TruncatedError(f"the file ends at {self.source.size}, in a FOOT at {at}")
        foot, index = parse_foot(data, at), self.index
        if foot is None:
            raise FormatError(f"at {at} there is neither a chunk nor a FOOT")
        place = (index.offset, index.size) if index else (0, 0)
        if (foot.index_offset, foot.index_length) != place and not self.lost:  # FOOT-04
            self._fault(at, f"FOOT at {at} points to {foot}, the index is at {place}")
        self.index, self.end = None, at + FOOT.size
        return self.end

    def _compare(self, index: Chunk) -> None:
        """Compare the last index with what is there, as far as all of it is known."""
        if self.lost:
            return
        try:
            data = self.source.read(index.offset, index.size)
            listed = parse_index(check_chunk(data, index), index_limit(self.source.size))
            found = self.places.differences(listed)
        except FormatError as error:
            found = [str(error)]
        for text in found:
            self._fault(index.offset, f"chunk {index.label}: {text}")
        self.seen.indexed = True
