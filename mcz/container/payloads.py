"""The records of the chunks. SPEC.md has one table for each; a test compares them.

DATA is bulk and parsed by hand in ``segments.py``, and in ``chunks.py`` where it is open.

Readers ignore ``extension``: the end of a payload, or sized after flag bit 7. Rewriting keeps it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby

from construct import GreedyBytes, If, Int8ul, this

from mcz.container.limits import FORMAT, NEEDS_MINOR
from mcz.model.numbers import GRID, Grid
from mcz.model.schema import (
    EXTENDED,
    EXTENSION,
    FINITE,
    POSITIVE,
    SIZED,
    SIZED_EXTENSION,
    SVARINT,
    TEXT,
    UVARINT,
    Exactly,
    Record,
    bounded,
    counted,
    field,
    flags,
    one_of,
    only_if,
    optional,
)

ID = Exactly(16)
SHA256 = Exactly(32)
VECTOR = FINITE[3]
Vector = list[float] | tuple[float, float, float]


class Head(Record):
    """HEAD, the first chunk."""

    major: int = field(Int8ul, "format version of the writer, major", default=FORMAT[0])
    minor: int = field(Int8ul, "format version of the writer, minor", default=FORMAT[1])
    needs_major: int = field(
        Int8ul, "least format version that reads the file, major", default=FORMAT[0]
    )
    needs_minor: int = field(
        NEEDS_MINOR, "least format version that reads the file, minor", default=FORMAT[1]
    )
    profile: int = field(Int8ul, "profile id: 0 base, 1 large, 2 small")
    extension: bytes = field(EXTENSION, "ignored, kept", default=b"")


HAS_NAME, HAS_UNIT = 1, 2


class Channel(Record):
    """A channel of a joint or of a signal."""

    flags: int = field(
        flags("has name", "has unit", extended=True),
        "bit 0: has name; 1: has unit; 7: has extension",
        default=0,
    )
    kind: int = field(Int8ul, "channel kind of the registry; 0: plain scalar")
    name: str | None = field(
        If(this.flags & HAS_NAME, TEXT), "name; empty if absent: the kind implies it", default=None
    )
    unit: str | None = field(
        If(this.flags & HAS_UNIT, TEXT),
        "unit; empty if absent: kind and skeleton imply it",
        default=None,
    )
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)


JOINT_FLAGS = ("adds to offset", "has offset", "has axis")
ADDS_TO_OFFSET, HAS_OFFSET, HAS_AXIS = 1, 2, 4


class Joint(Record):
    """A joint of SKEL."""

    name: str = field(TEXT, "name of the joint")
    parent: int = field(UVARINT, "index of the parent + 1; 0 for a root")
    flags: int = field(
        flags(*JOINT_FLAGS, extended=True),
        "bit 0: positions add to offset; 1: has offset; 2: has axis; 7: has extension",
        default=0,
    )
    offset: Vector | None = field(
        If(this.flags & HAS_OFFSET, VECTOR),
        "3 binary64, parent's origin to own; zero if absent",
        default=None,
    )
    axis: Vector | None = field(
        If(this.flags & HAS_AXIS, VECTOR),  # CONV-17
        "3 binary64, Euler angles of the local axes; zero if absent",
        default=None,
    )
    axis_order: int | None = field(
        If(this.flags & HAS_AXIS, one_of(Int8ul, range(6))),
        "0 XYZ, 1 XZY, 2 YXZ, 3 YZX, 4 ZXY, 5 ZYX; XYZ if absent",
        default=None,
    )
    tails: list[Vector] = field(
        counted(VECTOR), "3 binary64 each, own origin to the end of a bone", default=[]
    )
    channels: list[Channel] = field(
        counted(Channel, kind="channels"), "the joint's channels, in column order", default=[]
    )
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)


class SkeletonSource(Record):
    """The source file of a skeleton, in SKEL."""

    template: bytes = field(ID, "id of the SRCE chunk that holds the text")
    format: int = field(Int8ul, "source format id")
    size: int = field(UVARINT, "bytes of the source file")
    sha256: bytes = field(SHA256, "hash of the source file")


class Skel(Record):
    """SKEL, a skeleton; ``encodings.py`` has cleared bit 1 of its flags."""

    name: str = field(TEXT, "name of the skeleton")
    flags: int = field(
        flags("intrinsic"), "bit 0: rotations apply about the turned axes; 1: packed"
    )
    unit_cm: float | None = field(
        optional(FINITE), "0 or 1 binary64: one length unit in cm; none: unknown", default=None
    )
    angle_unit: int = field(one_of(Int8ul, range(3)), "0 unknown, 1 degrees, 2 radians", default=0)
    up_axis: int = field(
        one_of(Int8ul, range(7)), "0 unknown, 1 +x, 2 +y, 3 +z, 4 -x, 5 -y, 6 -z", default=0
    )
    forward_axis: int = field(one_of(Int8ul, range(7)), "likewise, where a figure faces", default=0)
    handedness: int = field(one_of(Int8ul, range(3)), "0 unknown, 1 right, 2 left", default=0)
    base: bytes | None = field(
        optional(ID), "0 or 1: id of the SKEL that this one was derived from", default=None
    )
    source: SkeletonSource | None = field(
        optional(SkeletonSource), "0 or 1: how to restore the skeleton's own file", default=None
    )
    joints: list[Joint] = field(
        counted(Joint, kind="joints"), "the joints, parents before children"
    )
    extension: bytes = field(EXTENSION, "ignored, kept", default=b"")


STORED, DEFLATED, AFTER_WORDS = 0, 1, 2
ENCODING = 3  # mask of the bits of flags
ENCODING_FLAGS = one_of(Int8ul, (0, 1, 2, EXTENDED, EXTENDED + 1, EXTENDED + 2))  # CONV-14, CONV-15
ENCODED = "bits 0-1: 0 stored, 1 raw deflate, 2 deflate after words; 7: has extension"


class Srce(Record):
    """SRCE, the template of a source."""

    format: int = field(Int8ul, "source format id")
    flags: int = field(ENCODING_FLAGS, ENCODED, default=0)
    size: int = field(UVARINT, "bytes of the template")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)
    data: bytes = field(GreedyBytes, "the template, encoded")


class Modl(Record):
    """MODL, a model that codecs refer to."""

    flags: int = field(flags(extended=True), "bit 7: has extension", default=0)
    kind: int = field(UVARINT, "model kind of the registry")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)
    data: bytes = field(GreedyBytes, "the model; its kind says how to read it")


class Atta(Record):
    """ATTA, a part of an attached file."""

    name: str = field(TEXT, "relative path of the attached file")
    part: int = field(UVARINT, "number of this part, from 0")
    n_parts: int = field(POSITIVE, "parts of the file, at least 1, all in one run")
    size: int = field(UVARINT, "bytes of the whole file")
    sha256: bytes = field(SHA256, "hash of the whole file")
    flags: int = field(ENCODING_FLAGS, ENCODED, default=0)
    part_size: int = field(UVARINT, "bytes of this part, decoded")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)
    data: bytes = field(GreedyBytes, "this part, encoded")


OF_CLIP, OF_SKELETON, OF_ATTACHMENT = 0, 1, 2


class Alia(Record):
    """ALIA, another file with the content of a stored one."""

    name: str = field(TEXT, "relative path of the file")
    of: int = field(
        one_of(Int8ul, (OF_CLIP, OF_SKELETON, OF_ATTACHMENT)), "0 clip, 1 skeleton, 2 attachment"
    )
    target: bytes = field(SIZED, "name of the clip or attachment, or id of the SKEL")
    extension: bytes = field(EXTENSION, "ignored", default=b"")


class ClipSource(Record):
    """The source file of a clip, in CLIP."""

    flags: int = field(flags(extended=True), "bit 7: has extension", default=0)
    template: bytes = field(ID, "id of the SRCE chunk")
    format: int = field(Int8ul, "source format id")
    detail: bytes = field(SIZED, "detail of this clip, by its source format")
    path: str = field(TEXT, "relative path of the source file, with forward slashes")
    size: int = field(UVARINT, "bytes of the source file")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)


class GridRun(Record):
    """The number grid of channels in a row, in SIGNAL."""

    # CLIP-06
    n_channels: int = field(POSITIVE, "channels in a row that share the grid, at least 1")
    grid: Grid = field(GRID, "number grid")


def grid_runs(grids: Sequence[Grid]) -> list[GridRun]:
    """The runs of the grids of all channels."""
    runs = ((grid, len(list(run))) for grid, run in groupby(grids))
    return [GridRun(n_channels=count, grid=grid) for grid, count in runs]


GROUP_ALL, GROUP_JOINT, GROUP_CHANNEL, GROUP_LISTED = range(4)


class Groups(Record):
    """The partition of a signal's channels, in SIGNAL."""

    kind: int = field(
        one_of(Int8ul, range(4)), "0 all channels, 1 per joint, 2 per channel, 3 listed"
    )
    sizes: list[int] | None = field(
        If(this.kind == GROUP_LISTED, counted(UVARINT)),
        "channels of each group, in column order; only if kind is 3",
        default=None,
    )


OWN_CHANNELS = 1
MOTION, TIMES, RESIDUALS = 1, 2, 3  # roles with rules of their own; the registry has all


class Signal(Record):
    """A signal of CLIP."""

    name: str = field(TEXT, "name of the signal")
    flags: int = field(
        flags("own channels", extended=True),
        "bit 0: has channels of its own, not the skeleton's; 7: has extension",
        default=0,
    )
    role: int = field(Int8ul, "role of the registry; 0: none", default=0)
    of: int | None = field(
        If(this.role == RESIDUALS, UVARINT),
        "index of the signal whose residuals these are; only if role is 3",
        default=None,
    )
    channels: list[Channel] | None = field(
        If(this.flags & OWN_CHANNELS, counted(Channel)), "the signal's own channels", default=None
    )
    samples_per_frame: int = field(POSITIVE, "rows a frame, at least 1", default=1)  # CLIP-12
    skip: int = field(UVARINT, "stored frames before the first that is shown", default=0)
    spare: int = field(UVARINT, "stored frames after the last that is shown", default=0)
    grids: list[GridRun] = field(counted(GridRun), "number grids, in column order")
    codec: int = field(UVARINT, "codec id")
    preset: int = field(Int8ul, "preset id, ignored in decoding", default=0)
    codec_version: int = field(UVARINT, "codec version")
    header: bytes = field(SIZED, "the codec's own header")
    groups: Groups = field(Groups, "partition of the channels")
    n_resolutions: int = field(bounded(Int8ul, 1, 255), "resolutions, at least 1", default=1)
    extension: bytes | None = field(SIZED_EXTENSION, "ignored, kept; flag bit 7", default=None)


CLIP_FLAGS = ("open", "rounded rate", "time base")
OPEN_CLIP, ROUNDED_RATE, HAS_TIME_BASE = 1, 2, 4


class MissingRun(Record):
    """Frame numbers without a frame in the clip, in TIME_BASE and CEND."""

    frames: int = field(POSITIVE, "frames after the run before, or from the first, at least 1")
    length: int = field(POSITIVE, "frame numbers that are missing then, at least 1")  # TIME-01


class TimeBase(Record):
    """The numbers of the frames of a clip and the time of the first, in CLIP."""

    number: int = field(SVARINT, "number of the first frame")
    first_time: float | None = field(
        optional(FINITE),  # TIME-06
        "0 or 1 binary64: time of the first frame in seconds",
        default=None,
    )
    missing: list[MissingRun] = field(counted(MissingRun), "runs of missing frames", default=[])


class Metadata(Record):
    """A pair of metadata."""

    key: str = field(TEXT, "key of the registry, or x-...")
    value: str = field(TEXT, "text")


def metadata_records(pairs: Mapping[str, str]) -> list[Metadata]:
    """The pairs as records of CLIP and QUAL."""
    return [Metadata(key=key, value=value) for key, value in pairs.items()]


def metadata_pairs(records: Sequence[Metadata]) -> dict[str, str]:
    """The pairs that CLIP or QUAL has."""
    return {record.key: record.value for record in records}


class Clip(Record):
    """CLIP, all facts of a clip that precede its data."""

    needs_major: int = field(
        Int8ul, "least format version that reads the clip, major", default=FORMAT[0]
    )
    needs_minor: int = field(
        NEEDS_MINOR, "least format version that reads the clip, minor", default=FORMAT[1]
    )
    name: str = field(TEXT, "name of the clip, unique in the file, not empty")
    flags: int = field(
        flags(*CLIP_FLAGS),
        "bit 0: n_frames is open; 1: the frame rate is rounded; 2: has a time base",
        default=0,
    )
    skeleton: bytes = field(ID, "id of the SKEL chunk")
    n_frames: int = field(UVARINT, "frames; 0 while open")
    rate_numerator: int = field(UVARINT, "frame rate, numerator; 0: unknown")
    rate_denominator: int = field(POSITIVE, "frame rate, denominator, at least 1")  # CLIP-14
    time_base: TimeBase | None = field(
        only_if(this.flags & HAS_TIME_BASE, TimeBase),
        "numbers and time of the frames; only if flag bit 2 is set",
        default=None,
    )
    metadata: list[Metadata] = field(counted(Metadata), "pairs of key and value", default=[])
    source: ClipSource | None = field(
        optional(ClipSource), "0 or 1: how to restore the source file", default=None
    )
    signals: list[Signal] = field(counted(Signal), "the signals, at least 1")
    extension: bytes = field(EXTENSION, "ignored, kept", default=b"")


class Cend(Record):
    """CEND, all facts of a clip that follow its data."""

    n_frames: int = field(UVARINT, "frames of the clip")
    missing: list[MissingRun] = field(
        counted(MissingRun), "runs of missing frames of a clip with flag bit 0", default=[]
    )
    source_sha256: bytes | None = field(
        optional(SHA256), "0 or 1: hash of the source file", default=None
    )
    value_sha256: list[bytes] = field(counted(SHA256), "hash of each signal's canonical array")
    extension: bytes = field(EXTENSION, "ignored, kept", default=b"")


class Meta(Record):
    """META, metadata of clips that lie before it."""

    flags: int = field(ENCODING_FLAGS, ENCODED, default=0)
    size: int = field(UVARINT, "bytes of the records, decoded")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored; flag bit 7", default=None)
    data: bytes = field(GreedyBytes, "the records, encoded")


class MetaRecord(Record):
    """A record in the decoded data of META."""

    clip: str = field(TEXT, "name of the clip; empty: the whole file")
    removed: list[str] = field(counted(TEXT), "keys to remove")
    entries: list[Metadata] = field(counted(Metadata), "pairs of key and value")


class Copy(Record):
    """COPY, copies of small chunks."""

    flags: int = field(ENCODING_FLAGS, ENCODED, default=0)
    size: int = field(UVARINT, "bytes of the copies, decoded")
    extension: bytes | None = field(SIZED_EXTENSION, "ignored; flag bit 7", default=None)
    data: bytes = field(GreedyBytes, "the copies, encoded")


class CopiedChunk(Record):
    """A copy in the decoded data of COPY."""

    distance: int = field(UVARINT, "bytes from where the chunk begins to where this COPY begins")
    type: bytes = field(Exactly(4), "its type")
    payload: bytes = field(SIZED, "its payload")


class Qual(Record):
    """QUAL, the quality that a clip was measured to have."""

    entries: list[Metadata] = field(
        counted(Metadata), "metric id or setting, and its value as text"
    )
    extension: bytes = field(EXTENSION, "ignored, kept", default=b"")
