"""A damaged file made whole again by its recovery data, to the byte.

SPEC.md, "RECV", is normative. Blocks are looked for where they belong, and where the packets that
were found say that bytes were inserted or cut off before them.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from mcz.brief import brief
from mcz.container.source import ByteSource
from mcz.editing.protecting import chunk_bytes
from mcz.errors import FormatError
from mcz.reading.file import reached
from mcz.recovery import making
from mcz.recovery.code import LANE, encoded, recovered, runs_of
from mcz.recovery.field import Ints
from mcz.recovery.making import Step, made
from mcz.recovery.packets import FIELDS, Key, Packet, find_packets, short_hash
from mcz.recovery.shape import HASH, Shape
from mcz.writing.atomic import replacing
from mcz.writing.clip_writer import Progress

MOST_SHIFTS = 16
FEW = 8  # ranges that are named
SLACK = BLOCK = 1 << 20


@dataclass(slots=True)
class Recovery:
    """What recovery data found and did: bad blocks of all, and the bytes of the file they are.

    ``possible``: no more blocks are bad than there are recovery blocks. ``behind``: bytes behind
    the last that is protected, taken as they are.
    """

    n_blocks: int = 0
    n_recovery: int = 0
    bad_blocks: int = 0
    bad_recovery: int = 0
    bad_bytes: list[tuple[int, int]] = field(default_factory=list)
    behind: int = 0
    possible: bool = True

    __repr__ = brief

    def told(self) -> list[str]:
        """What was bad, a line each; nothing for a file that is as it was."""
        if not (self.bad_blocks or self.bad_recovery):
            return []
        of = f"{self.bad_blocks:,} of {self.n_blocks:,} blocks are bad"
        can = f"of {self.n_recovery:,} recovery blocks {self.bad_recovery:,} are bad, too"
        ranges = merged(self.bad_bytes)
        places = ", ".join(f"{start:,} to {stop:,}" for start, stop in ranges[:FEW])
        more = f" and {len(ranges) - FEW:,} more ranges" if len(ranges) > FEW else ""
        where = [f"bytes {places}{more}"] if ranges else []
        return [f"recovery data: {of}; {can}", *where]


def merged(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Ranges of bytes, those that touch as one.

    >>> merged([(8, 9), (0, 4), (4, 6)])
    [(0, 6), (8, 9)]
    """
    found: list[tuple[int, int]] = []
    for start, stop in sorted(ranges):
        if found and start <= found[-1][1]:
            found[-1] = found[-1][0], max(stop, found[-1][1])
        else:
            found.append((start, stop))
    return found


@dataclass(slots=True)
class _Set:
    """One RECV as far as it was found, and where its blocks are."""

    key: Key
    sections: dict[int, bytes] = field(default_factory=dict)
    blocks: dict[int, int] = field(default_factory=dict)  # where their bodies lie
    shifts: dict[int, None] = field(default_factory=dict)  # in the order of being found

    @property
    def shape(self) -> Shape:
        return self.key.shape


def recovery_sets(source: ByteSource) -> list[_Set]:
    """What is left of the recovery data of a file, in the order of what they protect."""
    found: dict[Key, _Set] = {}
    places: dict[Key, dict[tuple[int, int], int]] = {}
    for key, packet in find_packets(source):
        if key.shape.stop > 2 * source.size + SLACK:
            continue  # more than half of the file is gone, or it never was its own
        one = found.setdefault(key, _Set(key))
        place = places.setdefault(key, {(k, i): at for k, i, at in key.shape.packets()})
        _keep(one, packet, place.get((packet.kind, packet.index)))
    sets = sorted(found.values(), key=lambda one: (one.shape.start, -len(one.blocks)))
    chain: list[_Set] = []
    for one in sets:
        if one.shape.start == (chain[-1].shape.stop if chain else 0):
            chain.append(one)
    return chain


def _keep(one: _Set, packet: Packet, place: int | None) -> None:
    if place is None:
        return
    if packet.kind:
        one.blocks[packet.index] = packet.offset + FIELDS.size
    else:
        one.sections[packet.index] = packet.body
    shift = packet.offset - place
    if len(one.shifts) < MOST_SHIFTS:
        one.shifts[shift] = None


def examined(source: ByteSource, one: _Set, found: Recovery) -> dict[int, tuple[int, ...]]:
    """Of each data block that is there, by how much its pieces are shifted; others are bad."""
    shape = one.shape
    table = _table(one)
    there: dict[int, tuple[int, ...]] = {}
    shifts = list(dict.fromkeys([0, *one.shifts]))
    hint = 0
    for block in range(shape.n_blocks):
        pieces = shape.pieces(block)
        wanted = None if table is None else table[HASH * block : HASH * (block + 1)]
        for tried in _tries(hint, shifts, len(pieces)):
            data = _read(source, pieces, tried)
            if data is None:
                continue
            padded = data.ljust(shape.block_size, b"\0")
            if wanted is None or short_hash(padded) == wanted:
                there[block] = tried
                hint = tried[0]
                break
        else:
            found.bad_blocks += 1
            found.bad_bytes += [(at, at + size) for at, size in pieces]
    found.n_blocks += shape.n_blocks
    found.n_recovery += shape.n_recovery
    found.bad_recovery += shape.n_recovery - len(one.blocks)
    if shape.n_blocks - len(there) > len(one.blocks):
        found.possible = False
    return there


def _tries(hint: int, shifts: list[int], n_pieces: int) -> Iterator[tuple[int, ...]]:
    order = list(dict.fromkeys([hint, *shifts]))
    if n_pieces == 1:
        yield from ((shift,) for shift in order)
    else:
        yield from ((one, other) for one in order for other in order)


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


def _table(one: _Set) -> bytes | None:
    """The hashes of the blocks; None where too few sections are left."""
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
        rest = encoded(lambda a, b: own[a:b], n, shape.n_parities, size // LANE)[rows]
        for at, row in enumerate(rows):
            rest[at] ^= np.frombuffer(one.sections[n + row], "<i8")
        own[lost] = recovered(rest, lost, rows, shape.n_parities)
    return own.astype("<i8").tobytes()


class Restorer:
    """Writes a file as it was protected to ``out``, which can be read again."""

    def __init__(self, source: ByteSource, out: BinaryIO, step: Step | None) -> None:
        self.source, self.out, self.step = source, out, step

    def restore(self, one: _Set, there: dict[int, tuple[int, ...]]) -> None:
        """Write what one RECV protects, and itself; raises FormatError where it is not that."""
        shape = one.shape
        for block, shifts in there.items():
            data = _read(self.source, shape.pieces(block), shifts)
            assert data is not None
            self._write(shape, block, data)
        self._solve(one, there)
        self._recv(one)

    def _write(self, shape: Shape, block: int, data: bytes, first: int = 0) -> None:
        """Write what a block has from its byte ``first`` on; the padding is no part of the file."""
        at, stop = 0, first + len(data)
        for offset, size in shape.pieces(block):
            begin, end = max(first, at), min(stop, at + size)
            if begin < end:
                self.out.seek(offset + begin - at)
                self.out.write(data[begin - first : end - first])
            at += size

    def _solve(self, one: _Set, there: dict[int, tuple[int, ...]]) -> None:
        """Write the bad blocks, of large ones some columns at a time."""
        shape = one.shape
        lost = [block for block in range(shape.n_blocks) if block not in there]
        rows = sorted(one.blocks)[: len(lost)]
        lanes = shape.block_size // LANE
        width = max(1, making.AT_ONCE // (runs_of(shape.n_recovery) * LANE))
        for start in range(0, lanes if lost else 0, width):
            stop = min(start + width, lanes)
            read = self._columns(shape, there, start, stop)
            rest = encoded(read, shape.n_blocks, shape.n_recovery, stop - start)[rows]
            for at, row in enumerate(rows):
                place = one.blocks[row] + LANE * start
                rest[at] ^= np.frombuffer(self.source.read(place, LANE * (stop - start)), "<i8")
            found = recovered(rest, lost, rows, shape.n_recovery).astype("<i8")
            for at, block in enumerate(lost):
                self._write(shape, block, found[at].tobytes(), LANE * start)

    def _columns(
        self, shape: Shape, there: dict[int, tuple[int, ...]], start: int, stop: int
    ) -> Callable[[int, int], Ints]:
        """What reads some lanes of the blocks that are there; those that are not are zeros."""

        def read(first: int, last: int) -> Ints:
            found = np.zeros((last - first, stop - start), np.int64)
            for block in range(first, last):
                if block in there:
                    data = _read(self.source, shape.pieces(block), there[block]) or b""
                    padded = memoryview(data.ljust(shape.block_size, b"\0"))
                    found[block - first] = np.frombuffer(padded[LANE * start : LANE * stop], "<i8")
                if self.step is not None:
                    self.step(block, shape.n_blocks)
            return found

        return read

    def _recv(self, one: _Set) -> None:
        """The RECV chunk, made anew of what was written around it; raises NotThatError."""
        shape = one.shape

        def read(block: int) -> bytes:
            parts = []
            for offset, size in shape.pieces(block):
                self.out.seek(offset)
                parts.append(self.out.read(size))
            return b"".join(parts).ljust(shape.block_size, b"\0")

        key, packets = made(shape, read, self.step)
        if key != one.key:
            raise NotThatError("what recovery data give is not what they were made of")
        at = shape.chunk_offset
        for data in chunk_bytes(shape, packets):
            self.out.seek(at)
            self.out.write(data)
            at += len(data)

    def rest(self, last: _Set, size: int) -> None:
        """What lies behind all that is protected, as it is."""
        stop = self.source.size
        self.out.seek(last.shape.stop)
        for at in range(stop - size, stop, BLOCK):
            self.out.write(self.source.read(at, min(BLOCK, stop - at)))
        self.out.truncate(last.shape.stop + size)


def examine(source: ByteSource) -> tuple[Recovery, list[tuple[_Set, dict[int, tuple[int, ...]]]]]:
    """What is bad in a file, by its recovery data, and what of it is where."""
    found = Recovery()
    sets = [(one, examined(source, one, found)) for one in recovery_sets(source)]
    if sets:
        last = sets[-1][0]
        shift = max(last.shifts, default=0)
        found.behind = max(0, source.size - last.shape.stop - shift)
    return found, sets


def checked(target: Any) -> Recovery | None:
    """What the recovery data of a file find bad in it; None where it has none.

    Raises AccessError where it cannot be read.
    """
    source = reached(target)
    try:
        found, sets = examine(source)
    finally:
        source.close()
    return found if sets else None


def recover(
    source: ByteSource, name: Any, target: Any, force: bool, progress: Progress | None
) -> Recovery | None:
    """Write the file as it was protected to ``target``, where that is possible.

    ``name`` is what the damaged file was opened by. Returns None where there are no recovery data,
    and what they found otherwise; nothing is written where it says that it is not ``possible``.
    """
    found, sets = examine(source)
    if not sets or not found.possible:
        return found if sets else None
    step = None if progress is None else _steps(progress)
    try:
        with replacing(target, force=force, inputs=(name,)) as stream:
            own = stream if _is_workable(stream) else tempfile.TemporaryFile()  # noqa: SIM115
            with own if own is not stream else nullcontext():
                restorer = Restorer(source, own, step)
                for one, there in sets:
                    restorer.restore(one, there)
                restorer.rest(sets[-1][0], found.behind)
                if own is not stream:
                    own.seek(0)
                    shutil.copyfileobj(own, stream)
    except NotThatError:
        found.possible = False
    return found


class NotThatError(FormatError):
    """What was put together is not what was protected."""


def _is_workable(stream: Any) -> bool:
    return all(getattr(stream, name, bool)() for name in ("readable", "seekable", "writable"))


def _steps(progress: Progress) -> Step:
    def step(done: int, total: int) -> None:
        progress(done + 1, total, "recovery data")

    return step
