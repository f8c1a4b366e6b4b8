"""Recovery data: blocks computed from the bytes of a file, which restore lost ones.

Here are the layout of the blocks, the packets of a RECV, and how to find them; ``code`` is the
erasure code. A RECV protects the bytes before it, from ``start`` on, and ``t_size`` bytes after it;
together they are the *stream*, cut into blocks. SPEC.md, "RECV", is normative.
"""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from math import ceil, isqrt
from typing import BinaryIO, NamedTuple

import construct
import numpy as np
from construct import Int8ul, Int32ul, Int64ul

from mcz.container.chunks import FRAMING, HEADER, Chunk, ChunkType
from mcz.container.reader import Container
from mcz.container.recovery.code import LANE, MOST_POINTS, encode_blocks, run_length
from mcz.container.scan import scan
from mcz.container.source import ByteSource
from mcz.errors import AccessError, FormatError, LimitError, OptionError, reason_of
from mcz.model.schema import Exactly, Record, bounded, build, field, parse_until
from mcz.model.types import Ints

HASH = 8  # bytes of the hash of a block
SECTION = 128  # bytes of a section of the table, unless it is shorter
HEAD = 69  # bytes of a packet outside of its body: 61 before it, 8 after
LEAST_BLOCK, MOST_BLOCKS = 256, 1 << 15
LEAST_RECOVERY = 4  # blocks, so that a small file survives some bad places


@dataclass(frozen=True, slots=True)
class Shape:
    """Sizes of the protected bytes and of the code, which determine all others.

    The stream is bytes ``start`` to ``start + a_size`` of the file, up to the RECV, and the
    ``t_size`` bytes after the RECV.
    """

    start: int
    a_size: int
    t_size: int
    block_size: int
    n_recovery: int

    def __post_init__(self) -> None:
        sound = self.block_size % LANE == 0 < self.block_size and self.n_recovery > 0
        if not sound or not self.size:
            raise FormatError(f"recovery data: impossible sizes: {self}")
        if run_length(self.n_recovery) + self.n_blocks > MOST_POINTS:
            raise LimitError(
                f"recovery data: {self.n_blocks} blocks and {self.n_recovery} recovery blocks "
                "are too many"
            )

    @property
    def size(self) -> int:
        return self.a_size + self.t_size

    @property
    def n_blocks(self) -> int:
        return -(-self.size // self.block_size)

    @property
    def section_size(self) -> int:
        return min(SECTION, HASH * self.n_blocks)

    @property
    def n_sections(self) -> int:
        """Sections of the table of hashes."""
        return -(-HASH * self.n_blocks // self.section_size)

    @property
    def n_parities(self) -> int:
        """Sections computed from these."""
        return max(self.n_recovery, self.n_sections)

    @property
    def chunk_offset(self) -> int:
        return self.start + self.a_size

    @property
    def chunk_size(self) -> int:
        return FRAMING + self.payload_size

    @property
    def payload_size(self) -> int:
        sections = (self.n_sections + self.n_parities) * (HEAD + self.section_size)
        return sections + self.n_recovery * (HEAD + self.block_size)

    @property
    def stop(self) -> int:
        """End of the protected file."""
        return self.chunk_offset + self.chunk_size + self.t_size

    @property
    def burst(self) -> int:
        """Length of a run of bad bytes, anywhere, that can be restored if all others are good."""
        return (self.n_recovery - 1) * self.block_size + 1

    def packets(self) -> Iterator[tuple[int, int, int]]:
        """Kind, index and offset in the file of each packet: half of the sections at either end."""
        at = self.chunk_offset + HEADER.size
        n = self.n_sections + self.n_parities
        order = [(0, index) for index in range(n - n // 2)]
        order += [(1, index) for index in range(self.n_recovery)]
        order += [(0, index) for index in range(n - n // 2, n)]
        for kind, index in order:
            yield kind, index, at
            at += HEAD + (self.block_size if kind else self.section_size)

    def pieces(self, block: int) -> list[tuple[int, int]]:
        """Offset in the file and size of the pieces of a data block, without padding."""
        first = block * self.block_size
        stop = min(first + self.block_size, self.size)
        shift = self.chunk_size + self.start
        ranges = []
        if first < self.a_size:
            ranges.append((self.start + first, min(stop, self.a_size) - first))
        if stop > self.a_size:
            own = max(first, self.a_size)
            ranges.append((shift + own, stop - own))
        return ranges

    def block(self, number: int, read: Callable[[int, int], bytes]) -> bytes:
        """A data block and its padding; ``read`` returns bytes of the file by offset and size."""
        data = b"".join(read(offset, size) for offset, size in self.pieces(number))
        return data.ljust(self.block_size, b"\0")


def check_redundancy(redundancy: float) -> None:
    """Raise OptionError unless the redundancy is a share."""
    if not 0 < redundancy <= 1:
        raise OptionError(f"redundancy is {redundancy:g}, not above 0 and at most 1")


def shape_for(start: int, a_size: int, t_size: int, redundancy: float) -> Shape:
    """The shape for a stream of these sizes; raises OptionError for a redundancy that cannot be."""
    check_redundancy(redundancy)
    size = a_size + t_size
    block = max(LEAST_BLOCK, isqrt(4 * size), -(-size // MOST_BLOCKS))
    block = -(-block // LANE) * LANE
    n_blocks = -(-size // block)
    n_recovery = max(LEAST_RECOVERY, ceil(redundancy * n_blocks))
    return Shape(start, a_size, t_size, block, n_recovery)


MAGIC = b"\x89RCV\r\n\x1a\n"
WINDOW = 1 << 22
BODY_AT = HEAD - HASH  # offset of the body in a packet


def body_size(packet: RecvPacket) -> int:
    """Bytes of the body of a packet; raises FormatError or LimitError."""
    shape = shape_of(packet)
    return shape.block_size if packet.kind else shape.section_size


def shape_of(packet: RecvPacket) -> Shape:
    """The sizes that a packet states; raises FormatError or LimitError."""
    sizes = packet.start, packet.a_size, packet.t_size, packet.block_size, packet.n_recovery
    return Shape(*sizes)


class RecvPacket(Record):
    """A packet of RECV, with its body and check."""

    magic: bytes = field(construct.Const(MAGIC), "`89 52 43 56 0D 0A 1A 0A`", default=MAGIC)
    kind: int = field(bounded(Int8ul, 0, 1), "0 section of the table, 1 recovery block")
    set: bytes = field(Exactly(16), "first 16 bytes of the SHA-256 of the stream")
    start: int = field(Int64ul, "offset in the file of the first byte that is protected")
    a_size: int = field(Int64ul, "bytes that are protected before the RECV")
    t_size: int = field(Int64ul, "bytes that are protected after the RECV")
    block_size: int = field(Int32ul, "bytes of a block, a multiple of 8")
    n_recovery: int = field(Int32ul, "recovery blocks")
    index: int = field(Int32ul, "which section or recovery block this is, from 0")
    body: bytes = field(Exactly(body_size), "the section or block, of the size that follows")
    check: bytes = field(Exactly(HASH), "first 8 bytes of the SHA-256 of all before in the packet")


class Key(NamedTuple):
    """Common fields of the packets of one RECV."""

    set_id: bytes
    shape: Shape


@dataclass(frozen=True, slots=True)
class Packet:
    """A packet found at ``offset``, which need not be its place."""

    kind: int
    index: int
    body: bytes
    offset: int


def short_hash(data: bytes | memoryview) -> bytes:
    return hashlib.sha256(data).digest()[:HASH]


def build_packet(key: Key, kind: int, index: int, body: bytes) -> bytes:
    s = key.shape
    packet = RecvPacket(
        kind=kind,
        set=key.set_id,
        start=s.start,
        a_size=s.a_size,
        t_size=s.t_size,
        block_size=s.block_size,
        n_recovery=s.n_recovery,
        index=index,
        body=body,
        check=bytes(HASH),
    )
    data = build(packet, "RECV")[:-HASH]
    return data + short_hash(data)


def read_packet(source: ByteSource, offset: int) -> tuple[Key, Packet] | None:
    """The packet at ``offset``, or None if there is no intact one."""
    try:
        head = parse_until(RecvPacket, source.read(offset, BODY_AT), "RECV", "body")
        shape, size = shape_of(head), body_size(head)
    except (FormatError, LimitError):
        return None
    if offset + HEAD + size > source.size:
        return None
    data = source.read(offset, HEAD + size)
    if short_hash(memoryview(data)[:-HASH]) != data[-HASH:]:
        return None
    return Key(head.set, shape), Packet(head.kind, head.index, data[BODY_AT:-HASH], offset)


def find_packets(source: ByteSource) -> Iterator[tuple[Key, Packet]]:
    """Every intact packet of a file, at any offset."""
    mark = re.compile(re.escape(MAGIC))
    start = 0
    while start < source.size:
        data = source.read(start, min(WINDOW + len(MAGIC) - 1, source.size - start))
        for match in mark.finditer(data):
            packet = read_packet(source, start + match.start())
            if packet is not None:
                yield packet
        start += WINDOW


READ = Callable[[int], bytes]  # a data block, its padding with it
AT_ONCE = 1 << 26  # bytes of the blocks of a run that are in memory
IN_MEMORY = 1 << 28  # bytes of recovery blocks; more are in a temporary file
Step = Callable[[int, int], object]


def encode_packets(
    shape: Shape, read: READ, step: Step | None = None
) -> tuple[Key, Iterator[bytes]]:
    """Encode packets: their common key, and the packets in the order of the file."""
    digest, hashes = hashlib.sha256(), bytearray()
    for block in range(shape.n_blocks):
        data = read(block)
        hashes += short_hash(data)
        digest.update(memoryview(data)[: min(len(data), shape.size - block * shape.block_size)])
    key = Key(digest.digest()[:16], shape)
    return key, _packets(key, read, bytes(hashes), step)


def _packets(key: Key, read: READ, hashes: bytes, step: Step | None) -> Iterator[bytes]:
    shape = key.shape
    sections = table_sections(shape, hashes)
    with _recovery_blocks(shape, read, step) as block_of:
        for kind, index, _ in shape.packets():
            body = block_of(index) if kind else sections[index].tobytes()
            yield build_packet(key, kind, index, body)


def table_sections(shape: Shape, hashes: bytes) -> Ints:
    """The sections of the table, and the parity sections, a row each."""
    whole = hashes.ljust(shape.n_sections * shape.section_size, b"\0")
    own = np.frombuffer(whole, "<i8").reshape(shape.n_sections, -1).astype(np.int64)
    lanes = own.shape[1]
    more = encode_blocks(lambda a, b: own[a:b], len(own), shape.n_parities, lanes)
    return np.concatenate([own, more])


@contextmanager
def _recovery_blocks(shape: Shape, read: READ, step: Step | None) -> Iterator[READ]:
    """A function that returns each recovery block; large ones are computed some lanes at a time.

    Raises AccessError if there is no room for them meanwhile.
    """
    total = shape.n_recovery * shape.block_size
    with ExitStack() as stack:
        try:
            spool = BytesIO() if total <= IN_MEMORY else tempfile.TemporaryFile()  # noqa: SIM115
            stack.callback(_close, spool)
            for lane, lane_blocks in compute_lanes(shape, read, step):
                for index, part in enumerate(lane_blocks):
                    spool.seek(index * shape.block_size + LANE * lane)
                    spool.write(part.tobytes())
            spool.flush()
        except OSError as error:
            raise AccessError(
                reason_of(error),
                path=tempfile.gettempdir(),
                note=f"recovery data take {total:,} bytes there while they are made",
            ) from error

        def block_of(index: int) -> bytes:
            spool.seek(index * shape.block_size)
            return spool.read(shape.block_size)

        yield block_of


def _close(spool: BinaryIO) -> None:
    with suppress(OSError):  # the full disk is already reported
        spool.close()


def compute_lanes(shape: Shape, read: READ, step: Step | None) -> Iterator[tuple[int, Ints]]:
    """Yield the first lane and the lanes of all recovery blocks, a part of large ones at a time."""
    lanes = shape.block_size // LANE
    width = max(1, min(lanes, AT_ONCE // (run_length(shape.n_recovery) * LANE)))
    for start in range(0, lanes, width):
        stop = min(start + width, lanes)
        rows = _lane_reader(shape, read, start, stop, step)
        yield start, encode_blocks(rows, shape.n_blocks, shape.n_recovery, stop - start)


def _lane_reader(
    shape: Shape, read: READ, start: int, stop: int, step: Step | None
) -> Callable[[int, int], Ints]:

    def rows(first: int, last: int) -> Ints:
        result = np.empty((last - first, stop - start), np.int64)
        for at in range(first, last):
            data = memoryview(read(at))[LANE * start : LANE * stop]
            result[at - first] = np.frombuffer(data, "<i8")
            if step is not None:
                step(at, shape.n_blocks)
        return result

    return rows


def recovery_chunks(container: Container) -> list[Chunk]:
    """The RECV chunks of a file; without a clip no index lists them, and the file is walked."""
    if container.directory.clips:
        return container.directory.clips.ancillary(ChunkType.RECV)
    return [chunk for chunk in scan(container.source).chunks if chunk.type == ChunkType.RECV]


def shape_in(source: ByteSource, chunk: Chunk) -> Shape:
    """The shape that the first packet of a RECV chunk states, unchecked; raises FormatError."""
    first = read_packet(source, chunk.payload_offset)
    if first is None:
        raise FormatError("its first packet is damaged", where=f"chunk {chunk.label}")
    return first[0].shape


def check_protection(source: ByteSource, chunk: Chunk) -> str:
    """Compare a RECV chunk with the bytes that it protects, and name these; raises FormatError."""
    shape = shape_in(source, chunk)
    sizes = shape.chunk_offset, shape.payload_size
    if sizes != (chunk.offset, chunk.length) or shape.stop > source.size:
        raise FormatError(
            f"it protects {shape}, not the bytes before and after it", where=f"chunk {chunk.label}"
        )
    _, packets = encode_packets(shape, lambda block: shape.block(block, source.read))
    at = chunk.payload_offset
    for packet in packets:
        if source.read(at, len(packet)) != packet:
            raise FormatError(
                f"the packet at {at} does not match the protected bytes",
                where=f"chunk {chunk.label}",
            )
        at += len(packet)
    return f"bytes {shape.start} to {shape.stop}"


def protected_shapes(container: Container) -> list[Shape]:
    """The shapes of the RECV chunks of a file, in its order, unchecked."""
    return [shape_in(container.source, chunk) for chunk in recovery_chunks(container)]
