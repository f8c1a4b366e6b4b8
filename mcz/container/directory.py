"""Directory of a file: built by the writer, by a scan, or from INDX (``index.py``)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, MutableMapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields

from mcz.container import payloads
from mcz.container.chunks import HEADER, Chunk, ChunkType
from mcz.container.index_records import PreviousIndex
from mcz.container.limits import PROFILES, Profile
from mcz.container.segments import SegmentHeader
from mcz.errors import FormatError, UnsupportedError
from mcz.model.schema import MAX_COUNT, parse, parse_shared


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
            raise FormatError(
                f"n_frames is open, but a signal has skip and spare {cut}", where=where
            )
        if sum(cut) + clip.n_frames > MAX_COUNT:  # CLIP-20
            raise FormatError(f"skip and spare {cut} of {clip.n_frames} frames", where=where)
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
    segments: list[SegmentRow] = field(default_factory=list)
    cend: Chunk | None = None
    ancillary: list[Chunk] = field(default_factory=list)
    damage: list[str] = field(default_factory=list)

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
        """Compare contents, one of them perhaps packed."""
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

    They raise FormatError where the index is wrong.
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

    ``make`` creates a row by its number, ``having`` lists the numbers of clips with a type of
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
        """The same rows, to be added to."""
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

    ``indexes``: the INDX that it was read from, each of which continues the one before.
    """

    head: bytes = b""
    shared: dict[tuple[bytes, bytes], Chunk] = field(default_factory=dict)
    attachments: dict[str, AttachmentRow] = field(default_factory=dict)
    aliases: dict[str, tuple[int, bytes]] = field(default_factory=dict)
    clips: ClipRows = field(default_factory=ClipRows)
    end: int = 0
    indexes: tuple[IndexPlace, ...] = field(default=(), compare=False)

    @property
    def index_bytes(self) -> int:
        """Bytes of the INDX chunks that it was read from."""
        return sum(place.chunk.length for place in self.indexes)


def parse_head(payload: bytes) -> Profile:
    """The profile of the file; raises UnsupportedError where it needs a newer reader."""
    head = parse(payloads.Head, payload, "HEAD")
    if head.profile not in PROFILES:
        raise UnsupportedError(f"HEAD: profile {head.profile} is unknown")  # CONV-16
    return PROFILES[head.profile]


def parse_clip(payload: bytes, head: bytes, where: str, *, shared: bool = False) -> payloads.Clip:
    """The fields of CLIP, which must not need more than ``head``, the payload of HEAD, states.

    With ``shared`` clips with equal signals share these.
    """
    needed, stated = tuple(payload[:2]), tuple(head[2:4])
    if stated and needed > stated:  # CLIP-22
        raise FormatError(f"it needs format {needed}, HEAD states {stated}", where=where)
    if shared:
        return parse_shared(payloads.Clip, payload, where, "signals")
    return parse(payloads.Clip, payload, where)


@dataclass(slots=True)
class Found:
    """The result of a scan."""

    directory: Directory = field(default_factory=Directory)
    chunks: list[Chunk] = field(default_factory=list)
    feet: list[int] = field(default_factory=list)  # offsets of the FOOTs
    damage: list[str] = field(default_factory=list)
    ends: dict[int, int] = field(default_factory=dict)  # of open DATA chunks, by their offsets
    # Parts that salvage could not use: offset, and the chunk if its header is sound.
    broken: list[tuple[int, Chunk | None]] = field(default_factory=list)
    doubts: bool = False  # it was not clear which clip something belongs to
