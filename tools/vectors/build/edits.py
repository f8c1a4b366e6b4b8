"""Edits of payloads, chunks and segments, for files that no writer would write."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from mcz.container import payloads
from mcz.container.segments import SegmentHeader, StreamCounts, parse_stream_table
from mcz.model.schema import varint
from tools.records import span

Edit = Callable[[bytes], bytes]
Made = list[tuple[SegmentHeader, Sequence[bytes]]]  # segments before they are built


def both(*edits: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """One edit after the other."""

    def edit(value: Any) -> Any:
        for one in edits:
            value = one(value)
        return value

    return edit


def put(schema: Any, path: str, new: bytes) -> Edit:
    """Replace the bytes of the field at ``path``, such as "signals.0.codec"."""

    def edit(payload: bytes) -> bytes:
        start, stop = span(schema, payload, path)
        return payload[:start] + new + payload[stop:]

    return edit


def says(data: bytes) -> Edit:
    """Put another header of the codec into CLIP."""
    return put(payloads.Clip, "signals.0.header", varint(len(data)) + data)


def swap(old: bytes, new: bytes) -> Edit:
    """Replace ``old``, which must be there once."""

    def edit(payload: bytes) -> bytes:
        assert payload.count(old) == 1, (payload.count(old), old)
        return payload.replace(old, new)

    return edit


def at(offset: int, new: bytes) -> Edit:
    """Overwrite the bytes at ``offset``, counted from the end where it is negative."""

    def edit(payload: bytes) -> bytes:
        start = offset % len(payload)
        return payload[:start] + new + payload[start + len(new) :]

    return edit


def plus(tail: bytes) -> Edit:
    return lambda payload: payload + tail


def framed(**changes: bytes) -> Edit:
    """Edit the header of a chunk; its header_check and crc are made anew unless they are given."""

    def edit(chunk: bytes) -> bytes:
        parts = {
            "type": chunk[:4],
            "flags": chunk[4:5],
            "reserved": chunk[5:6],
            "header_check": b"",
            "length": chunk[8:16],
            "payload": chunk[16:-4],
            "crc": b"",
        } | changes
        head = parts["type"] + parts["flags"] + parts["reserved"]
        check = struct.pack("<H", zlib.crc32(head + parts["length"]) & 0xFFFF)
        body = head + (parts["header_check"] or check) + parts["length"] + parts["payload"]
        return body + (parts["crc"] or struct.pack("<I", zlib.crc32(body)))

    return edit


def table(n_groups: int, **changes: bytes) -> Edit:
    """Edit the fields of a segment; its table_crc is made anew unless it is given."""

    def edit(payload: bytes) -> bytes:
        found = parse_stream_table(payload, StreamCounts(n_groups, 1))
        header, n_streams = found.header, len(found.lengths)
        marked = sum(1 << i for i, length in enumerate(found.lengths) if length)
        parts = {
            "signal": varint(header.signal),
            "first_frame": varint(header.first),
            "n_frames": varint(header.n_frames),
            "lead": varint(header.lead),
            "tail": varint(header.tail),
            "flags": bytes((header.flags,)),
            "present": marked.to_bytes((n_streams + 7) // 8, "little"),
            "lengths": b"".join(varint(length) for length in found.lengths if length),
            "table_crc": b"",
            "streams": payload[found.size :],
        } | changes
        streams, crc = parts.pop("streams"), parts.pop("table_crc")
        head = b"".join(parts.values())
        return head + (crc or struct.pack("<I", zlib.crc32(head))) + streams

    return edit


def stream(index: int, edit: Callable[[bytes], bytes], *, segment: int = 0) -> Callable[[Any], Any]:
    """Edit stream ``index`` of a segment."""

    def edit_segments(made: Made) -> Any:
        header, streams = made[segment]
        changed = [edit(s) if i == index else s for i, s in enumerate(streams)]
        return [*made[:segment], (header, changed), *made[segment + 1 :]]

    return edit_segments


def headed(index: int, **changes: int) -> Callable[[Any], Any]:
    """Edit the header of segment ``index``."""

    def edit_segments(made: Made) -> Any:
        header, streams = made[index]
        return [*made[:index], (replace(header, **changes), streams), *made[index + 1 :]]

    return edit_segments


def raw_stream(ordinals: Sequence[Sequence[int]], widths: Sequence[int]) -> bytes:
    """A stream of raw: ``ordinals`` channel by channel, in offsets of ``widths`` bytes."""
    out = b""
    for column, width in zip(ordinals, widths, strict=True):
        least = min(column)
        out += (least % 2**64).to_bytes(8, "little") + bytes((width,))
        out += b"".join((o - least).to_bytes(width, "little") for o in column)
    return out


def indexed(**changes: Any) -> Callable[[Any], Any]:
    """Edit INDX so that it agrees with the edited clip."""
    return lambda row: replace(row, **changes)
