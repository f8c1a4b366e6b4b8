"""Directory of a file, built by the writer, by a scan, or from INDX; and the records of INDX.

SPEC.md, "INDX", has the tables of the records; ``index.py`` and ``index_reader.py`` convert them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, MutableMapping, Sequence
from copy import copy
from dataclasses import dataclass, fields
from dataclasses import field as slot

from construct import GreedyBytes, If, Int8ul, Int32ul, this

from mcz.container import payloads
from mcz.container.chunks import HEADER, Chunk, ChunkType
from mcz.container.payloads import ID, OF_ATTACHMENT, OF_CLIP, OF_SKELETON
from mcz.container.segments import SegmentHeader
from mcz.errors import FormatError
from mcz.model.schema import (
    EXTENSION,
    MAX_COUNT,
    POSITIVE,
    SIZED,
    TEXT,
    UVARINT,
    Exactly,
    Record,
    Table,
    columns,
    counted,
    field,
    flags,
    one_of,
)
from mcz.model.schema.types import as_construct

CONTINUES = 1


class PreviousIndex(Record):
    """The INDX that another one continues."""

    offset: int = field(UVARINT, "offset of the chunk")
    length: int = field(UVARINT, "bytes of the whole chunk")
    crc: int = field(Int32ul, "its crc")

    @property
    def stop(self) -> int:
        """The offset after it."""
        return self.offset + self.length


class Indx(Record):
    """INDX, a cache of the contents of a file and their places."""

    flags: int = field(flags("continues"), "bit 0: continues an INDX before it", default=0)
    previous: PreviousIndex | None = field(
        If(this.flags & CONTINUES, as_construct(PreviousIndex)),
        "the one that it continues",
        default=None,
    )
    size: int = field(UVARINT, "bytes of the index, inflated")
    data: bytes = field(GreedyBytes, "the index, as raw deflate")


class IndexedChunk(Record):
    """A SKEL, MODL or SRCE in INDEX."""

    type: bytes = field(Exactly(4), "chunk type")
    id: bytes = field(ID, "id of the chunk")
    gap: int = field(UVARINT, "bytes to the chunk from the end of the one before")
    length: int = field(UVARINT, "bytes of its payload")


class IndexedAttachment(Record):
    """An attached file in INDEX."""

    name: str = field(TEXT, "relative path of the attached file")
    size: int = field(UVARINT, "bytes of the whole file")
    n_parts: int = field(POSITIVE, "its ATTA chunks, at least 1")


class IndexedAlias(Record):
    """An ALIA in INDEX."""

    name: str = field(TEXT, "as in ALIA")
    of: int = field(one_of(Int8ul, (OF_CLIP, OF_SKELETON, OF_ATTACHMENT)), "as in ALIA")
    target: bytes = field(SIZED, "as in ALIA")


class IndexedClip(Record):
    """A clip in INDEX."""

    name: str = field(TEXT, "name of the clip")
    skeleton: int = field(UVARINT, "index in skeletons")
    n_frames: int = field(UVARINT, "frames")
    rate_numerator: int = field(UVARINT, "frame rate, numerator; 0: unknown")
    rate_denominator: int = field(POSITIVE, "frame rate, denominator")
    n_signals: int = field(POSITIVE, "its signals, at least 1")
    gap: int = field(UVARINT, "bytes to CLIP from the end of the CEND before")
    length: int = field(UVARINT, "bytes of the payload of CLIP")
    n_segments: int = field(UVARINT, "its segments")
    cend_gap: int = field(UVARINT, "bytes to CEND from the end of the last segment, or of CLIP")
    cend_length: int = field(UVARINT, "bytes of the payload of CEND")
    n_ancillary: int = field(UVARINT, "ancillary chunks between CEND and the next clip")


class IndexedSignal(Record):
    """A signal in INDEX."""

    n_channels: int = field(UVARINT, "channels")
    samples_per_frame: int = field(UVARINT, "rows a frame")
    skip: int = field(UVARINT, "as in CLIP")
    spare: int = field(UVARINT, "as in CLIP")
    codec: int = field(UVARINT, "codec id")
    preset: int = field(UVARINT, "as in CLIP")
    codec_version: int = field(UVARINT, "codec version")


class IndexedSegment(Record):
    """A segment in INDEX."""

    gap: int = field(UVARINT, "bytes to the payload from the end of the payload before, or of CLIP")
    size: int = field(UVARINT, "bytes of the payload")
    signal: int = field(UVARINT, "index of the signal")
    n_frames: int = field(UVARINT, "frames")
    lead: int = field(UVARINT, "as in DATA")
    tail: int = field(UVARINT, "as in DATA")
    flags: int = field(UVARINT, "as in DATA, plus 64 for a packet of kind 1, 32 for one of kind 2")


class IndexedPlace(Record):
    """An ATTA or ancillary chunk in INDEX."""

    type: bytes = field(Exactly(4), "chunk type")
    gap: int = field(UVARINT, "bytes to the chunk from the end of the one before, or of CEND")
    length: int = field(UVARINT, "bytes of its payload")


class Index(Record):
    """The content of INDX, inflated."""

    head: bytes = field(SIZED, "payload of HEAD")
    shared: Table[IndexedChunk] = field(
        columns(IndexedChunk), "SKEL, MODL and SRCE chunks, the first of each id"
    )
    attachments: Table[IndexedAttachment] = field(columns(IndexedAttachment), "attached files")
    parts: Table[IndexedPlace] = field(columns(IndexedPlace), "the ATTA of all attached files")
    aliases: Table[IndexedAlias] = field(columns(IndexedAlias), "aliases")
    skeletons: list[bytes] = field(counted(ID), "ids of the SKEL of clips, each once")
    clips: Table[IndexedClip] = field(columns(IndexedClip), "the clips")
    signals: Table[IndexedSignal] = field(columns(IndexedSignal), "the signals of all clips")
    segments: Table[IndexedSegment] = field(columns(IndexedSegment), "the segments of all clips")
    n_behind: int = field(UVARINT, "of `ancillary`, how many belong to the last clip of `previous`")
    ancillary: Table[IndexedPlace] = field(
        columns(IndexedPlace), "the ancillary chunks of all clips"
    )
    extension: bytes = field(EXTENSION, "ignored", default=b"")


@dataclass(frozen=True, slots=True)
class SegmentRow:
    """One segment: the place of its payload, and its frames.

    ``packet`` is the kind of its packet, 0 for a closed DATA. The payload of a packet of kind 2 is
    a stream without a table; ``mask_row`` is the segment with its mask, None without one.
    """

    offset: int
    size: int
    header: SegmentHeader
    packet: int = 0
    mask_row: SegmentRow | None = None

    @property
    def stop(self) -> int:
        return self.offset + self.size

    def chunk(self) -> Chunk:
        """The closed DATA chunk around the payload."""
        if self.packet:
            raise FormatError(f"the segment at {self.offset} is a packet, not a chunk")
        return Chunk(ChunkType.DATA, 0, self.offset - HEADER.size, self.size)


@dataclass(frozen=True, slots=True)
class SignalRow:
    """A signal, with the fields of an IndexedSignal in their order."""

    n_channels: int
    samples_per_frame: int
    skip: int  # stored frames before the first that the clip shows
    spare: int  # stored frames after the last
    codec: int
    preset: int
    codec_version: int

    @classmethod
    def of(cls, signal: payloads.Signal, clip: payloads.Clip, where: str) -> SignalRow:
        """The row of a signal of CLIP; raises FormatError."""
        cut = signal.skip, signal.spare
        if clip.flags & payloads.OPEN_CLIP and any(cut):  # CLIP-19
            raise FormatError(f"skip and spare are {cut}, but n_frames is open", where=where)
        if sum(cut) + clip.n_frames > MAX_COUNT:  # CLIP-20
            raise FormatError(
                f"skip and spare {cut} exceed the {clip.n_frames} frames", where=where
            )
        n_channels = sum(run.n_channels for run in signal.grids)
        codec = signal.codec, signal.preset, signal.codec_version
        return cls(n_channels, signal.samples_per_frame, *cut, *codec)

    def stored(self, n_frames: int) -> int:
        """The frames that the segments of the signal cover in a clip of ``n_frames``."""
        return self.skip + n_frames + self.spare


def signal_rows(clip: payloads.Clip, where: str) -> tuple[SignalRow, ...]:
    """The rows of the signals of CLIP; raises FormatError."""
    return tuple(SignalRow.of(signal, clip, where) for signal in clip.signals)


# The segments of an indexed clip, each the fields of an IndexedSegment in their order.
Packed = Sequence[tuple[int, ...]]
Place = tuple[int, int, int, int]  # offset and bytes of CLIP, and those of CEND


@dataclass(slots=True, eq=False)
class ClipRow:
    """A clip as listed; its CLIP and CEND contain more."""

    name: str
    skeleton: bytes
    n_frames: int
    rate_numerator: int
    rate_denominator: int
    signals: tuple[SignalRow, ...]
    clip: Chunk
    segments: list[SegmentRow] = slot(default_factory=list)
    cend: Chunk | None = None
    ancillary: list[Chunk] = slot(default_factory=list)
    damage: list[str] = slot(default_factory=list)

    @classmethod
    def of(cls, fields: payloads.Clip, chunk: Chunk) -> ClipRow:
        """The row of a clip from its CLIP alone; raises FormatError."""
        rate = fields.rate_numerator, fields.rate_denominator
        signals = signal_rows(fields, chunk.label)
        return cls(fields.name, fields.skeleton, fields.n_frames, *rate, signals, chunk)

    @property
    def packed(self) -> Packed | None:
        """The segments as in an index, while they are not unpacked."""
        return None

    def __eq__(self, other: object) -> bool:
        """Compare contents, packed or not."""
        if not isinstance(other, ClipRow):
            return NotImplemented
        return all(getattr(self, f.name) == getattr(other, f.name) for f in fields(ClipRow))

    __hash__ = None  # type: ignore[assignment]  # it changes

    def frames_found(self, stops: Sequence[int]) -> int:
        """The frames that it shows without CEND: up to the last segment of each signal."""
        n_frames = 0
        for stop, row in zip(stops, self.signals, strict=True):
            most = self.n_frames if row.skip or row.spare else stop  # the later ones are spare
            n_frames = max(n_frames, min(stop - row.skip, most))
        return n_frames


class PackedClipRow(ClipRow):
    """A row of an index, whose ``segments`` stay packed until first use.

    They raise FormatError if the index is wrong.
    """

    __slots__ = ("_pack", "_segments", "_unpack")

    def keep_packed(
        self, pack: Callable[[], Packed], unpack: Callable[[ClipRow, Packed], list[SegmentRow]]
    ) -> None:
        """Unpack segments on first use by ``unpack``, from the result of ``pack``."""
        self._pack: Callable[[], Packed] | None = pack
        self._unpack = unpack

    @property
    def packed(self) -> Packed | None:
        return None if self._pack is None else self._pack()

    @property
    def segments(self) -> list[SegmentRow]:
        if self._pack is not None:
            self._segments = self._unpack(self, self._pack())
            self._pack = None
        return self._segments

    @segments.setter
    def segments(self, segments: list[SegmentRow]) -> None:
        self._segments, self._pack = segments, None


class ClipRows(MutableMapping[str, ClipRow]):
    """Rows by name, in file order; rows of an index are created on first use.

    ``make`` creates a row by its number, ``groups_with`` lists the numbers of clips with a type of
    ancillary chunks, and ``listed`` has the place of each, see ``places``.
    """

    def __init__(
        self,
        names: Iterable[str] = (),
        make: Callable[[int], ClipRow] | None = None,
        having: Callable[[bytes], Collection[int]] | None = None,
        listed: Callable[[], Sequence[Place]] = tuple,
    ) -> None:
        self._rows: dict[str, ClipRow | int] = {name: n for n, name in enumerate(names)}
        self._make, self._having, self._listed = make, having, listed

    def __getitem__(self, name: str) -> ClipRow:
        row = self._rows[name]
        if isinstance(row, int):
            assert self._make is not None
            row = self._rows[name] = self._make(row)
        return row

    def __setitem__(self, name: str, row: ClipRow) -> None:
        self._rows[name] = row

    def __delitem__(self, name: str) -> None:
        del self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __reversed__(self) -> Iterator[str]:
        return reversed(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    @property
    def last(self) -> ClipRow | None:
        """The row of the last clip, None without one."""
        name = next(reversed(self._rows), None)
        return None if name is None else self[name]

    def copy(self) -> ClipRows:
        """A copy to which rows can be added."""
        twin = copy(self)
        twin._rows = dict(self._rows)
        return twin

    def ancillary(self, kind: bytes) -> list[Chunk]:
        """The ancillary chunks of a type; no other rows are created."""
        few = set(self._having(kind)) if self._having is not None else ()
        names = [n for n, row in self._rows.items() if not isinstance(row, int) or row in few]
        return [chunk for name in names for chunk in self[name].ancillary if chunk.type == kind]

    def places(self) -> Iterator[tuple[str, int, int, int, int]]:
        """Name and place of each clip; no rows are created."""
        listed = self._listed()
        for name, row in self._rows.items():
            if isinstance(row, int):
                yield name, *listed[row]
            else:
                cend = (row.cend.offset, row.cend.size) if row.cend else (0, 0)
                yield name, row.clip.offset, row.clip.size, *cend


@dataclass(slots=True)
class AttachmentRow:
    name: str
    size: int
    parts: list[Chunk]


@dataclass(frozen=True, slots=True)
class IndexPlace:
    """An INDX of a file, and the number of things up to its end.

    ``n_bytes`` of its content indicate how much it lists alone.
    """

    chunk: PreviousIndex  # how one that continues it names it
    n_bytes: int
    n_shared: int
    n_attachments: int
    n_aliases: int
    n_clips: int


@dataclass(slots=True)
class Directory:
    """Everything in a file by name or id. ``end`` is the offset after the last FOOT.

    ``indexes``: the INDX chunks that it was read from; each continues the previous one.
    """

    head: bytes = b""
    shared: dict[tuple[bytes, bytes], Chunk] = slot(default_factory=dict)
    attachments: dict[str, AttachmentRow] = slot(default_factory=dict)
    aliases: dict[str, tuple[int, bytes]] = slot(default_factory=dict)
    clips: ClipRows = slot(default_factory=ClipRows)
    end: int = 0
    indexes: tuple[IndexPlace, ...] = slot(default=(), compare=False)

    def ids(self, kind: bytes) -> list[bytes]:
        """The ids of its SKEL, MODL or SRCE, in file order."""
        return [id_ for of, id_ in self.shared if of == kind]

    @property
    def index_bytes(self) -> int:
        """Bytes of the INDX chunks that it was read from."""
        return sum(place.chunk.length for place in self.indexes)
