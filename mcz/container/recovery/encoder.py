"""Recovery data made of a stream: hashes, recovery blocks, and all of it as packets."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from io import BytesIO
from typing import BinaryIO

import numpy as np

from mcz.container.recovery.code import LANE, Ints, encode_blocks, runs_of
from mcz.container.recovery.layout import Key, Shape, build_packet, short_hash
from mcz.errors import AccessError, reason_of

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
    """The sections of the table, and those computed from them, a row each."""
    whole = hashes.ljust(shape.n_sections * shape.section_size, b"\0")
    own = np.frombuffer(whole, "<i8").reshape(shape.n_sections, -1).astype(np.int64)
    lanes = own.shape[1]
    more = encode_blocks(lambda a, b: own[a:b], len(own), shape.n_parities, lanes)
    return np.concatenate([own, more])


@contextmanager
def _recovery_blocks(shape: Shape, read: READ, step: Step | None) -> Iterator[READ]:
    """A function that gives each recovery block; of many some lanes are computed at a time.

    Raises AccessError where there is no room for them while they are made.
    """
    total = shape.n_recovery * shape.block_size
    with ExitStack() as stack:
        try:
            spool = BytesIO() if total <= IN_MEMORY else tempfile.TemporaryFile()  # noqa: SIM115
            stack.callback(_close, spool)
            for lane, found in compute_lanes(shape, read, step):
                for index, part in enumerate(found):
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
    with suppress(OSError):  # of a full disk, which has been told
        spool.close()


def compute_lanes(shape: Shape, read: READ, step: Step | None) -> Iterator[tuple[int, Ints]]:
    """Lanes of all recovery blocks, of large ones some at a time, and the first of them."""
    lanes = shape.block_size // LANE
    width = max(1, min(lanes, AT_ONCE // (runs_of(shape.n_recovery) * LANE)))
    for start in range(0, lanes, width):
        stop = min(start + width, lanes)
        rows = _lane_reader(shape, read, start, stop, step)
        yield start, encode_blocks(rows, shape.n_blocks, shape.n_recovery, stop - start)


def _lane_reader(
    shape: Shape, read: READ, start: int, stop: int, step: Step | None
) -> Callable[[int, int], Ints]:

    def rows(first: int, last: int) -> Ints:
        found = np.empty((last - first, stop - start), np.int64)
        for at in range(first, last):
            data = memoryview(read(at))[LANE * start : LANE * stop]
            found[at - first] = np.frombuffer(data, "<i8")
            if step is not None:
                step(at, shape.n_blocks)
        return found

    return rows
