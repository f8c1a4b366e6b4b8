"""Files of the profile small: nothing packed, two codecs, grids with a name.

SPEC.md, "Limits and profiles", is normative.
"""

from __future__ import annotations

from mcz.container import payloads
from mcz.container.chunks import ChunkType
from mcz.container.dictionary_deflate import is_packed
from mcz.errors import LimitError
from mcz.model.numbers import GridKind
from mcz.model.schema import Record, parse

CODECS = {0, 1}  # raw and fast
ENCODED: dict[bytes, type[Record]] = {
    ChunkType.SRCE: payloads.Srce,
    ChunkType.ATTA: payloads.Atta,
    ChunkType.META: payloads.Meta,
}
ABSENT = {ChunkType.INDX, ChunkType.COPY, ChunkType.MODL}


def check_plain(kind: bytes, payload: bytes, where: str) -> None:
    """Raise LimitError for a chunk that a file of the profile small cannot have."""
    record = ENCODED.get(kind)
    if record is not None:
        packed = vars(parse(record, payload, where))["flags"] & payloads.ENCODING != payloads.STORED
    else:
        packed = kind == ChunkType.SKEL and is_packed(payload, where)
    if packed:  # LIMIT-22
        raise LimitError("the profile small packs nothing", where=where)
    if kind in ABSENT:  # LIMIT-23
        raise LimitError("the profile small has no such chunk", where=where)
    if kind == ChunkType.CLIP:
        _check_clip(parse(payloads.Clip, payload, where), where)


def _check_clip(fields: payloads.Clip, where: str) -> None:
    for signal in fields.signals:
        if signal.codec not in CODECS:  # LIMIT-20
            raise LimitError(f"codec {signal.codec}: small has raw and fast", where=where)
        if any(run.grid.kind == GridKind.PRINTED for run in signal.grids):  # LIMIT-21
            raise LimitError("grid PRINTED: the profile small does not have it", where=where)
