"""The records of an index, which INDX holds deflated. SPEC.md, "INDX", has their tables."""

from __future__ import annotations

from mcz.container.payloads import ID, Alia
from mcz.schema import EXTENSION, SIZED, TEXT, UVARINT, Exactly, Record, counted, field


class IndexedChunk(Record):
    """A SKEL, MODL or SRCE in INDEX."""

    type: bytes = field(Exactly(4), "chunk type")
    id: bytes = field(ID, "id of the chunk")
    offset: int = field(UVARINT, "offset of the chunk")
    length: int = field(UVARINT, "bytes of its payload")


class IndexedPart(Record):
    """An ATTA in INDEX."""

    offset: int = field(UVARINT, "offset of the chunk")
    length: int = field(UVARINT, "bytes of its payload")


class IndexedAttachment(Record):
    """An attached file in INDEX."""

    name: str = field(TEXT, "relative path of the attached file")
    size: int = field(UVARINT, "bytes of the whole file")
    parts: list[IndexedPart] = field(counted(IndexedPart), "its ATTA chunks, in order, at least 1")


class IndexedSignal(Record):
    """A signal in INDEX."""

    n_channels: int = field(UVARINT, "channels")
    samples_per_frame: int = field(UVARINT, "rows a frame")
    skip: int = field(UVARINT, "as in CLIP")
    spare: int = field(UVARINT, "as in CLIP")
    codec: int = field(UVARINT, "codec id")
    codec_version: int = field(UVARINT, "codec version")


class IndexedAncillary(Record):
    """An ancillary chunk in INDEX."""

    type: bytes = field(Exactly(4), "chunk type")
    offset: int = field(UVARINT, "offset of the chunk")
    length: int = field(UVARINT, "bytes of its payload")


class IndexedClip(Record):
    """A clip in INDEX."""

    name: str = field(TEXT, "name of the clip")
    skeleton: bytes = field(ID, "id of its SKEL chunk")
    n_frames: int = field(UVARINT, "frames")
    rate_numerator: int = field(UVARINT, "frame rate, numerator; 0: unknown")
    rate_denominator: int = field(UVARINT, "frame rate, denominator")
    signals: list[IndexedSignal] = field(counted(IndexedSignal), "its signals")
    offset: int = field(UVARINT, "offset of the CLIP chunk")
    length: int = field(UVARINT, "bytes of its payload")
    segments: bytes = field(SIZED, "its segments, seven varints each")
    cend_gap: int = field(UVARINT, "bytes between the last segment (or CLIP) and CEND")
    cend_length: int = field(UVARINT, "bytes of the payload of CEND")
    ancillary: list[IndexedAncillary] = field(
        counted(IndexedAncillary), "ancillary chunks between CEND and the next clip"
    )


class Index(Record):
    """The content of INDX, inflated."""

    head: bytes = field(SIZED, "payload of HEAD")
    shared: list[IndexedChunk] = field(
        counted(IndexedChunk), "SKEL, MODL and SRCE chunks, the first of each id"
    )
    attachments: list[IndexedAttachment] = field(counted(IndexedAttachment), "attached files")
    aliases: list[Alia] = field(counted(Alia), "copies of the ALIA chunks")
    clips: list[IndexedClip] = field(counted(IndexedClip), "the clips, in file order")
    extension: bytes = field(EXTENSION, "ignored", default=b"")
