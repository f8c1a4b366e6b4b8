"""Fields of records and slices of bytes: the engine's one user of ``mcz.model.schema``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mcz.codecs.curves.qbc import QbcHeader
from mcz.codecs.online.coder import OnlineHeader
from mcz.codecs.pca.pca import PcaHeader
from mcz.codecs.posewave.header import PosewaveHeader
from mcz.codecs.spatial.lsdt_frame import FrameHeader
from mcz.codecs.spatial.windows import WindowsHeader
from mcz.codecs.wavelet.wavelet import WaveletHeader
from mcz.container import payloads, segments
from mcz.container.directory import Index, Indx
from mcz.container.encodings import decode_data, words
from mcz.model.schema import (
    Record,
    build,
    counted,
    deflate,
    field,
    parse,
    parse_all,
    read_varint,
    varint,
)
from mcz.sources.arrays.layout import ArrayDetail, ArrayTemplate
from mcz.sources.c3d.layout import C3dDetail, C3dOutputsTemplate, C3dTemplate
from mcz.sources.tables.layout import TableDetail, TableTemplate
from mcz.sources.text.layout import Detail, Notes, Template
from tools.records import build_record, span

SCHEMAS: dict[str, Any] = {
    "HEAD": payloads.Head,
    "SKEL": payloads.Skel,
    "SRCE": payloads.Srce,
    "MODL": payloads.Modl,
    "ATTA": payloads.Atta,
    "ALIA": payloads.Alia,
    "CLIP": payloads.Clip,
    "CEND": payloads.Cend,
    "COPY": payloads.Copy,
    "META": payloads.Meta,
    "QUAL": payloads.Qual,
    "INDX": Indx,
    "INDEX": Index,
}


@dataclass(frozen=True)
class View:
    """Bytes within the payloads of chunks of ``type``: how to take them out and put them back."""

    type: bytes
    schema: type[Record] | None
    read: Callable[[bytes], bytes]
    write: Callable[[bytes, bytes], bytes]


def _content(payload: bytes) -> bytes:
    fields = parse(payloads.Srce, payload, "SRCE")
    return decode_data(fields.data, fields.flags, fields.size, "SRCE")


def _with_content(payload: bytes, content: bytes) -> bytes:
    """A SRCE of another template, encoded as before."""
    fields = parse(payloads.Srce, payload, "SRCE")
    packed = {
        payloads.STORED: lambda: content,
        payloads.DEFLATED: lambda: deflate(content),
        payloads.AFTER_WORDS: lambda: deflate(content, words=words()),
    }[fields.flags & payloads.ENCODING]()
    return build_record(
        payloads.Srce, vars(fields) | {"size": len(content), "data": packed}, "SRCE"
    )


def _copy_content(payload: bytes) -> bytes:
    """The content of a COPY or META: flags, size, data."""
    size, at = read_varint(payload, 1)
    return decode_data(payload[at:], payload[0], size, "COPY")


def _with_copied(payload: bytes, content: bytes) -> bytes:
    data = content if payload[0] == payloads.STORED else deflate(content)
    return payload[:1] + varint(len(content)) + data


class CopiedChunks(Record):
    """The content of a COPY as a list."""

    copies: list[payloads.CopiedChunk] = field(counted(payloads.CopiedChunk), "the copies")


def _copy_list(payload: bytes) -> bytes:
    content = _copy_content(payload)
    return varint(len(parse_all(payloads.CopiedChunk, content, "COPY"))) + content


def _with_copy_list(payload: bytes, content: bytes) -> bytes:
    return _with_copied(payload, content[read_varint(content, 0)[1] :])


def _inside(schema: Any, path: str) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Reader and writer of the content of a field of bytes behind their length."""

    def read(payload: bytes) -> bytes:
        start, stop = span(schema, payload, path)
        return payload[read_varint(payload, start)[1] : stop]

    def write(payload: bytes, content: bytes) -> bytes:
        start, stop = span(schema, payload, path)
        return payload[:start] + varint(len(content)) + content + payload[stop:]

    return read, write


# What an edit may name beside chunks. Helpers add theirs for codecs: a header, a stream.
VIEWS: dict[str, View] = {
    "INDEX": View(b"INDX", Index, lambda payload: payload, lambda payload, content: content),
    "TEMPLATE": View(b"SRCE", Template, _content, _with_content),
    "C3DTEMPLATE": View(b"SRCE", C3dTemplate, _content, _with_content),
    "DETAIL": View(b"CLIP", Detail, *_inside(payloads.Clip, "source.0.detail")),
    "OUTPUTSTEMPLATE": View(b"SRCE", C3dOutputsTemplate, _content, _with_content),
    "ARRAYTEMPLATE": View(b"SRCE", ArrayTemplate, _content, _with_content),
    "ARRAYDETAIL": View(b"CLIP", ArrayDetail, *_inside(payloads.Clip, "source.0.detail")),
    "TABLETEMPLATE": View(b"SRCE", TableTemplate, _content, _with_content),
    "TABLEDETAIL": View(b"CLIP", TableDetail, *_inside(payloads.Clip, "source.0.detail")),
    "C3DDETAIL": View(b"CLIP", C3dDetail, *_inside(payloads.Clip, "source.0.detail")),
    "COPIES": View(b"COPY", None, _copy_content, _with_copied),
    "COPIED": View(b"COPY", CopiedChunks, _copy_list, _with_copy_list),
    "RECORDS": View(b"META", None, _copy_content, _with_copied),
    "HEADER": View(b"CLIP", None, *_inside(payloads.Clip, "signals.0.header")),
    **{
        f"{codec}_HEADER": View(b"CLIP", record, *_inside(payloads.Clip, "signals.0.header"))
        for codec, record in {
            "CLIP": WindowsHeader,
            "FRAME": FrameHeader,
            "ONLINE": OnlineHeader,
            "PCA": PcaHeader,
            "POSEWAVE": PosewaveHeader,
            "QBC": QbcHeader,
            "WAVELET": WaveletHeader,
        }.items()
    },
    "HEADER1": View(b"CLIP", None, *_inside(payloads.Clip, "signals.1.header")),
}
STREAMS: dict[str, type[Record] | None] = {
    "DATA": None,
    "NOTES": segments.GroupNotes,
    "ROWS": Notes,
}


def ends_of(size: int, text: str) -> tuple[int, int]:
    """The bounds that ``[3]``, ``[3:5]``, ``[-1:]`` or ``[end:]`` name in so many bytes."""
    if ":" not in text:
        start = int(text) % size
        return start, start + 1
    start, stop, _ = slice(*(_bound(part, size) for part in text.split(":"))).indices(size)
    return start, max(start, stop)


def _bound(text: str, size: int) -> int | None:
    if text == "end":
        return size
    return int(text, 0) if text else None


def place_of(schema: Any, data: bytes, path: str, slice_: str | None) -> tuple[int, int]:
    """The bounds of a field, of a slice of it, or of a slice of all."""
    start, stop = span(schema, data, path) if path else (0, len(data))
    if slice_ is None:
        return start, stop
    first, last = ends_of(stop - start, slice_)
    return start + first, start + last


def swap_items(schema: Any, data: bytes, path: str, other: str) -> bytes:
    """``data`` with two items of a list in each other's place."""
    table, _, one = path.rpartition(".")
    if schema is Index:
        record = parse(Index, data, "INDEX")
        order = list(range(len(getattr(record, table))))
        i, j = int(one), int(other.rpartition(".")[2])
        order[i], order[j] = j, i
        setattr(record, table, [getattr(record, table)[n] for n in order])
        return build(record, "INDEX")
    (a, b), (c, d) = sorted((span(schema, data, path), span(schema, data, other)))
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]
