"""Where the bytes of a clip go.

Part of the joint between motion, codec and container (see ``file.py``). SPEC.md, "Sizes and
ratios", is normative.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mcz.container import payloads
from mcz.container.chunks import FRAMING
from mcz.container.reader import Container
from mcz.files.clip import Clip
from mcz.schema import build


@dataclass(frozen=True, slots=True)
class Sizes:
    """The bytes of one clip by part."""

    payload: int = 0
    overhead: int = 0
    source: int = 0
    hashes: int = 0
    quality: int = 0


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
        chunk = container.directory.shared.get((b"SRCE", bytes(fields.source[0].template)))
        template = chunk.size if chunk else 0
    cend = row.cend.length or 0 if row.cend else 0
    n_hashes = len(clip.signals) + len(fields.source) if row.cend else 0
    hashes = 16 + 32 * n_hashes
    clip_length = row.clip.length or 0
    own = clip_length - source - 16 - len(fields.extension) + cend - (hashes - 16)
    overhead = n_chunks * FRAMING + tables + own
    quality = sum(chunk.size for chunk in row.ancillary if chunk.type == b"QUAL")
    return Sizes(payload - tables, overhead, template + source, hashes, quality)


def _source_fields_size(fields: Any) -> int:
    if not fields.source:
        return 0
    return len(build(payloads.CLIP_SOURCE, fields.source[0], "source"))
