"""Recovery data of a stream: hashes, recovery blocks, and their packets."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from io import BytesIO
from typing import BinaryIO

import numpy as np

from mcz.container.recovery.code import LANE, encode_blocks, run_length
from mcz.container.recovery.layout import Key, Shape, build_packet, short_hash
from mcz.errors import AccessError, reason_of
from mcz.model.types import Ints

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
    """Lanes of all recovery blocks, of large ones some at a time, and the first of them."""
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
