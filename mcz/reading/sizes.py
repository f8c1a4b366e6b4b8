"""Where the bytes of a clip go.

docs/measures.md, "Sizes and ratios", is normative.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from mcz.container import payloads
from mcz.container.chunks import FOOT, FRAMING, HEADER, ChunkType
from mcz.container.directory import SegmentRow
from mcz.container.packets import CHECK_SIZE, head_size
from mcz.container.reader import Container
from mcz.errors import FormatError, UnsupportedError
from mcz.reading.clip import Clip
from mcz.reading.signal_info import SignalInfo
from mcz.schema import build


@dataclass(frozen=True, slots=True)
class Sizes:
    """The bytes of one clip by part; ``models`` are those that its codecs need, in the file.

    ``packets`` is the part of ``overhead`` that goes to framing open DATA and their packets,
    ``between`` are the whole ancillary chunks between CLIP and CEND, ``template`` is the part of
    ``source`` that other clips may share.
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
    source = _source_fields_size(fields)
    template = 0
    if fields.source:
        chunk = container.directory.shared.get((ChunkType.SRCE, bytes(fields.source.template)))
        template = chunk.size if chunk else 0
    cend = row.cend.length or 0 if row.cend else 0
    n_hashes = len(clip.signals) + bool(fields.source) if row.cend else 0
    hashes = 16 + 32 * n_hashes
    clip_length = row.clip.length or 0
    own = clip_length - source - 16 - len(fields.extension) + cend - (hashes - 16)
    packets = packet_framing(row.segments)
    overhead = n_chunks * FRAMING + packets + tables + own
    quality = sum(chunk.size for chunk in row.ancillary if chunk.type == ChunkType.QUAL)
    models = sum(_model_sizes(container, clip).values())
    between = 0
    if row.cend is not None and not container.salvage:
        closed = FRAMING * (n_chunks - 2)
        coded = sum(segment.size for segment in row.segments) + packets + closed
        between = row.cend.offset - (row.clip.offset + row.clip.size) - coded
    own_parts = payload - tables, overhead, template + source, hashes, quality
    return Sizes(*own_parts, models, packets, between, template)


def file_parts(container: Container, sizes: Iterable[Sizes]) -> dict[str, int]:
    """The bytes of a file by part, which sum to its size; ``sizes`` are those of all its clips.

    What several clips share counts once. "other" is the rest: the signature, HEAD, metadata,
    aliases, recovery data, and what a later end of the file has replaced.
    """
    directory, sizes = container.directory, list(sizes)
    shared: dict[bytes, int] = {ChunkType.SKEL: 0, ChunkType.SRCE: 0, ChunkType.MODL: 0}
    for (kind, _), chunk in directory.shared.items():
        shared[kind] += (
            chunk.size if chunk.offset < container.source.size else 0
        )  # salvage adds some
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
    """The ids of the models that a signal needs; none where its codec or header is not known."""
    with suppress(UnsupportedError, FormatError):
        if signal.codec.uses is not None:
            return signal.codec.uses(signal.header)
    return ()


def _model_sizes(container: Container, clip: Clip) -> dict[bytes, int]:
    """Of each model that a clip needs and the file has, the bytes of its chunk."""
    sizes = {}
    for signal in clip.signals:
        for id_ in models_used(signal):
            chunk = container.directory.shared.get((ChunkType.MODL, id_))
            if chunk is not None:
                sizes[id_] = chunk.size
    return sizes


def packet_framing(rows: Sequence[SegmentRow]) -> int:
    """The bytes of open DATA beside the bodies of their packets; ``rows`` in file order."""
    total = n_packets = end = 0
    for row in rows:
        if row.packet:
            head = head_size(n_packets, row.size)
            if not n_packets or row.offset - end != CHECK_SIZE + head:  # another DATA
                total += _end_size(n_packets) + HEADER.size
                n_packets, head = 0, head_size(0, row.size)
            total += head + CHECK_SIZE
            n_packets += 1
        end = row.stop
    return total + _end_size(n_packets)


def _end_size(n_packets: int) -> int:
    return head_size(n_packets, 0) + CHECK_SIZE if n_packets else 0


def _source_fields_size(fields: payloads.Clip) -> int:
    return len(build(fields.source, "source")) if fields.source else 0
