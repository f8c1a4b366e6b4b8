"""MCZ: archival, compressed files of skeletal motion capture. SPEC.md describes the format."""

from mcz.archive import Outcome, Report, append, pack, unpack
from mcz.clip import Clip
from mcz.errors import (
    ChecksumError,
    FormatError,
    LimitError,
    MczError,
    MotionError,
    OptionError,
    SourceError,
    TruncatedError,
    UnsupportedError,
)
from mcz.file import Attachment, File, encode, open, read, read_skeleton, write
from mcz.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton, Source

__version__ = "0.1.0"

__all__ = [
    "Attachment",
    "Channel",
    "ChecksumError",
    "Clip",
    "Exceptions",
    "File",
    "FormatError",
    "Joint",
    "LimitError",
    "MczError",
    "Motion",
    "MotionError",
    "OptionError",
    "Outcome",
    "Report",
    "Signal",
    "Skeleton",
    "Source",
    "SourceError",
    "TruncatedError",
    "UnsupportedError",
    "append",
    "encode",
    "open",
    "pack",
    "read",
    "read_skeleton",
    "unpack",
    "write",
]
