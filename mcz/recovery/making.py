"""Recovery data made of a stream: hashes, recovery blocks, and all of it as packets."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Iterator

import numpy as np

from mcz.recovery.code import LANE, encoded, runs_of
from mcz.recovery.field import Ints
from mcz.recovery.packets import Key, build_packet, short_hash
from mcz.recovery.shape import Shape

READ = Callable[[int], bytes]  # a data block, its padding with it
AT_ONCE = 1 << 26  # bytes of the blocks of a run that are in memory
IN_MEMORY = 1 << 28  # bytes of recovery blocks; more are in a temporary file
Step = Callable[[int, int], object]


def made(shape: Shape, read: READ, step: Step | None = None) -> tuple[Key, Iterator[bytes]]:
    """What the packets have in common, and these, in the order of the file."""
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
    with tempfile.TemporaryFile() as spool:
        blocks = recovery_blocks(shape, read, step, spool)
        for kind, index, _ in shape.packets():
            body = blocks[index].tobytes() if kind else sections[index].tobytes()
            yield build_packet(key, kind, index, body)


def table_sections(shape: Shape, hashes: bytes) -> Ints:
    """The sections of the table, and those computed from them, a row each."""
    whole = hashes.ljust(shape.n_sections * shape.section_size, b"\0")
    own = np.frombuffer(whole, "<i8").reshape(shape.n_sections, -1).astype(np.int64)
    lanes = own.shape[1]
    more = encoded(lambda a, b: own[a:b], len(own), shape.n_parities, lanes)
    return np.concatenate([own, more])


def recovery_blocks(shape: Shape, read: READ, step: Step | None, spool: object) -> Ints:
    """The recovery blocks, a row each; of large ones some columns at a time."""
    lanes = shape.block_size // LANE
    size = runs_of(shape.n_recovery)
    total = shape.n_recovery * shape.block_size
    if size * shape.block_size <= AT_ONCE and total <= IN_MEMORY:
        return encoded(_rows(shape, read, 0, lanes, step), shape.n_blocks, shape.n_recovery, lanes)
    width = max(1, AT_ONCE // (size * LANE))
    form = (shape.n_recovery, lanes)
    found = np.zeros(form, np.int64) if total <= IN_MEMORY else _mapped(spool, form)
    for start in range(0, lanes, width):
        stop = min(start + width, lanes)
        rows = _rows(shape, read, start, stop, step)
        found[:, start:stop] = encoded(rows, shape.n_blocks, shape.n_recovery, stop - start)
    return found


def _mapped(spool: object, form: tuple[int, int]) -> Ints:
    return np.memmap(spool, np.int64, "w+", shape=form)  # type: ignore[call-overload, no-any-return]


def _rows(
    shape: Shape, read: READ, start: int, stop: int, step: Step | None
) -> Callable[[int, int], Ints]:
    """What reads some lanes of data blocks."""

    def rows(first: int, last: int) -> Ints:
        found = np.empty((last - first, stop - start), np.int64)
        for at in range(first, last):
            data = memoryview(read(at))[LANE * start : LANE * stop]
            found[at - first] = np.frombuffer(data, "<i8")
            if step is not None:
                step(at, shape.n_blocks)
        return found

    return rows
