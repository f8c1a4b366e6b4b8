"""The payload schemas of the chunks. SPEC.md has one table for each; a test compares them.

Not that of DATA, which is bulk and read by hand: ``segments.py``; ``packets.py`` where it is open.

Open structures end in ``extension``, which readers ignore and rewriting keeps.
"""

from __future__ import annotations

from mcz.numbers import GRID
from mcz.schema import (
    EXTENSION,
    FINITE,
    SIZED,
    TEXT,
    UVARINT,
    Bytes,
    ExprValidator,
    GreedyBytes,
    IfThenElse,
    Int8ul,
    OneOf,
    Pass,
    Struct,
    counted,
    optional,
    this,
)

FORMAT_MAJOR, FORMAT_MINOR = 0, 9
LEAST_NEEDED = 0, 2  # 0.1 had another CLIP and INDX

POSITIVE = ExprValidator(UVARINT, lambda obj, ctx: obj >= 1)


def flags(*names: str) -> ExprValidator:
    """One byte of flags, bit 0 first; the bits without a name are reserved and must be 0."""
    return ExprValidator(Int8ul, lambda obj, ctx: obj < 1 << len(names))  # CONV-14


ID = Bytes(16)
SHA256 = Bytes(32)
VECTOR = FINITE[3]

HEAD = Struct(
    "major" / Int8ul * "format version of the writer, major",
    "minor" / Int8ul * "format version of the writer, minor",
    "needs_major" / Int8ul * "least format version that reads the container, major",
    "needs_minor" / Int8ul * "least format version that reads the container, minor",
    "profile" / Int8ul * "profile id: 0 base, 1 archive",
    "extension" / EXTENSION * "ignored, kept",
)

CHANNEL = Struct(
    "kind" / Int8ul * "channel kind of the registry; 0: plain scalar",
    "name" / TEXT * "name, empty where the kind says it all",
    "unit" / TEXT * "unit, empty where the kind and the skeleton say it",
)

JOINT_FLAGS = ("adds to offset", "has offset", "has axis")
ADDS_TO_OFFSET, HAS_OFFSET, HAS_AXIS = 1, 2, 4
JOINT = Struct(
    "name" / TEXT * "name of the joint",
    "parent" / UVARINT * "index of the parent + 1; 0 for a root",
    "flags" / flags(*JOINT_FLAGS) * "bit 0: positions add to offset; 1: has offset; 2: has axis",
    "offset"
    / IfThenElse(this.flags & HAS_OFFSET, VECTOR, Pass)
    * "3 binary64, parent's origin to own; zero where absent",
    "axis"
    / IfThenElse(this.flags & HAS_AXIS, VECTOR, Pass)  # CONV-17
    * "3 binary64, Euler angles of the local axes; zero where absent",
    "axis_order"
    / IfThenElse(this.flags & HAS_AXIS, OneOf(Int8ul, range(6)), Pass)
    * "0 XYZ, 1 XZY, 2 YXZ, 3 YZX, 4 ZXY, 5 ZYX; XYZ where absent",
    "tails" / counted(VECTOR) * "3 binary64 each, own origin to the end of a bone",
    "channels" / counted(CHANNEL, kind="channels") * "the joint's channels, in column order",
)

SKELETON_SOURCE = Struct(
    "template" / ID * "id of the SRCE chunk that holds the text",
    "format" / Int8ul * "source format id",
    "size" / UVARINT * "bytes of the source file",
    "sha256" / SHA256 * "hash of the source file",
)

SKEL = Struct(
    "name" / TEXT * "name of the skeleton",
    "flags"
    / flags("intrinsic")  # packed.py has cleared bit 1
    * "bit 0: rotations apply about the turned axes; 1: packed",
    "unit_cm" / optional(FINITE) * "0 or 1 binary64: one length unit in cm; none: unknown",
    "angle_unit" / OneOf(Int8ul, range(3)) * "0 unknown, 1 degrees, 2 radians",
    "up_axis" / OneOf(Int8ul, range(4)) * "0 unknown, 1 x, 2 y, 3 z",
    "base" / optional(ID) * "0 or 1: id of the SKEL that this one was derived from",
    "source" / optional(SKELETON_SOURCE) * "0 or 1: how to restore the skeleton's own file",
    "joints" / counted(JOINT, kind="joints") * "the joints, parents before children",
    "extension" / EXTENSION * "ignored, kept",
)

STORED, DEFLATED, AFTER_WORDS = 0, 1, 2
ENCODING = OneOf(Int8ul, (STORED, DEFLATED, AFTER_WORDS))  # CONV-15
SRCE = Struct(
    "format" / Int8ul * "source format id",
    "encoding" / ENCODING * "0 stored, 1 raw deflate, 2 deflate after words",
    "size" / UVARINT * "bytes of the template",
    "data" / GreedyBytes * "the template, encoded",
)

MODL = Struct(
    "kind" / UVARINT * "model kind of the registry",
    "data" / GreedyBytes * "the model; its kind says how to read it",
)

ATTA = Struct(
    "name" / TEXT * "relative path of the attached file",
    "part" / UVARINT * "number of this part, from 0",
    "n_parts" / POSITIVE * "parts of the file, at least 1, all in one run",
    "size" / UVARINT * "bytes of the whole file",
    "sha256" / SHA256 * "hash of the whole file",
    "encoding" / ENCODING * "0 stored, 1 raw deflate, 2 deflate after words",
    "part_size" / UVARINT * "bytes of this part, decoded",
    "data" / GreedyBytes * "this part, encoded",
)

OF_CLIP, OF_SKELETON, OF_ATTACHMENT = 0, 1, 2
ALIA = Struct(
    "name" / TEXT * "relative path of the file",
    "of"
    / OneOf(Int8ul, (OF_CLIP, OF_SKELETON, OF_ATTACHMENT))
    * "0 clip, 1 skeleton, 2 attachment",
    "target" / SIZED * "name of the clip or attachment, or id of the SKEL",
)

CLIP_SOURCE = Struct(
    "template" / ID * "id of the SRCE chunk",
    "format" / Int8ul * "source format id",
    "detail" / SIZED * "what the template leaves open for this clip",
    "path" / TEXT * "relative path of the source file, with forward slashes",
    "size" / UVARINT * "bytes of the source file",
)

GRID_RUN = Struct(
    "n_channels" / POSITIVE * "channels in a row that share the grid, at least 1",  # CLIP-06
    "grid" / GRID * "number grid",
)

GROUP_ALL, GROUP_JOINT, GROUP_CHANNEL, GROUP_LISTED = range(4)
GROUPS = Struct(
    "kind" / OneOf(Int8ul, range(4)) * "0 all channels, 1 per joint, 2 per channel, 3 listed",
    "sizes"
    / IfThenElse(this.kind == GROUP_LISTED, counted(UVARINT), Pass)
    * "channels of each group, in column order; only where kind is 3",
)

OWN_CHANNELS = 1
SIGNAL = Struct(
    "name" / TEXT * "name of the signal",
    "flags" / flags("own channels") * "bit 0: has channels of its own, not the skeleton's",
    "channels"
    / IfThenElse(this.flags & OWN_CHANNELS, counted(CHANNEL), Pass)
    * "the signal's own channels",
    "samples_per_frame" / POSITIVE * "rows a frame, at least 1",  # CLIP-12
    "skip" / UVARINT * "stored frames before the first that is shown",
    "spare" / UVARINT * "stored frames after the last that is shown",
    "grids" / counted(GRID_RUN) * "number grids, in column order",
    "codec" / UVARINT * "codec id",
    "codec_version" / UVARINT * "codec version",
    "header" / SIZED * "the codec's own header",
    "groups" / GROUPS * "partition of the channels",
    "n_resolutions" / ExprValidator(Int8ul, lambda obj, ctx: obj >= 1) * "resolutions, at least 1",
    "extension" / SIZED * "ignored, kept",
)

CLIP_FLAGS = ("open", "rounded rate")
OPEN_CLIP, ROUNDED_RATE = 1, 2
METADATA = Struct("key" / TEXT * "key of the registry, or x-...", "value" / TEXT * "text")
CLIP = Struct(
    "name" / TEXT * "name of the clip, unique in the file, not empty",
    "flags" / flags(*CLIP_FLAGS) * "bit 0: n_frames is open; 1: the frame rate is rounded",
    "skeleton" / ID * "id of the SKEL chunk",
    "n_frames" / UVARINT * "frames; 0 while open",
    "rate_numerator" / UVARINT * "frame rate, numerator; 0: unknown",
    "rate_denominator" / POSITIVE * "frame rate, denominator, at least 1",  # CLIP-14
    "metadata" / counted(METADATA) * "pairs of key and value",
    "source" / optional(CLIP_SOURCE) * "0 or 1: how to restore the source file",
    "signals" / counted(SIGNAL) * "the signals, at least 1, the motion first",
    "extension" / EXTENSION * "ignored, kept",
)

CEND = Struct(
    "n_frames" / UVARINT * "frames of the clip",
    "source_sha256" / optional(SHA256) * "0 or 1: hash of the source file",
    "value_sha256" / counted(SHA256) * "hash of each signal's canonical array",
    "extension" / EXTENSION * "ignored, kept",
)

COPY = Struct(
    "encoding" / ENCODING * "0 stored, 1 raw deflate, 2 deflate after words",
    "size" / UVARINT * "bytes of the copies, decoded",
    "data" / GreedyBytes * "the copies, encoded",
)

META = Struct(
    "encoding" / ENCODING * "0 stored, 1 raw deflate, 2 deflate after words",
    "size" / UVARINT * "bytes of the records, decoded",
    "data" / GreedyBytes * "the records, encoded",
)

QUAL = Struct(
    "entries" / counted(METADATA) * "metric id or setting, and its value as text",
    "extension" / EXTENSION * "ignored, kept",
)

GRID_CHANGE = Struct(
    "channel" / UVARINT * "channel, counted within the group",
    "grid" / GRID * "its grid in this segment",
)
EXCEPTION = Struct(
    "row" / UVARINT * "rows after the exception before, or after the segment's first row",
    "channel" / UVARINT * "channel, counted within the group",
    "text" / SIZED * "the token",
)
GROUP_NOTES = Struct(
    "grid_changes" / counted(GRID_CHANGE) * "grids that differ from the clip's",
    "exceptions" / counted(EXCEPTION) * "tokens that the grid does not print, sorted",
)

INDEXED_CHUNK = Struct(
    "type" / Bytes(4) * "chunk type",
    "id" / ID * "id of the chunk",
    "offset" / UVARINT * "offset of the chunk",
    "length" / UVARINT * "bytes of its payload",
)
INDEXED_PART = Struct(
    "offset" / UVARINT * "offset of the chunk",
    "length" / UVARINT * "bytes of its payload",
)
INDEXED_ATTACHMENT = Struct(
    "name" / TEXT * "relative path of the attached file",
    "size" / UVARINT * "bytes of the whole file",
    "parts" / counted(INDEXED_PART) * "its ATTA chunks, in order, at least 1",
)
INDEXED_SIGNAL = Struct(
    "n_channels" / UVARINT * "channels",
    "samples_per_frame" / UVARINT * "rows a frame",
    "skip" / UVARINT * "as in CLIP",
    "spare" / UVARINT * "as in CLIP",
    "codec" / UVARINT * "codec id",
    "codec_version" / UVARINT * "codec version",
)
INDEXED_ANCILLARY = Struct(
    "type" / Bytes(4) * "chunk type",
    "offset" / UVARINT * "offset of the chunk",
    "length" / UVARINT * "bytes of its payload",
)
INDEXED_CLIP = Struct(
    "name" / TEXT * "name of the clip",
    "skeleton" / ID * "id of its SKEL chunk",
    "n_frames" / UVARINT * "frames",
    "rate_numerator" / UVARINT * "frame rate, numerator; 0: unknown",
    "rate_denominator" / UVARINT * "frame rate, denominator",
    "signals" / counted(INDEXED_SIGNAL) * "its signals",
    "offset" / UVARINT * "offset of the CLIP chunk",
    "length" / UVARINT * "bytes of its payload",
    "segments" / SIZED * "its segments, seven varints each",
    "cend_gap" / UVARINT * "bytes between the last segment (or CLIP) and CEND",
    "cend_length" / UVARINT * "bytes of the payload of CEND",
    "ancillary" / counted(INDEXED_ANCILLARY) * "ancillary chunks between CEND and the next clip",
)
INDEX = Struct(
    "head" / SIZED * "payload of HEAD",
    "shared" / counted(INDEXED_CHUNK) * "SKEL, MODL and SRCE chunks, the first of each id",
    "attachments" / counted(INDEXED_ATTACHMENT) * "attached files",
    "aliases" / counted(ALIA) * "copies of the ALIA chunks",
    "clips" / counted(INDEXED_CLIP) * "the clips, in file order",
    "extension" / EXTENSION * "ignored",
)
INDX = Struct(
    "size" / UVARINT * "bytes of the index, inflated",
    "data" / GreedyBytes * "the index, as raw deflate",
)
