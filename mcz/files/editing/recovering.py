"""``protect``: add recovery data to a file; and restore the bytes of a damaged one from them.

SPEC.md, "RECV", is normative. Blocks are searched at their stated offsets, and at offsets shifted
by bytes that were inserted or cut off before them, as intact packets show.
"""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import chain as chain_from
from itertools import product, takewhile
from typing import BinaryIO

import numpy as np

from mcz.container.recovery import (
    BODY_AT,
    HASH,
    Key,
    Packet,
    Shape,
    Step,
    check_redundancy,
    compute_lanes,
    encode_packets,
    find_packets,
    short_hash,
)
from mcz.container.recovery.code import LANE, encode_blocks, recover_blocks
from mcz.container.source import ByteSource
from mcz.errors import FormatError
from mcz.files.editing.appending import (
    DEFAULT,
    Protection,
    add_recovery,
    chunk_bytes,
    protect_written,
    protection_of,
    redundancy_of,
)
from mcz.files.editing.rewriting import UNPROTECTED, disk_path, plan_whole, rewriting
from mcz.files.reading.faults import quick_check
from mcz.files.reading.file import open, open_bytes
from mcz.files.writing.atomic import replacing_file
from mcz.model.checks import PATH, check_arguments, merged_ranges
from mcz.model.text_format import count_text, fields_text
from mcz.model.types import Progress, Target

MOST_SHIFTS = 16
MOST_SETS = 4  # that may protect the same bytes
SHOWN_RANGES = 8  # ranges that a message lists
SLACK = BLOCK = 1 << 20


@dataclass(slots=True)
class Recovery:
    """Result of a recovery: bad blocks, all blocks, and the bad bytes of the file.

    ``possible``: there are at most as many bad blocks as recovery blocks. ``behind``: bytes after
    the last protected one, copied unchanged.
    """

    n_blocks: int = 0
    n_recovery: int = 0
    bad_blocks: int = 0
    bad_recovery: int = 0
    bad_bytes: list[tuple[int, int]] = field(default_factory=list)
    behind: int = 0
    possible: bool = True

    __repr__ = fields_text

    def lines(self) -> list[str]:
        """Lines on bad blocks; none for an intact file."""
        if not (self.bad_blocks or self.bad_recovery):
            return []
        of = f"{self.bad_blocks:,} of {self.n_blocks:,} blocks are bad"
        can = f"of {self.n_recovery:,} recovery blocks {self.bad_recovery:,} are bad, too"
        ranges = merged_ranges(self.bad_bytes)
        places = ", ".join(f"{start:,} to {stop:,}" for start, stop in ranges[:SHOWN_RANGES])
        more = (
            f" and {len(ranges) - SHOWN_RANGES:,} more ranges" if len(ranges) > SHOWN_RANGES else ""
        )
        where = [f"bytes {places}{more}"] if ranges else []
        return [f"recovery data: {of}; {can}", *where]


@dataclass(slots=True)
class _RecoverySet:
    """One RECV as far as it was found, and the places of its blocks."""

    key: Key
    sections: dict[int, bytes] = field(default_factory=dict)
    blocks: dict[int, int] = field(default_factory=dict)  # offsets of their bodies
    shifts: dict[int, None] = field(default_factory=dict)  # in the order of discovery

    @property
    def shape(self) -> Shape:
        return self.key.shape

    @property
    def distance(self) -> int:
        """The least distance of one of its packets from its place."""
        return min(map(abs, self.shifts), default=0)


def recovery_sets(source: ByteSource) -> dict[int, list[_RecoverySet]]:
    """The recovery data left in a file, by the offset of the range that they protect.

    A file may contain recovery data of other files, which were attached or appended whole: sets
    whose packets lie at their places come first, and few of the others count.
    """
    by_key: dict[Key, _RecoverySet] = {}
    places: dict[Key, dict[tuple[int, int], int]] = {}
    for key, packet in find_packets(source):
        if key.shape.stop > 2 * source.size + SLACK:
            continue  # more than half of the file is gone, or it never was its own
        one = by_key.setdefault(key, _RecoverySet(key))
        place = places.setdefault(key, {(k, i): at for k, i, at in key.shape.packets()})
        _keep_packet(one, packet, place.get((packet.kind, packet.index)))
    starts: dict[int, list[_RecoverySet]] = {}
    for one in sorted(by_key.values(), key=lambda one: (one.distance, -len(one.blocks))):
        starts.setdefault(one.shape.start, []).append(one)
    return {start: sets[:MOST_SETS] for start, sets in starts.items()}


def _keep_packet(one: _RecoverySet, packet: Packet, place: int | None) -> None:
    if place is None:
        return
    if packet.kind:
        one.blocks[packet.index] = packet.offset + BODY_AT
    else:
        one.sections[packet.index] = packet.body
    shift = packet.offset - place
    if len(one.shifts) < MOST_SHIFTS:
        one.shifts[shift] = None


@dataclass(frozen=True, slots=True)
class Examined:
    """One RECV, and of each intact data block the shifts of its pieces."""

    set: _RecoverySet
    there: dict[int, tuple[int, ...]]

    @property
    def n_bad(self) -> int:
        return self.set.shape.n_blocks - len(self.there)

    @property
    def is_possible(self) -> bool:
        """True if the bad blocks can be computed: at most as many as recovery blocks."""
        return self.n_bad <= len(self.set.blocks)

    @property
    def shift(self) -> int:
        """The shift of the end of the protected range, as far as it is known."""
        return self.there[max(self.there)][-1] if self.there else 0


def _examine_set(source: ByteSource, one: _RecoverySet) -> Examined:
    """Find the data blocks; missing ones are bad."""
    shape = one.shape
    table = _read_table(one)
    present: dict[int, tuple[int, ...]] = {}
    shifts = [0, *one.shifts]
    hint = 0
    for block in range(shape.n_blocks):
        pieces = shape.pieces(block)
        block_hash = None if table is None else table[HASH * block : HASH * (block + 1)]
        order = dict.fromkeys([hint, *shifts])
        for candidate in product(order, repeat=len(pieces)):
            data = _read(source, pieces, candidate)
            if data is None:
                continue
            padded = data.ljust(shape.block_size, b"\0")
            if block_hash is None or short_hash(padded) == block_hash:
                present[block] = candidate
                hint = candidate[0]
                break
    return Examined(one, present)


def _read(
    source: ByteSource, pieces: list[tuple[int, int]], shifts: tuple[int, ...]
) -> bytes | None:
    parts = []
    for (offset, size), shift in zip(pieces, shifts, strict=True):
        at = offset + shift
        if at < 0 or at + size > source.size:
            return None
        parts.append(source.read(at, size))
    return b"".join(parts)


def _read_table(one: _RecoverySet) -> bytes | None:
    """The hashes of the blocks; None if too few sections are left."""
    shape = one.shape
    n, size = shape.n_sections, shape.section_size
    lost = [index for index in range(n) if index not in one.sections]
    rows = [index - n for index in sorted(one.sections) if index >= n][: len(lost)]
    if len(rows) < len(lost):
        return None
    own = np.zeros((n, size // LANE), np.int64)
    for index in range(n):
        if index in one.sections:
            own[index] = np.frombuffer(one.sections[index], "<i8")
    if lost:
        rest = encode_blocks(lambda a, b: own[a:b], n, shape.n_parities, size // LANE)[rows]
        for at, row in enumerate(rows):
            rest[at] ^= np.frombuffer(one.sections[n + row], "<i8")
        own[lost] = recover_blocks(rest, lost, rows, shape.n_parities)
    return own.astype("<i8").tobytes()


class Restorer:
    """Writes a file as it was protected to ``out``, which can be read back."""

    def __init__(self, source: ByteSource, out: BinaryIO, step: Step | None) -> None:
        self.source, self.out, self.step = source, out, step

    def restore(self, one: _RecoverySet, present: dict[int, tuple[int, ...]]) -> None:
        """Write the range of one RECV, and the RECV; raises FormatError for a wrong result."""
        shape = one.shape
        for block, shifts in present.items():
            data = _read(self.source, shape.pieces(block), shifts)
            assert data is not None
            self._write(shape, block, data)
        self._write_lost(one, present)
        self._write_recv(one)

    def _write(self, shape: Shape, block: int, data: bytes, first: int = 0) -> None:
        """Write a block from its byte ``first`` on, without padding."""
        at, stop = 0, first + len(data)
        for offset, size in shape.pieces(block):
            begin, end = max(first, at), min(stop, at + size)
            if begin < end:
                self.out.seek(offset + begin - at)
                self.out.write(data[begin - first : end - first])
            at += size

    def _write_lost(self, one: _RecoverySet, present: dict[int, tuple[int, ...]]) -> None:
        """Write the bad blocks, a part of large ones at a time."""
        shape = one.shape
        lost = [block for block in range(shape.n_blocks) if block not in present]
        rows = sorted(one.blocks)[: len(lost)]

        def read(block: int) -> bytes:
            data = (
                _read(self.source, shape.pieces(block), present[block]) if block in present else b""
            )
            return (data or b"").ljust(shape.block_size, b"\0")

        for start, whole in compute_lanes(shape, read, self.step) if lost else ():
            rest = whole[rows]
            for at, row in enumerate(rows):
                place = one.blocks[row] + LANE * start
                rest[at] ^= np.frombuffer(self.source.read(place, rest[at].nbytes), "<i8")
            blocks = recover_blocks(rest, lost, rows, shape.n_recovery).astype("<i8")
            for at, block in enumerate(lost):
                self._write(shape, block, blocks[at].tobytes(), LANE * start)

    def _write_recv(self, one: _RecoverySet) -> None:
        """The RECV chunk, computed again from the written range; raises NotThatError."""
        shape = one.shape

        def read(offset: int, size: int) -> bytes:
            self.out.seek(offset)
            return self.out.read(size)

        key, packets = encode_packets(shape, lambda block: shape.block(block, read), self.step)
        if key != one.key:
            raise NotThatError("the recovered bytes differ from the protected ones")
        at = shape.chunk_offset
        for data in chunk_bytes(shape, packets):  # this reads the file
            self.out.seek(at)
            self.out.write(data)
            at += len(data)

    def copy_unprotected(self, last: _RecoverySet, size: int) -> None:
        """Copy the bytes after all protected ones."""
        stop = self.source.size
        self.out.seek(last.shape.stop)
        for at in range(stop - size, stop, BLOCK):
            self.out.write(self.source.read(at, min(BLOCK, stop - at)))
        self.out.truncate(last.shape.stop + size)


def examine(source: ByteSource) -> tuple[Recovery, list[Examined]]:
    """Examine a file by its recovery data: bad blocks, and their places."""
    starts, chain, at = recovery_sets(source), list[Examined](), 0
    while at in starts:
        outcomes = map(partial(_examine_set, source), starts[at])
        fallback = next(outcomes)
        every = chain_from((fallback,), outcomes)
        chain.append(next((one for one in every if one.is_possible), fallback))
        at = chain[-1].set.shape.stop
    recovery = Recovery(possible=all(one.is_possible for one in chain))
    for one in chain:
        shape = one.set.shape
        recovery.n_blocks += shape.n_blocks
        recovery.n_recovery += shape.n_recovery
        recovery.bad_blocks += one.n_bad
        recovery.bad_recovery += shape.n_recovery - len(one.set.blocks)
        bad = (block for block in range(shape.n_blocks) if block not in one.there)
        recovery.bad_bytes += [(at, at + size) for block in bad for at, size in shape.pieces(block)]
    if chain:
        recovery.behind = _bytes_after(source, chain[-1])
    return recovery, chain


def _bytes_after(source: ByteSource, last: Examined) -> int:
    return max(0, source.size - last.set.shape.stop - last.shift)


def check_recovery(target: Target) -> Recovery | None:
    """Check a file by its recovery data; None for a file without any.

    Raises AccessError if it cannot be read.
    """
    with closing(open_bytes(target)) as source:
        recovery, sets = examine(source)
    return recovery if sets else None


def recover(
    source: ByteSource, out: BinaryIO, progress: Progress | None
) -> tuple[Recovery | None, int]:
    """Write the file as it was protected to ``out``, which can be read back, as far as possible.

    Also returns the end of that part; later bytes are copied unchanged. Zero, and nothing is
    written, if nothing can be restored; no Recovery without recovery data.
    """
    recovery, sets = examine(source)
    restorer = Restorer(source, out, None if progress is None else _steps(progress))
    done: Examined | None = None
    for one in takewhile(lambda one: one.is_possible, sets):
        try:
            restorer.restore(one.set, one.there)
        except NotThatError:
            recovery.possible = False
            break
        done = one
    if done is None:
        out.seek(0)
        out.truncate()
        return (recovery if sets else None), 0
    restorer.copy_unprotected(done.set, _bytes_after(source, done))
    out.flush()
    return recovery, done.set.shape.stop


class NotThatError(FormatError):
    """The recovered bytes are not the protected ones."""


def _steps(progress: Progress) -> Step:
    def step(done: int, total: int) -> None:
        progress(done + 1, total, "recovery data")

    return step


@check_arguments(target=PATH)
def protect(
    target: str | os.PathLike[str],
    redundancy: float = DEFAULT,
    *,
    rebuild: bool = False,
    progress: Step | None = None,
) -> list[Protection]:
    """Append recovery data to an MCZ file, of ``redundancy`` times its bytes.

    ``mcz.repair`` restores every byte as long as there are no more bad blocks than recovery blocks,
    wherever they lie: single bytes, a burst, the beginning, the end. If the file has recovery data
    already, only bytes appended since get new data; without such bytes nothing changes. ``rebuild``
    rewrites the file and computes recovery data for all of it. Returns all recovery data, in the
    order of the file. Raises OptionError for a ``redundancy`` out of range, FormatError for a
    damaged file, or if rewriting would lose a chunk of unknown type, AccessError if another process
    is appending, and as ``mcz.append`` for a file cut short.
    """
    check_redundancy(redundancy)
    _refuse_damage(target)
    if rebuild and (protection := _protect_again(target, redundancy, progress)) is not None:
        return [protection]
    return add_recovery(target, redundancy, progress)


def _refuse_damage(target: Target) -> None:
    """Raise FormatError for bad bytes, which recovery data would take for good ones."""
    faults = quick_check(target)[1]
    if not faults:
        return
    with open(target) as file:  # a file cut short has an error of its own
        count = count_text(len(faults), "fault")
        text = f"damaged, so it was not protected; {count}: {faults[0].message}"
        raise FormatError(text, path=file.name)


def _protect_again(target: Target, redundancy: float, progress: Step | None) -> Protection | None:
    """Rewrite a file with recovery data for all of it; None without a change if it has none.

    The old recovery data stay until the new are written.
    """
    with rewriting(target) as job:
        if redundancy_of(job.file.container) is None:
            return None
        with replacing_file(disk_path(target), force=True) as stream:
            left_out = job.copy_to(stream, plan_whole(job.file), lambda name: None)
            if lost := [text for text in left_out if text != UNPROTECTED]:
                raise FormatError(f"rewriting it would lose {lost[0]}", path=job.file.name)
            return protection_of(protect_written(stream, redundancy, progress))
