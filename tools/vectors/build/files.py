"""Files made to order: a Writer whose payloads can be edited before they are framed and hashed.

Every edit comes before checksums, ids, hashes and INDX are made, so a file has the one fault that
was put into it and no other.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mcz.codecs import raw
from mcz.codecs.contract import Codec, Request, Span, model_finder
from mcz.container import payloads
from mcz.container.chunks import (
    CHECK_SIZE,
    END,
    FRAME,
    HEADER,
    REPEATED,
    SEGMENT,
    SIGNATURE,
    Chunk,
    ChunkFlag,
    ChunkType,
    Packet,
    build_chunk,
    build_foot,
    build_packet,
    implied_by,
    parse_chunk_header,
)
from mcz.container.directory import CONTINUES, AttachmentRow, ClipRow, Index, Indx, SegmentRow
from mcz.container.index import index_record
from mcz.container.index_reader import index_name, place_of
from mcz.container.limits import BASE, FORMAT_NAME, Profile
from mcz.container.model_records import canonical, value_hash
from mcz.container.segments import FRESH, MASKS, SegmentHeader, build_segment, mask_of
from mcz.container.writer import Writer
from mcz.files.writing.clip_writer import ClipCopy, Decoded, write_plan
from mcz.files.writing.planning import Prepared, SignalPlan, plan_clip
from mcz.model.motion import Channel, Joint, Motion, Signal, Skeleton
from mcz.model.schema import deflate, parse, varint
from tools.records import build_record, id_of, update
from tools.vectors.build.edits import Edit, Made, put

OK, REFUSED, UNSUPPORTED = 0, 1, 3


@dataclass(frozen=True, slots=True)
class Vector:
    """One file and what a decoder must make of it.

    ``name`` is its path below vectors/ without the suffix; ``arrays`` are rows of the contract
    with the bytes behind them, ``sources`` pairs of path and bytes; ``modes`` are the calls that
    are made: "arrays", "sources". ``parts`` are (arguments, arrays) of partial reads. ``seed``
    is that of a file made at random, ``since`` the version of the format that first had it.
    ``is_crafted``: its sources were made for a reader, and an encoder may refuse them.
    """

    name: str
    spec: tuple[str, ...]
    purpose: str
    data: bytes
    exit: tuple[int, ...] = (OK,)
    arrays: tuple[tuple[dict[str, Any], bytes], ...] = ()
    sources: tuple[tuple[str, bytes], ...] = ()
    modes: tuple[str, ...] = ("arrays",)
    parts: tuple[tuple[tuple[str, ...], tuple[tuple[dict[str, Any], bytes], ...]], ...] = ()
    seed: int | None = None
    since: str = FORMAT_NAME
    is_crafted: bool = False


class _Unchecked(ClipCopy):
    """The values that a codec decodes of streams a reader may refuse; of a lossless one its own."""

    def __init__(self, profile: Profile) -> None:
        super().__init__(profile)
        self._segments: dict[int, list[tuple[SegmentHeader, Sequence[bytes]]]] = {}

    def segment(self, header: SegmentHeader, streams: Sequence[bytes]) -> None:
        self._segments.setdefault(header.signal, []).append((header, streams))

    def decoded(self, motion: Motion, coded: Sequence[SignalPlan]) -> list[Decoded]:
        signals = []
        for index, (part, signal) in enumerate(zip(coded, motion.signals, strict=True)):
            free, segments = part.lossy_channels(), self._segments.get(index, [])
            values = signal.values
            if free.any():
                values = np.array(values, np.float64)
                groups = [g for g in part.source.layout.groups if free[list(g)].any()]
                values[:, [c for g in groups for c in g]] = _lossy(part, segments, free)
            signals.append(Decoded(values, value_hash(values, signal.mask)))
        return signals


def _lossy(
    part: SignalPlan, segments: Sequence[tuple[SegmentHeader, Sequence[bytes]]], free: Any
) -> Any:
    encoded, layout = part.encoded, part.source.layout
    models = model_finder((*encoded.models, *encoded.known_models))
    layout = replace(layout, n_resolutions=encoded.n_resolutions, find_model=models)
    spans = [Span(h.first, h.n_frames, h.lead, h.tail, bool(h.flags & FRESH)) for h, _ in segments]
    n_groups = len(layout.groups)
    groups = tuple(g for g, group in enumerate(layout.groups) if free[list(group)].any())
    own = n_groups * encoded.n_resolutions  # behind notes and masks
    return part.codec.decode(
        encoded.header,
        layout,
        spans,
        Request(0, layout.n_frames, groups),
        lambda segment, resolution, group: segments[segment][1][-own:][
            resolution * n_groups + group
        ],
    )


class Crafter(Writer):
    """A Writer whose ``edits`` change what it writes.

    A chunk type names an edit of its payload, TYPE_frame one of its whole bytes. "table" changes
    the fields of INDEX, "FOOT" edits its 32 bytes, "row" the ClipRow behind INDX, "segments" the
    list of (header, streams) of a clip. ``packets``: segments go into an open DATA; "packet" and
    "end_packet" edit their bytes. ``frames``: those of signal 0 from this number on that have one
    stream beside the mask of those before are packets of kind 2. ``anew``: a segment that starts
    fresh begins an open DATA. ``repeat``: a REPT, which "REPT" edits, precedes the open DATA of
    these numbers, from 0. ``continued``: each INDX continues the one before. ``extension`` is that
    of segments whose flags say that they have one.
    """

    def __init__(
        self,
        *,
        packets: bool = False,
        frames: int | None = None,
        anew: bool = False,
        repeat: Collection[int] = (),
        profile: Profile = BASE,
        **edits: Callable[..., Any],
    ) -> None:
        self.edits = edits
        self.extension = b""
        self.anew = anew
        self.repeat = repeat
        self.continued = False
        self._n_data = 0
        self.packets = packets
        self.frames = frames
        self._made: Made = []
        self._sink_bytes = io.BytesIO()
        super().__init__(self._sink_bytes, profile=profile)

    def _write_head(self, extension: bytes) -> None:
        super()._write_head(extension)
        self.directory.head = self.apply_edit("HEAD", self.directory.head)

    @property
    def data(self) -> bytes:
        return self._sink_bytes.getvalue()

    def apply_edit(self, name: str, value: Any) -> Any:
        edit = self.edits.get(name)
        return edit(value) if edit else value

    def chunk(self, kind: bytes, payload: bytes, flags: int = 0) -> Chunk:
        return self.plain_chunk(kind, self.apply_edit(kind.decode(), payload), flags)

    def plain_chunk(self, kind: bytes, payload: bytes, flags: int = 0) -> Chunk:
        """A chunk whose payload is edited already."""
        chunk = Chunk(kind, flags, self.offset, len(payload))
        name = kind.decode("latin-1") + "_frame"
        self._write(self.apply_edit(name, build_chunk(kind, payload, flags)))
        return chunk

    def shared(self, kind: bytes, payload: bytes) -> bytes:
        payload = self.apply_edit(kind.decode(), payload)
        id_ = id_of(kind, payload)
        if (kind, id_) not in self.directory.shared:
            self.directory.shared[kind, id_] = self.plain_chunk(kind, payload)
        return id_

    def clip(
        self, motion: Motion, *, grouping: str = "joint", codec: Codec = raw.CODEC, **params: Any
    ) -> None:
        """Write ``motion`` with the raw codec, or another, without a quality record."""
        plan = plan_clip(Prepared(motion), replace(codec, grouping=grouping), params, self.profile)
        write_plan(self, plan, quality=False, copy=_Unchecked(self.profile))

    def parts(self, name: str, *pieces: bytes) -> None:
        """Write an attachment in these parts, each stored or deflated, whichever is shorter."""
        whole = b"".join(pieces)
        digest = hashlib.sha256(whole).digest()
        common = {"name": name, "n_parts": len(pieces), "size": len(whole), "sha256": digest}
        row = AttachmentRow(name, len(whole), [])
        for part, piece in enumerate(pieces):
            packed = deflate(piece)
            shorter = len(packed) < len(piece)
            fields = {"part": part, "part_size": len(piece), "flags": int(shorter)}
            fields["data"] = packed if shorter else piece
            row.parts.append(
                self.chunk(b"ATTA", build_record(payloads.Atta, common | fields, name))
            )
        self.directory.attachments[name] = row

    def segment(
        self, header: SegmentHeader, streams: Sequence[bytes], extension: bytes = b""
    ) -> None:
        self._made.append((header, streams))

    def end_clip(self, n_frames: int, source_sha256: bytes, value_sha256: Sequence[bytes]) -> None:
        made, self._made = self.apply_edit("segments", self._made), []
        opening = self._repeated_chunks() if self.repeat else b""
        if self.packets:
            self._begin_data(opening)
        for header, streams in made:
            if self.anew and header.flags & 1 and self._next_packet:
                self.close_data()
                self._begin_data(opening)
            if self._is_frame(header, streams):
                self._frame(header, streams[-1])
                continue
            payload = self.apply_edit("DATA", build_segment(header, streams, self.extension))
            self._segment(header, payload)
        row = self._clip
        super().end_clip(n_frames, source_sha256, value_sha256)
        assert row is not None
        self.directory.clips[row.name] = self.apply_edit("row", row)

    def _repeated_chunks(self) -> bytes:
        """Content of a REPT in a file of one clip."""
        data, at, repeated = self.data, len(SIGNATURE), b""
        while at < len(data):
            chunk = parse_chunk_header(data[at : at + HEADER.size], at)
            repeated += data[at : at + chunk.size] if chunk.type in REPEATED else b""
            at += chunk.size
        return repeated

    def _begin_data(self, opening: bytes) -> None:
        if self._n_data in self.repeat:
            self.chunk(ChunkType.REPT, opening, ChunkFlag.ANCILLARY)
        self._n_data += 1
        self.open_data()

    def _is_frame(self, header: SegmentHeader, streams: Sequence[bytes]) -> bool:
        number = self._next_packet
        short = self.frames is not None and number is not None and number >= self.frames
        return short and self._implies_rest(header, streams)

    def _implies_rest(self, header: SegmentHeader, streams: Sequence[bytes]) -> bool:
        """True where a packet of kind 2 would say the same as this segment."""
        before, others = self._implying, header.flags & ~(FRESH | MASKS)
        if header.signal or header.n_frames > 1 or header.lead or header.tail or others:
            return False
        if before is None or not before[0].header.flags & MASKS:
            return len(streams) == 1 and not header.flags & MASKS
        same = header.flags & MASKS and before[0].header.n_frames == 1 and len(streams) == 2
        return bool(same) and streams[0] == mask_of(before[1])

    def _frame(self, header: SegmentHeader, stream: bytes) -> None:
        clip: ClipRow | None = self._clip
        assert clip is not None
        assert self._next_packet is not None
        packet_mask, segment = self._implying or (None, b"")
        mask = mask_of(segment) if segment else b""
        implied = implied_by(header.first, mask)
        made = Packet(FRAME, self._next_packet, stream, bool(header.flags & FRESH), implied)
        packet = build_packet(made)
        at = self.offset + len(packet) - CHECK_SIZE - len(stream)
        packet_mask = packet_mask if header.flags & MASKS else None
        clip.segments.append(SegmentRow(at, len(stream), header, made.kind, packet_mask))
        self._write(self.apply_edit("packet", packet))
        self._next_packet += 1

    def _segment(self, header: SegmentHeader, payload: bytes) -> None:
        clip: ClipRow | None = self._clip
        assert clip is not None
        if self._next_packet is None:
            chunk = self.plain_chunk(b"DATA", payload)
            row = SegmentRow(chunk.payload_offset, len(payload), header)
        else:
            packet = Packet(SEGMENT, self._next_packet, payload, bool(header.flags & 1))
            data = build_packet(packet)
            at = self.offset + len(data) - CHECK_SIZE - len(payload)
            row = SegmentRow(at, len(payload), header, SEGMENT)
            self._write(self.apply_edit("packet", data))
            self._next_packet += 1
            if header.signal == 0:
                self._implying = row, payload
        clip.segments.append(row)

    def close_data(self) -> None:
        assert self._next_packet is not None
        self._write(
            self.apply_edit("end_packet", build_packet(Packet(END, self._next_packet, b"")))
        )
        self._next_packet = None

    def finish(self, *, index: bool = True) -> None:
        start, length = 0, 0
        if index:
            chunk = self.apply_edit("INDX_frame", self._index_chunk())
            start, length = self.offset, len(chunk)
            if self.continued:
                self.directory.indexes += (place_of(index_name(chunk, start), 0, self.directory),)
            self._write(chunk)
        self._write(self.apply_edit("FOOT", build_foot(start, length)))

    def _index_chunk(self) -> bytes:
        since = self.directory.indexes[-1] if self.directory.indexes else None
        fields = index_record(self.directory, since)
        self.apply_edit("table", fields)
        content = build_record(Index, fields, "INDX")
        packed = {"size": len(content), "data": deflate(content)}
        if since is not None:
            packed |= {"flags": CONTINUES, "previous": since.chunk}
        payload = self.apply_edit("INDX", build_record(Indx, packed, "INDX"))
        return build_chunk(b"INDX", payload, ChunkFlag.ANCILLARY)


def file_of(
    *motions: Motion,
    index: bool = True,
    packets: bool = False,
    frames: int | None = None,
    anew: bool = False,
    repeat: Collection[int] = (),
    grouping: str = "joint",
    segment_frames: int = 0,
    codec: Codec = raw.CODEC,
    **edits: Any,
) -> bytes:
    """A file of these clips, edited; a segment has all frames unless ``segment_frames`` says it."""
    live: dict[str, Any] = {"packets": packets, "frames": frames}
    crafter = Crafter(**live, anew=anew, repeat=repeat, **edits)
    for motion in motions:
        crafter.clip(motion, grouping=grouping, codec=codec, segment_frames=segment_frames)
    return finish_file(crafter, index=index)


def finish_file(crafter: Crafter, *motions: Motion, index: bool = True) -> bytes:
    """The file of ``crafter`` with these clips added."""
    for motion in motions:
        crafter.clip(motion)
    crafter.finish(index=index)
    return crafter.data


def rehash(*signals: np.ndarray) -> Edit:
    """Put the hashes of these canonical arrays into CEND."""
    hashes = [hashlib.sha256(canonical(values)).digest() for values in signals]
    return put(payloads.Cend, "value_sha256", varint(len(hashes)) + b"".join(hashes))


def arrays(*motions: Motion) -> tuple[tuple[dict[str, Any], bytes], ...]:
    """The canonical arrays of these clips, as the contract lists them."""
    return tuple(part for motion in motions for part in _arrays(motion))


def _arrays(motion: Motion) -> Iterable[tuple[dict[str, Any], bytes]]:
    for signal in motion.signals:
        dtype = "<i8" if signal.values.dtype == np.int64 else "<f8"
        common = {"clip": motion.name, "signal": signal.name}
        shape = list(signal.values.shape)
        values = {"array": "values", "dtype": dtype, "shape": shape}
        yield common | values, canonical(signal.values)
        if signal.mask is not None and not signal.mask.all():
            mask = {"array": "mask", "dtype": "u1", "shape": shape}
            yield common | mask, signal.mask.astype("u1").tobytes()


@dataclass(slots=True)
class Shelf:
    """Collects vectors under one folder."""

    folder: str
    vectors: list[Vector] = field(default_factory=list)

    def add(self, name: str, spec: str, purpose: str, data: bytes, **rest: Any) -> None:
        """``spec``: headings of SPEC.md, separated by semicolons."""
        headings = tuple(heading.strip() for heading in spec.split(";"))
        self.vectors.append(Vector(f"{self.folder}/{name}", headings, purpose, data, **rest))


class Whole(Shelf):
    """A Shelf of files that must be decoded; its ``exit`` are the codes that are allowed."""

    def __init__(self, folder: str, exit: tuple[int, ...] = (OK,)) -> None:
        super().__init__(folder)
        self.exit = exit

    def hold(
        self, name: str, spec: str, purpose: str, data: bytes, *motions: Motion, **rest: Any
    ) -> None:
        """Add a file of these clips."""
        rest.setdefault("exit", self.exit)
        self.add(name, spec, purpose, data, arrays=arrays(*motions), **rest)


def partial(motion: Motion, frames: tuple[int, int], joints: Sequence[int] | None = None) -> Any:
    """Arguments and arrays of a partial read: of joints, or of all channels of all signals."""
    arguments = ("--clip", motion.name, "--frames", f"{frames[0]}:{frames[1]}")
    if joints is None:
        cut = [signal.cut(*frames) for signal in motion.signals]
        return arguments, arrays(replace(motion, signals=tuple(cut), frame_numbers=None))
    columns = [c for joint in joints for c in motion.skeleton.columns(joint)]
    signal, rows = motion.signals[0], slice(*frames)
    mask = signal.mask[rows][:, columns] if signal.mask is not None else None
    part = Signal(signal.values[rows][:, columns], mask=mask)
    names = tuple(Channel("", str(column)) for column in columns)
    bones = Skeleton((Joint("", channels=names),))
    listed = ",".join(map(str, joints))
    return (*arguments, "--joints", listed), arrays(Motion(bones, (part,), name=motion.name))


def attachment_file(stream: bytes, size: int, whole: bytes | None = None) -> bytes:
    """A file of one attachment, deflated to ``stream``; ``whole``: what it says that it is."""
    content = b"" if whole is None else whole

    def edit(payload: bytes) -> bytes:
        fields = parse(payloads.Atta, payload, "ATTA")
        update(fields, {"flags": 1, "size": size, "part_size": size, "data": stream})
        return build_record(payloads.Atta, fields, "ATTA")

    def row(fields: Any) -> Any:
        fields.attachments.numbers("size")[0] = size
        return fields

    crafter = Crafter(ATTA=edit, table=row)
    crafter.parts("a.bin", content)
    return finish_file(crafter)


def live_file(motion: Motion, **edits: Any) -> bytes:
    """The clip as a live one: packets of one frame, of kind 2 where that can be."""
    given = {"packets": True, "frames": 1, "segment_frames": 1, "grouping": "all"}
    return file_of(motion, **given | edits)
