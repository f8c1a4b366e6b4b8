"""What every range of bytes of a file means: ``mcz info --layout``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mcz.brief import first_of
from mcz.container.chunks import CRC, FOOT, HEADER, SIGNATURE, Chunk
from mcz.container.scan import scan
from mcz.container.segments import StreamTable
from mcz.reading.clip import Clip
from mcz.reading.file import File
from mcz.reading.signal_info import SignalInfo

MOST_NAMED = 4  # joints of a group whose names are told


@dataclass(frozen=True, slots=True)
class _Segment:
    """A segment's table, the name of each of its groups, and whether it lies in a packet."""

    table: StreamTable
    groups: list[str]
    in_packet: bool


def layout(file: File) -> list[tuple[int, int, str]]:
    """(offset, size, meaning) of every byte range of the file, in order, without gaps."""
    container = file.container
    found = scan(container.source, salvage=container.salvage)
    parts: list[tuple[int, int, str]] = [(0, len(SIGNATURE), "signature")]
    tables = dict(_segment_tables(file))
    for chunk in found.chunks:
        parts += _chunk_parts(chunk, tables)
    parts += [(at, FOOT.size, "FOOT") for at in found.feet]
    for at, segment in tables.items():
        if segment.in_packet:
            parts += _segment_parts(at, segment)
    return _filled(sorted(parts), file.size)


def _filled(parts: list[tuple[int, int, str]], size: int) -> list[tuple[int, int, str]]:
    """``parts`` with the ranges between them named too."""
    filled, at = [], 0
    for offset, length, text in [*parts, (size, 0, "")]:
        if offset > at:
            filled.append((at, offset - at, "packet framing or damage"))
        if length:
            filled.append((offset, length, text))
        at = max(at, offset + length)
    return filled


def _segment_tables(file: File) -> Iterator[tuple[int, _Segment]]:
    for clip in file.clips.values():
        for signal in clip.signals:
            names = [f"group {number} ({text})" for number, text in group_names(clip, signal)]
            for row in signal.rows:
                table = file.container.table(row, signal.counts)
                yield row.offset, _Segment(table, names, bool(row.packet))


def group_names(clip: Clip, signal: SignalInfo) -> list[tuple[int, str]]:
    """Of each group its number and its joints; of one channel, or of a signal that has no joints,
    its channels."""
    if signal.channels is not None:
        owners = channels = [c.label or f"channel-{n}" for n, c in enumerate(signal.channels)]
    else:
        skeleton = clip.skeleton
        joints = list(zip(skeleton.addresses(), skeleton.joints, strict=True))
        owners = [name for name, joint in joints for _ in joint.channels]
        channels = [f"{name}.{c.label}" for name, joint in joints for c in joint.channels]
    names = []
    for number, group in enumerate(signal.layout.groups):
        called = channels if len(group) == 1 else owners
        names.append((number, first_of(list(dict.fromkeys(called[c] for c in group)), MOST_NAMED)))
    return names


def _chunk_parts(chunk: Chunk, tables: dict[int, _Segment]) -> Iterator[tuple[int, int, str]]:
    name = chunk.type.decode("latin-1")
    yield chunk.offset, HEADER.size, f"{name} header"
    if chunk.length is None:
        return
    if chunk.payload_offset in tables:
        yield from _segment_parts(chunk.payload_offset, tables[chunk.payload_offset])
    elif chunk.length:
        yield chunk.payload_offset, chunk.length, f"{name} payload"
    yield chunk.payload_offset + chunk.length, CRC.size, f"{name} crc"


def _segment_parts(at: int, segment: _Segment) -> Iterator[tuple[int, int, str]]:
    table = segment.table
    header = table.header
    what = f"signal {header.signal}, frames {header.first}:{header.stop}"
    if table.size:
        yield at, table.size, f"stream table, {what}"
    names = {table.frame_notes(): "frame notes"}
    for group, called in enumerate(segment.groups[: table.counts.n_groups]):
        names[table.group_notes(group)] = f"notes of {called}"
        names[table.mask(group)] = f"mask of {called}"
        for resolution in range(table.counts.n_resolutions):
            text = called
            if table.counts.n_resolutions > 1:
                text += f", stored resolution {resolution}"
            names[table.codec(resolution, group)] = text
    implied = None if table.size else table.mask(0)  # it lies in a packet before
    for index, (offset, length) in enumerate(zip(table.offsets, table.lengths, strict=True)):
        if length and index != implied:
            yield at + offset, length, names[index]
