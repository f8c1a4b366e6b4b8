"""The records of an index, which INDX holds deflated. SPEC.md, "INDX", has their tables."""

from __future__ import annotations

from construct import GreedyBytes, If, Int8ul, Int32ul, this

from mcz.container.payloads import ID, OF_ATTACHMENT, OF_CLIP, OF_SKELETON
from mcz.model.schema import (
    EXTENSION,
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
    flags: int = field(UVARINT, "as in DATA; more where it is a packet: 64 of kind 1, 32 of kind 2")


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
    n_behind: int = field(UVARINT, "the first ancillary chunks, of the last clip of INDX before")
    ancillary: Table[IndexedPlace] = field(
        columns(IndexedPlace), "the ancillary chunks of all clips"
    )
    extension: bytes = field(EXTENSION, "ignored", default=b"")
