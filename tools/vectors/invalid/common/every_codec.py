"""Faults of clips of every codec: headers where there is nothing to decode."""

from __future__ import annotations

from mcz.codecs import by_name
from mcz.container import payloads
from mcz.schema import varint
from tools.vectors.build.edits import Edit, put, span
from tools.vectors.build.files import Broken, Crafter, finished, heading_of
from tools.vectors.build.motions import dance


def add(shelf: Broken, name: str) -> None:
    """Headers of clips in which there is nothing to decode."""
    codec = by_name(name)
    spec = f"{heading_of(name)}; CLIP"

    def edited(edit: Edit) -> bytes:
        crafter = Crafter(CLIP=edit)
        segments = {"segment_frames": 8} if name not in ("raw", "lossless") else {}
        crafter.clip(dance(0), codec=codec, grouping=codec.grouping, **segments)
        return finished(crafter)

    purpose = "A byte behind the header, of a clip of no frames."
    shelf.add("frames-0-header", spec, purpose, edited(_longer_header))
    purpose = "99 resolutions of a clip of no frames."
    edit = put(payloads.Clip, "signals.0.n_resolutions", b"\x63")
    shelf.add("frames-0-resolutions", spec, purpose, edited(edit))


def _longer_header(payload: bytes) -> bytes:
    start, stop = span(payloads.Clip, payload, "signals.0.header")
    header = payload[start + 1 : stop] + b"\0"
    return payload[:start] + varint(len(header)) + header + payload[stop:]
