"""The bytes of a file: parts of clips, ratios, shares of groups, and every range of bytes.

docs/reference/measures.md, "Sizes and ratios", is normative.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from mcz.container import payloads
from mcz.container.chunks import CRC, FOOT, FRAMING, HEADER, SIGNATURE, Chunk, ChunkType
from mcz.container.reader import Container
from mcz.container.scan import scan
from mcz.container.segments import StreamTable
from mcz.errors import FormatError, UnsupportedError
from mcz.files.reading.clip import Clip
from mcz.files.reading.clips import packet_framing
from mcz.files.reading.file import File
from mcz.files.reading.signal_info import SignalInfo
from mcz.model.schema import build
from mcz.model.text_format import first_names

MOST_NAMED = 4  # most joints of a group in its name


@dataclass(frozen=True, slots=True)
class Sizes:
    """The bytes of one clip by part; ``models`` are the models that its codecs need, in the file.

    ``packets``: the part of ``overhead`` for the framing of open DATA and packets; ``between``: all
    ancillary chunks between CLIP and CEND; ``template``: the part of ``source`` that clips may
    share.
    """

    payload: int = 0
    overhead: int = 0
    source: int = 0
    hashes: int = 0
    quality: int = 0
    models: int = 0
    packets: int = 0
    between: int = 0
    template: int = 0


def clip_sizes(container: Container, clip: Clip) -> Sizes:
    """The bytes of a clip's own chunks, and of the template that it needs, by part."""
    row = container.directory.clips[clip.name]
    fields = clip._fields
    payload = sum(signal_row.size for signal in clip.signals for signal_row in signal.rows)
    tables = sum(
        container.table(segment, signal.counts).size
        for signal in clip.signals
        for segment in signal.rows
    )
    n_chunks = 2 + sum(not segment.packet for segment in row.segments)
    shared = container.directory.shared
    source = template = 0
    if fields.source:
        source = len(build(fields.source, "source"))
        chunk = shared.get((ChunkType.SRCE, bytes(fields.source.template)))
        template = chunk.size if chunk else 0
    cend = row.cend.length or 0 if row.cend else 0
    n_hashes = len(clip.signals) + bool(fields.source) if row.cend else 0
    hashes = 16 + 32 * n_hashes
    clip_length = row.clip.length or 0
    own = clip_length - source - 16 - len(fields.extension) + cend - (hashes - 16)
    packets = packet_framing(row.segments)
    overhead = n_chunks * FRAMING + packets + tables + own
    quality = sum(chunk.size for chunk in row.ancillary if chunk.type == ChunkType.QUAL)
    used = {(ChunkType.MODL, id_) for signal in clip.signals for id_ in models_used(signal)}
    models = sum(shared[key].size for key in used if key in shared)
    between = 0
    if row.cend is not None and not container.salvage:
        closed = FRAMING * (n_chunks - 2)
        coded = sum(segment.size for segment in row.segments) + packets + closed
        between = row.cend.offset - (row.clip.offset + row.clip.size) - coded
    own_parts = payload - tables, overhead, template + source, hashes, quality
    return Sizes(*own_parts, models, packets, between, template)


def file_parts(container: Container, sizes: Iterable[Sizes]) -> dict[str, int]:
    """The bytes of a file by part, which sum to its size; ``sizes`` are those of all its clips.

    Parts shared by several clips count once. "other" is the rest: the signature, HEAD, metadata,
    aliases, recovery data, and parts replaced by a later end of the file.
    """
    directory, sizes = container.directory, list(sizes)
    shared: dict[bytes, int] = {ChunkType.SKEL: 0, ChunkType.SRCE: 0, ChunkType.MODL: 0}
    for (kind, _), chunk in directory.shared.items():
        if chunk.offset < container.source.size:  # salvage adds some
            shared[kind] += chunk.size
    attachments = [part for row in directory.attachments.values() for part in row.parts]
    parts = {
        "payload": sum(one.payload for one in sizes),
        "overhead": sum(one.overhead for one in sizes),
        "skeletons": shared[ChunkType.SKEL],
        "models": shared[ChunkType.MODL],
        "source": shared[ChunkType.SRCE] + sum(one.source - one.template for one in sizes),
        "hashes": sum(one.hashes for one in sizes),
        "quality": sum(one.quality for one in sizes),
        "attachments": sum(part.size for part in attachments),
        "copies": sum(chunk.size for chunk in container.copies()),
        "index": directory.index_bytes + FOOT.size * bool(directory.indexes),
    }
    return parts | {"other": container.source.size - sum(parts.values())}


def models_used(signal: SignalInfo) -> tuple[bytes, ...]:
    """The ids of the models that a signal needs; none if its codec or header is unknown."""
    with suppress(UnsupportedError, FormatError):
        if signal.codec.uses is not None:
            return signal.codec.uses(signal.header)
    return ()


def clip_ratios(file: File, clip: Clip) -> dict[str, float | None]:
    """``cr_source cr_float32 cr_40B cr_file`` of one clip."""
    return ratios_of(file, clip, clip_sizes(file.container, clip))


def ratios_of(file: File, clip: Clip, sizes: Sizes) -> dict[str, float | None]:
    """The compression ratios of SPEC.md's registry; None if the numerator is unknown."""
    coded = sizes.payload + sizes.overhead + sizes.models
    try:
        lossless = all(signal.codec.lossless for signal in clip.signals)
    except UnsupportedError:
        lossless = False
    restored = coded + sizes.source + sizes.hashes if lossless else coded
    source = clip.source.size if clip.source else 0
    rows = sum(
        clip.n_frames * s.layout.samples_per_frame * s.layout.n_channels for s in clip.signals
    )
    return {
        "cr_source": source / restored if source else None,
        "cr_float32": 4 * rows / coded if rows else None,
        "cr_40B": 40 * clip.n_frames * clip.skeleton.n_joints / coded if rows else None,
        "cr_file": file_ratio(file) if source and len(file.clips) == 1 else None,
    }


def _stored_bytes(file: File) -> int:
    own = [clip.source.size for clip in file.clips.values() if clip.source is not None]
    own += [attachment.size for attachment in file.attachments.values()]
    return sum(own) + sum(_alias_bytes(file, name) for name in file.aliases)


def _alias_bytes(file: File, name: str) -> int:
    of, target = file.aliases[name]
    if of == payloads.OF_SKELETON:
        source = file.skeleton(target, with_source=True).source
        return source.size if source is not None else 0
    name_of_target = target.decode("utf-8", "replace")
    if of == payloads.OF_ATTACHMENT:
        return file.attachments[name_of_target].size
    clip_source = file.clips[name_of_target].source
    return clip_source.size if clip_source is not None else 0


def file_ratio(file: File) -> float | None:
    """Bytes of stored files per byte of the file; None if unknown."""
    try:
        return _stored_bytes(file) / file.size or None
    except (FormatError, KeyError):  # salvaged: the named ones are lost
        return None


@dataclass(frozen=True, slots=True)
class Share:
    """Bytes of a group's streams of one sort in all segments; all of them sum to the payload.

    ``name`` lists the first joints of the group, or its first channels. ``resolution`` counts as
    stored, from 0, the coarsest; None outside of the codec: exceptions, masks, frame notes (whose
    group is None).
    """

    signal: str
    group: int | None
    name: str
    resolution: int | None
    n_bytes: int


def byte_shares(clip: Clip) -> list[Share]:
    """The bytes of each group of each signal, by resolution and outside of the codec.

    Reads only the stream tables. The sum is the payload of ``mcz info``.
    """
    shares = []
    for signal in clip.signals:
        names = [text for _, text in group_names(clip, signal)]
        totals: dict[tuple[int | None, int | None], int] = {}
        for row in signal.rows:
            table = clip.container.table(row, signal.counts)
            for key, index in _streams(table):
                if index is not None:
                    totals[key] = totals.get(key, 0) + table.lengths[index]
        shares += [
            Share(signal.name, group, "" if group is None else names[group], resolution, total)
            for (group, resolution), total in totals.items()
            if total
        ]
    return shares


def by_group(shares: Iterable[Share]) -> dict[str, dict[int | None, int]]:
    """The bytes by the joints of a group, then by resolution, in the order of ``shares``.

    The names begin with the signal's if several have bytes.
    """
    shares = list(shares)
    several = len({share.signal for share in shares}) > 1
    groups: dict[str, dict[int | None, int]] = {}
    for share in shares:
        label = share.name or "frame notes"
        totals = groups.setdefault(f"{share.signal}: {label}" if several else label, {})
        totals[share.resolution] = totals.get(share.resolution, 0) + share.n_bytes
    return groups


def _streams(table: StreamTable) -> Iterator[tuple[tuple[int | None, int | None], int | None]]:
    yield (None, None), table.frame_notes()
    for group in range(table.counts.n_groups):
        yield (group, None), table.group_notes(group)
        yield (group, None), table.mask(group)
        for resolution in range(table.counts.n_resolutions):
            yield (group, resolution), table.codec(resolution, group)


@dataclass(frozen=True, slots=True)
class _Segment:
    table: StreamTable
    groups: list[str]
    in_packet: bool


def layout(file: File) -> list[tuple[int, int, str]]:
    """(offset, size, meaning) of every byte range of the file, in order, without gaps."""
    container = file.container
    scanned = scan(container.source, salvage=container.salvage)
    parts: list[tuple[int, int, str]] = [(0, len(SIGNATURE), "signature")]
    tables = dict(_segment_tables(file))
    for chunk in scanned.chunks:
        parts += _chunk_parts(chunk, tables)
    parts += [(at, FOOT.size, "FOOT") for at in scanned.feet]
    for at, segment in tables.items():
        if segment.in_packet:
            parts += _segment_parts(at, segment)
    return _fill_gaps(sorted(parts), file.size)


def _fill_gaps(parts: list[tuple[int, int, str]], size: int) -> list[tuple[int, int, str]]:
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
    """Number and joints of each group; its channels for one channel, or a signal without joints."""
    if signal.channels is not None:
        owners = channels = [c.label or f"channel-{n}" for n, c in enumerate(signal.channels)]
    else:
        skeleton = clip.skeleton
        joints = list(zip(skeleton.addresses(), skeleton.joints, strict=True))
        owners = [name for name, joint in joints for _ in joint.channels]
        channels = [f"{name}.{c.label}" for name, joint in joints for c in joint.channels]
    names = []
    for number, group in enumerate(signal.layout.groups):
        labels = channels if len(group) == 1 else owners
        names.append(
            (number, first_names(list(dict.fromkeys(labels[c] for c in group)), MOST_NAMED))
        )
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
    label = f"signal {header.signal}, frames {header.first}:{header.stop}"
    if table.size:
        yield at, table.size, f"stream table, {label}"
    names = {table.frame_notes(): "frame notes"}
    for group, group_name in enumerate(segment.groups[: table.counts.n_groups]):
        names[table.group_notes(group)] = f"notes of {group_name}"
        names[table.mask(group)] = f"mask of {group_name}"
        for resolution in range(table.counts.n_resolutions):
            text = group_name
            if table.counts.n_resolutions > 1:
                text += f", stored resolution {resolution}"
            names[table.codec(resolution, group)] = text
    implied = None if table.size else table.mask(0)  # it is in an earlier packet
    for index, (offset, length) in enumerate(zip(table.offsets, table.lengths, strict=True)):
        if length and index != implied:
            yield at + offset, length, names[index]
