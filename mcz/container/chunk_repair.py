"""Repair of a damaged file from copies and the index. SPEC.md, "Salvage", is normative."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from operator import eq

from mcz.container import payloads
from mcz.container.chunks import (
    COPIED,
    CRC,
    END,
    FOOT,
    HEADER,
    Chunk,
    ChunkType,
    build_chunk,
    parse_chunk_header,
    read_chunk,
    read_payload,
)
from mcz.container.directory import Directory
from mcz.container.encodings import Copy, parse_copies
from mcz.container.index_reader import Listed, directory_of, read_indexes
from mcz.container.limits import BASE, index_limit
from mcz.container.model_records import build_head, parse_head
from mcz.container.parser_drivers import packets
from mcz.container.scan import scan
from mcz.container.scanner import ScanResult
from mcz.container.source import ByteSource, Overlay
from mcz.errors import FormatError, MczError
from mcz.model.schema import build

MOST_READ = 4  # times the bytes of a file, in search of a bit


def scan_for_salvage(source: ByteSource) -> tuple[ByteSource, ScanResult, list[str]]:
    """A damaged file with all possible repairs, a salvaging scan of it, and its faults.

    Raises FormatError if no chunk is intact.
    """
    scanned = scan(source, salvage=True)
    better, notes = restore_chunks(source, scanned)
    if better is not None:  # SALV-06
        source, scanned = better, scan(better, salvage=True)
    if scanned.doubts and (owners := owners_of(source, scanned)):
        scanned = scan(source, salvage=True, owners=owners)
    notes += restore_from_index(source, scanned)
    if not scanned.chunks:
        raise FormatError("no chunk is intact, so nothing can be salvaged")
    return source, scanned, notes


def restore_chunks(source: ByteSource, scanned: ScanResult) -> tuple[Overlay | None, list[str]]:
    """``source`` with its damaged chunks restored from copies, None if none can be.

    ``scanned`` is the result of a salvaging scan of ``source``. Also returns the fault of each of
    these chunks, and of copies that cannot be used.
    """
    if not scanned.damage:
        return None, []
    notes: list[str] = []
    sound = _sound_spans(scanned)
    parts: dict[int, bytes] = {}
    for copy, shift in _shift_copies(source, scanned, list(_read_copies(source, scanned, notes))):
        if shift is None:
            notes.append(f"a copy of {copy.label} is not used, because its place is unclear")
            continue
        copy = replace(copy, offset=copy.offset + shift)
        chunk = copy.chunk
        if copy.offset < 0 or copy.stop > source.size:
            continue
        if source.read(copy.offset, len(chunk)) == chunk:
            continue
        fault = _fault_of(source, copy)
        if not fault or _overlaps(sound, copy.offset, copy.stop):  # SALV-08
            notes.append(f"a copy of {copy.label} is not used, because the original is intact")
            continue
        notes.append(f"{copy.label}: {fault}; its copy is used")  # SALV-07
        parts[copy.offset] = chunk
    for offset, header in _mend_headers(source, scanned):
        if not any(at <= offset < at + len(part) for at, part in parts.items()):
            notes.append(f"chunk at {offset}: one wrong bit of its header was corrected")
            parts[offset] = header
    return (Overlay(source, parts) if parts else None), notes


def _mend_headers(source: ByteSource, scanned: ScanResult) -> Iterator[tuple[int, bytes]]:
    """Headers with a single bit flipped back, with which both checks of the chunk hold."""
    left = MOST_READ * source.size
    for offset, chunk in scanned.broken:
        if chunk is None and offset + HEADER.size <= source.size:
            stated = int.from_bytes(source.read(offset, HEADER.size), "little")
            for bit in range(8 * HEADER.size):
                header = (stated ^ 1 << bit).to_bytes(HEADER.size, "little")
                with suppress(FormatError):
                    mended = parse_chunk_header(header, offset)
                    if mended.type == ChunkType.COPY:  # copies are written again
                        continue
                    left -= HEADER.size if mended.length is None else mended.size
                    if left < 0:
                        return
                    _check_whole(Overlay(source, {offset: header}), mended)
                    yield offset, header
                    break


def _check_whole(source: ByteSource, chunk: Chunk) -> None:
    """Check a whole chunk, or the first packet of an open one; raises FormatError."""
    if chunk.length is None:
        if next(packets(source, chunk)).packet.kind == END:
            raise FormatError(f"chunk {chunk.label} has no packet")
    else:
        read_payload(source, chunk, chunk.size)


def _shift_copies(
    source: ByteSource, scanned: ScanResult, copies: list[Copy]
) -> Iterator[tuple[Copy, int | None]]:
    """Each copy, and the shift of its original from the stated offset.

    Bytes that were inserted or cut out before a COPY shift all of its offsets. Intact copied chunks
    show the shift, also for the damaged ones between them; None if they do not agree.
    """
    places: dict[tuple[bytes, int | None, bytes], list[int]] = {}
    for one in scanned.chunks:
        if one.type in COPIED:
            crc = source.read(one.offset + one.size - CRC.size, CRC.size)
            places.setdefault((one.type, one.length, crc), []).append(one.offset)
    known: list[int | None] = []
    for copy in copies:
        key = copy.type, len(copy.payload), copy.chunk[-CRC.size :]
        near = sorted(abs(at - copy.offset) for at in places.get(key, []))
        ats = [at for at in places.get(key, []) if abs(at - copy.offset) == near[0]]
        known.append(ats[0] - copy.offset if ats else None)
    before, after = _fill_forward(known), _fill_forward(known[::-1])[::-1]
    for copy, own, last, following in zip(copies, known, before, after, strict=True):
        around = {shift for shift in (last, following) if shift is not None} or {0}
        yield copy, own if own is not None else around.pop() if len(around) == 1 else None


def _fill_forward(known: list[int | None]) -> list[int | None]:
    filled: list[int | None] = []
    for one in known:
        filled.append(one if one is not None or not filled else filled[-1])
    return filled


def _read_copies(source: ByteSource, scanned: ScanResult, notes: list[str]) -> Iterator[Copy]:
    """The copies in every intact COPY; together they are not longer than the file."""
    left = source.size
    for chunk in scanned.chunks:
        if chunk.type != ChunkType.COPY:
            continue
        try:
            copies = parse_copies(read_payload(source, chunk, chunk.size), chunk, left)
        except MczError as error:
            notes.append(str(error))
            continue
        left -= sum(copy.stop - copy.offset for copy in copies)
        yield from copies


def _sound_spans(scanned: ScanResult) -> list[tuple[int, int]]:
    feet = [(at, at + FOOT.size) for at in scanned.feet]
    ends = (scanned.ends[c.offset] if c.length is None else c.stop for c in scanned.chunks)
    return sorted([*feet, *zip((c.offset for c in scanned.chunks), ends, strict=True)])


def _overlaps(spans: list[tuple[int, int]], start: int, stop: int) -> bool:
    index = bisect_right(spans, (start, stop))
    return any(a < stop and start < b for a, b in spans[max(0, index - 1) : index + 1])


def _fault_of(source: ByteSource, copy: Copy) -> str:
    try:
        chunk = read_chunk(source, copy.offset)
        read_payload(source, chunk, chunk.length or 0)
    except FormatError as error:
        return str(error)
    return ""


def owners_of(source: ByteSource, scanned: ScanResult) -> dict[tuple[int, int], str]:
    """Owners of segments and CENDs, from the last intact index; see ``scan``."""
    index = _read_last_index(source, scanned)
    owners: dict[tuple[int, int], str] = {}
    with suppress(FormatError):
        for name, clip in index.clips.items() if index is not None else ():
            owners |= {(row.offset, row.size): name for row in clip.segments}
            if clip.cend is not None:
                owners[clip.cend.offset, clip.cend.size] = name
    return owners


def _read_last_index(source: ByteSource, scanned: ScanResult) -> Directory | None:
    """The content of the last intact INDX, and of the intact ones that it continues."""
    for chunk in reversed(scanned.chunks):
        if chunk.type == ChunkType.INDX:
            whole: list[Listed] = []
            with suppress(FormatError):
                limit = index_limit(source.size)
                whole.extend(read_indexes(source.read, chunk.offset, chunk.size, limit))
            with suppress(FormatError):
                if whole:
                    return directory_of(whole)
    return None


def restore_from_index(source: ByteSource, scanned: ScanResult) -> list[str]:
    """Restore the lost HEAD and aliases of a salvaged file from the last intact index.

    Without an index it gets the HEAD of this version. Returns the lost parts.
    """
    directory, notes = scanned.directory, []
    index = _read_last_index(source, scanned)
    if index is not None and not directory.head:
        with suppress(FormatError):
            parse_head(index.head)
            directory.head = index.head
            notes.append("HEAD is lost; it is taken from the index")
    for name, (of, target) in index.aliases.items() if index is not None else ():
        if name not in directory.aliases:
            directory.aliases[name] = of, target
            notes.append(f"alias {name!r} is lost; it is taken from the index")
            record = payloads.Alia(name=name, of=of, target=target)
            alias = build_chunk(ChunkType.ALIA, build(record, "ALIA"))
            scanned.broken = [b for b in scanned.broken if not is_like(source, b[0], alias)]
    if not directory.head:
        notes.append("HEAD is lost; the file is read as one of this version")
        directory.head = build_head(BASE)
    return notes


def is_like(source: ByteSource, offset: int, chunk: bytes) -> bool:
    """Return True if most bytes at ``offset`` equal those of ``chunk``."""
    present = source.read(offset, max(0, min(len(chunk), source.size - offset)))
    return bool(4 * sum(map(eq, present, chunk)) >= 3 * len(chunk))
