"""What copies give back of a damaged file. SPEC.md, "Salvage", is normative."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from operator import eq

from mcz.container.chunks import COPY, FOOT, Chunk, read_chunk, read_payload
from mcz.container.copies import Copy, parse_copies
from mcz.container.directory import Found
from mcz.container.overlay import Overlay
from mcz.container.source import ByteSource
from mcz.errors import FormatError, MczError


def restored(source: ByteSource, found: Found) -> tuple[Overlay | None, list[str]]:
    """``source`` with the damaged chunks of which it has copies, None where nothing is to be done.

    ``found`` is what a salvaging scan of ``source`` has found. Also returns what was wrong with
    each of these chunks, and with copies that cannot be used.
    """
    if not found.damage:
        return None, []
    notes: list[str] = []
    sound = _Sound(found)
    parts: dict[int, bytes] = {}
    for copy in _copies(source, found, notes):
        chunk = copy.chunk
        if source.read(copy.offset, len(chunk)) == chunk:
            continue
        fault = _fault(source, copy)
        if not fault or sound.meets(copy.offset, copy.stop):  # SALV-08
            notes.append(f"a copy of {copy.label} is not used: what lies there is sound")
            continue
        notes.append(f"{copy.label}: {fault}; its copy is used")  # SALV-07
        parts[copy.offset] = chunk
    return (Overlay(source, parts) if parts else None), notes


def _copies(source: ByteSource, found: Found, notes: list[str]) -> Iterator[Copy]:
    """The copies in every COPY that is whole; together they are no longer than the file."""
    left = source.size
    for chunk in found.chunks:
        if chunk.type != COPY:
            continue
        try:
            copies = parse_copies(read_payload(source, chunk, chunk.size), chunk, left)
        except MczError as error:
            notes.append(str(error))
            continue
        left -= sum(copy.stop - copy.offset for copy in copies)
        yield from copies


class _Sound:
    """Where the chunks and FOOTs lie that were found whole."""

    def __init__(self, found: Found) -> None:
        spans = [(at, at + FOOT.size) for at in found.feet]
        spans += [(chunk.offset, _end(chunk, found)) for chunk in found.chunks]
        self.spans = sorted(spans)

    def meets(self, start: int, stop: int) -> bool:
        """Whether one of them has bytes of ``start`` <= offset < ``stop``."""
        index = bisect_right(self.spans, (start, stop))
        return any(a < stop and start < b for a, b in self.spans[max(0, index - 1) : index + 1])


def _end(chunk: Chunk, found: Found) -> int:
    return found.ends[chunk.offset] if chunk.length is None else chunk.offset + chunk.size


def _fault(source: ByteSource, copy: Copy) -> str:
    """What is wrong with the chunk of which there is a copy, "" where it is sound."""
    try:
        chunk = read_chunk(source, copy.offset)
        read_payload(source, chunk, chunk.length or 0)
    except FormatError as error:
        return str(error)
    return ""


def is_like(source: ByteSource, offset: int, chunk: bytes) -> bool:
    """Whether what lies at ``offset`` is this ``chunk``, damaged: most of its bytes are there."""
    there = source.read(offset, max(0, min(len(chunk), source.size - offset)))
    return bool(4 * sum(map(eq, there, chunk)) >= 3 * len(chunk))
