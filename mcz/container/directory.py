"""What a file holds and where: built by the writer, by a scan, or from INDX.

SPEC.md, "INDX", is normative.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from mcz.container import payloads
from mcz.container.chunks import HEADER, Chunk, build_chunk
from mcz.container.limits import PROFILES, Profile, check
from mcz.container.packets import FRAME, NUMBERED, SEGMENT, SHORT
from mcz.container.segments import FRESH, SegmentHeader
from mcz.errors import FormatError, UnsupportedError
from mcz.schema import MAX_COUNT, build, deflate, inflate, parse, read_varint, varint

# Set in the indexed flags of a segment that is a packet of an open DATA, by the packet's kind.
PACKETS = {SEGMENT: 128, FRAME: 64, NUMBERED: 32}

# Each segment in the "segments" field of an indexed clip: (name, type, meaning).
INDEXED_SEGMENT_FIELDS = (
    ("gap", "varint", "bytes from the end of CLIP, or of the payload before, to this payload"),
    ("size", "varint", "bytes of the payload"),
    ("signal", "varint", "index of the signal"),
    ("n_frames", "varint", "frames"),
    ("lead", "varint", "as in DATA"),
    ("tail", "varint", "as in DATA"),
    (
        "flags",
        "varint",
        "as in DATA; more where it is a packet: 128 of kind 1, 64 of kind 2, 32 of 3",
    ),
)


@dataclass(frozen=True, slots=True)
class SegmentRow:
    """One segment: where its payload lies, and what it covers.

    ``packet`` is the kind of its packet, 0 where it is a closed DATA. The payload of a packet of
    kind 2 or 3 is a stream without a table.
    """

    offset: int
    size: int
    header: SegmentHeader
    packet: int = 0

    @property
    def stop(self) -> int:
        return self.offset + self.size

    def chunk(self) -> Chunk:
        """The closed DATA chunk around the payload."""
        if self.packet:
            raise FormatError(f"the segment at {self.offset} is a packet, not a chunk")
        return Chunk(b"DATA", 0, self.offset - HEADER.size, self.size)


@dataclass(frozen=True, slots=True)
class SignalRow:
    n_channels: int
    samples_per_frame: int
    codec: int
    codec_version: int
    skip: int = 0  # stored frames before the first that the clip shows
    spare: int = 0  # stored frames after the last

    def stored(self, n_frames: int) -> int:
        """The frames that the segments of the signal cover, where the clip has ``n_frames``."""
        return self.skip + n_frames + self.spare


def signal_rows(clip: Any, where: str) -> tuple[SignalRow, ...]:
    """What the index says of the signals, from the fields of CLIP; raises FormatError."""
    return tuple(_signal_row(fields, clip, where) for fields in clip.signals)


def _signal_row(fields: Any, clip: Any, where: str) -> SignalRow:
    cut = fields.skip, fields.spare
    if clip.flags & payloads.OPEN_CLIP and any(cut):  # CLIP-19
        raise FormatError(f"{where}: n_frames is open, but a signal has skip and spare {cut}")
    if sum(cut) + clip.n_frames > MAX_COUNT:  # CLIP-20
        raise FormatError(f"{where}: skip and spare {cut} of {clip.n_frames} frames")
    n_channels = sum(run.n_channels for run in fields.grids)
    codec = fields.codec, fields.codec_version
    return SignalRow(n_channels, fields.samples_per_frame, *codec, *cut)


@dataclass(slots=True)
class ClipRow:
    """A clip as a listing shows it; its CLIP and CEND say more."""

    name: str
    skeleton: bytes
    n_frames: int
    rate_numerator: int
    rate_denominator: int
    signals: tuple[SignalRow, ...]
    clip: Chunk
    segments: list[SegmentRow] = field(default_factory=list)
    cend: Chunk | None = None
    ancillary: list[Chunk] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)

    def frames_found(self, stops: Sequence[int]) -> int:
        """The frames that it shows without CEND: up to the last segment of each signal."""
        found = 0
        for stop, row in zip(stops, self.signals, strict=True):
            most = self.n_frames if row.skip or row.spare else stop  # those after are spare
            found = max(found, min(stop - row.skip, most))
        return found


@dataclass(slots=True)
class AttachmentRow:
    name: str
    size: int
    parts: list[Chunk]


@dataclass(slots=True)
class Directory:
    """Everything in a file by name or id. ``end`` is the offset after the last FOOT."""

    head: bytes = b""
    shared: dict[tuple[bytes, bytes], Chunk] = field(default_factory=dict)
    attachments: dict[str, AttachmentRow] = field(default_factory=dict)
    aliases: dict[str, tuple[int, bytes]] = field(default_factory=dict)
    clips: dict[str, ClipRow] = field(default_factory=dict)
    end: int = 0


def parse_head(payload: bytes) -> Profile:
    """The profile of the file; raises UnsupportedError where it needs a newer reader."""
    head = parse(payloads.HEAD, payload, "HEAD")
    ours = payloads.FORMAT_MAJOR, payloads.FORMAT_MINOR
    needed = head.needs_major, head.needs_minor  # HEAD-04
    if not payloads.LEAST_NEEDED <= needed <= ours:  # HEAD-01, HEAD-02, HEAD-03
        raise UnsupportedError(
            f"HEAD: the file needs format {needed[0]}.{needed[1]}, "
            f"this reader knows {ours[0]}.{ours[1]}"
        )
    if head.profile not in PROFILES:
        raise UnsupportedError(f"HEAD: profile {head.profile} is unknown")  # CONV-16
    return PROFILES[head.profile]


@dataclass(slots=True)
class Found:
    """The result of a scan."""

    directory: Directory = field(default_factory=Directory)
    chunks: list[Chunk] = field(default_factory=list)
    feet: list[int] = field(default_factory=list)  # offsets of the FOOTs
    damage: list[str] = field(default_factory=list)
    ends: dict[int, int] = field(default_factory=dict)  # of open DATA chunks, by their offsets
    # What salvage could not take in: its offset, and the chunk where its header is sound.
    broken: list[tuple[int, Chunk | None]] = field(default_factory=list)


def build_index(directory: Directory) -> bytes:
    """The whole INDX chunk."""
    content = build(payloads.INDEX, _index_fields(directory), "INDX")
    fields = {"size": len(content), "data": deflate(content)}
    return build_chunk(b"INDX", build(payloads.INDX, fields, "INDX"))


def _index_fields(directory: Directory) -> dict[str, Any]:
    return {
        "head": directory.head,
        "shared": [
            {"type": kind, "id": id_, **_place(chunk)}
            for (kind, id_), chunk in directory.shared.items()
        ],
        "attachments": [
            {"name": a.name, "size": a.size, "parts": [_place(part) for part in a.parts]}
            for a in directory.attachments.values()
        ],
        "aliases": [
            {"name": name, "of": of, "target": target}
            for name, (of, target) in directory.aliases.items()
        ],
        "clips": [_clip_fields(clip) for clip in directory.clips.values()],
        "extension": b"",
    }


def _place(chunk: Chunk) -> dict[str, int | None]:
    return {"offset": chunk.offset, "length": chunk.length}


def _clip_fields(clip: ClipRow) -> dict[str, Any]:
    if clip.cend is None:
        raise FormatError(f"clip {clip.name!r} has no CEND and cannot be indexed")
    segments, end = bytearray(), clip.clip.offset + clip.clip.size
    for row in clip.segments:
        header = row.header
        fields = (row.offset - end, row.size, header.signal, header.n_frames)
        flags = header.flags | PACKETS.get(row.packet, 0)
        segments += b"".join(map(varint, (*fields, header.lead, header.tail, flags)))
        end = row.stop
    return {
        "name": clip.name,
        "skeleton": clip.skeleton,
        "n_frames": clip.n_frames,
        "rate_numerator": clip.rate_numerator,
        "rate_denominator": clip.rate_denominator,
        "signals": [
            {
                "n_channels": s.n_channels,
                "samples_per_frame": s.samples_per_frame,
                "skip": s.skip,
                "spare": s.spare,
                "codec": s.codec,
                "codec_version": s.codec_version,
            }
            for s in clip.signals
        ],
        **_place(clip.clip),
        "segments": bytes(segments),
        "cend_gap": clip.cend.offset - end,
        "cend_length": clip.cend.length,
        "ancillary": [{"type": chunk.type, **_place(chunk)} for chunk in clip.ancillary],
    }


def parse_index(payload: bytes, limit: int) -> Directory:
    """The Directory in the payload of an INDX; ``limit`` bounds its inflated size."""
    outer = parse(payloads.INDX, payload, "INDX")
    check("INDX: inflated size", outer.size, limit)
    fields = parse(payloads.INDEX, inflate(outer.data, outer.size, "INDX"), "INDX")
    directory = Directory(head=fields.head)
    for row in fields.shared:
        key = row.type, row.id
        if key in directory.shared:
            raise FormatError(f"INDX: two entries of {row.type!r} have the id {row.id.hex()}")
        directory.shared[key] = Chunk(row.type, 0, row.offset, row.length)
    for row in fields.attachments:
        parts = [Chunk(b"ATTA", 0, part.offset, part.length) for part in row.parts]
        if not parts:
            raise FormatError(f"INDX: attachment {row.name!r} has no part")
        _add(directory.attachments, row.name, AttachmentRow(row.name, row.size, parts))
    for row in fields.aliases:
        _add(directory.aliases, row.name, (row.of, row.target))
    for row in fields.clips:
        _add(directory.clips, row.name, _parse_clip(row))
    return directory


def _add(table: dict[str, Any], name: str, row: Any) -> None:
    if name in table:
        raise FormatError(f"INDX: two entries are named {name!r}")
    table[name] = row


def _parse_clip(row: Any) -> ClipRow:
    clip = Chunk(b"CLIP", 0, row.offset, row.length)
    signals = tuple(
        SignalRow(s.n_channels, s.samples_per_frame, s.codec, s.codec_version, s.skip, s.spare)
        for s in row.signals
    )
    if not signals:
        raise FormatError(f"INDX: clip {row.name!r} has no signal")
    # INDX-01
    segments = list(_parse_segments(row.segments, clip.offset + clip.size, len(signals), row.name))
    end = segments[-1].stop if segments else clip.offset + clip.size
    cend = Chunk(b"CEND", 0, end + row.cend_gap, row.cend_length)
    rate = row.rate_numerator, row.rate_denominator
    ancillary = [Chunk(a.type, 1, a.offset, a.length) for a in row.ancillary]
    return ClipRow(
        row.name, row.skeleton, row.n_frames, *rate, signals, clip, segments, cend, ancillary
    )


def _parse_segments(data: bytes, end: int, n_signals: int, name: str) -> Iterable[SegmentRow]:
    at, first = 0, [0] * n_signals
    while at < len(data):
        fields = []
        for _ in INDEXED_SEGMENT_FIELDS:
            value, at = read_varint(data, at)
            fields.append(value)
        gap, size, signal, n_frames, lead, tail, flags = fields
        if signal >= n_signals:
            raise FormatError(f"INDX: clip {name!r} has a segment of signal {signal}")
        kind = next((kind for kind, bit in PACKETS.items() if flags & bit), 0)
        header = SegmentHeader(
            signal, first[signal], n_frames, lead, tail, flags & ~PACKETS.get(kind, 0)
        )
        if kind in SHORT and header != SegmentHeader(0, first[0], 1, flags=header.flags & FRESH):
            raise FormatError(f"INDX: clip {name!r} has {header} as a packet of kind {kind}")
        yield SegmentRow(end + gap, size, header, kind)
        first[signal] += n_frames
        end += gap + size
