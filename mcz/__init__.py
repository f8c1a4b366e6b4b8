"""MCZ: archival, compressed files of skeletal motion capture. SPEC.md describes the format.

The public names and nothing else. Each is loaded when it is first used, so that ``import mcz`` and
``mcz-info --help`` do not wait for numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcz.errors import (
        AccessError,
        ChecksumError,
        ExistsError,
        FormatError,
        LimitError,
        LostFrameError,
        MczError,
        MotionError,
        OptionError,
        SourceError,
        TruncatedError,
        UnsupportedError,
    )
    from mcz.files.archive import Outcome, Report, append, pack, unpack
    from mcz.files.clip import Clip
    from mcz.files.concealing import LiveFrame
    from mcz.files.conversion import Fit, convert, from_positions
    from mcz.files.editing import Replacement, replace
    from mcz.files.extraction import ExtractedClip, Extraction, extract
    from mcz.files.file import Attachment, File, encode, open, read, write
    from mcz.files.filtering import post_filter
    from mcz.files.following import live_frames
    from mcz.files.live import LiveWriter
    from mcz.files.positions import in_positions
    from mcz.files.report import Problem, verify
    from mcz.files.sources import read_skeleton
    from mcz.files.streams import LiveReader, stream_decode, stream_encode
    from mcz.files.tolerant import StreamSummary
    from mcz.kinematics import positions
    from mcz.metrics import Comparison, compare
    from mcz.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton, Source

__version__ = "0.9.0"

_HOMES = {
    "mcz.files.archive": ("Outcome", "Report", "append", "pack", "unpack"),
    "mcz.files.clip": ("Clip",),
    "mcz.files.concealing": ("LiveFrame",),
    "mcz.files.conversion": ("Fit", "convert", "from_positions"),
    "mcz.files.editing": ("Replacement", "replace"),
    "mcz.errors": (
        "AccessError",
        "ChecksumError",
        "ExistsError",
        "FormatError",
        "LimitError",
        "LostFrameError",
        "MczError",
        "MotionError",
        "OptionError",
        "SourceError",
        "TruncatedError",
        "UnsupportedError",
    ),
    "mcz.files.extraction": ("ExtractedClip", "Extraction", "extract"),
    "mcz.files.file": ("Attachment", "File", "encode", "open", "read", "write"),
    "mcz.files.filtering": ("post_filter",),
    "mcz.files.positions": ("in_positions",),
    "mcz.files.following": ("live_frames",),
    "mcz.files.live": ("LiveWriter",),
    "mcz.kinematics": ("positions",),
    "mcz.files.report": ("Problem", "verify"),
    "mcz.metrics": ("Comparison", "compare"),
    "mcz.motion": ("Channel", "Exceptions", "Joint", "Motion", "Signal", "Skeleton", "Source"),
    "mcz.files.sources": ("read_skeleton",),
    "mcz.files.streams": ("LiveReader", "stream_decode", "stream_encode"),
    "mcz.files.tolerant": ("StreamSummary",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "AccessError",
    "Attachment",
    "Channel",
    "ChecksumError",
    "Clip",
    "Comparison",
    "Exceptions",
    "ExistsError",
    "ExtractedClip",
    "Extraction",
    "File",
    "Fit",
    "FormatError",
    "Joint",
    "LimitError",
    "LiveFrame",
    "LiveReader",
    "LiveWriter",
    "LostFrameError",
    "MczError",
    "Motion",
    "MotionError",
    "OptionError",
    "Outcome",
    "Problem",
    "Replacement",
    "Report",
    "Signal",
    "Skeleton",
    "Source",
    "SourceError",
    "StreamSummary",
    "TruncatedError",
    "UnsupportedError",
    "append",
    "compare",
    "convert",
    "encode",
    "extract",
    "from_positions",
    "in_positions",
    "live_frames",
    "open",
    "pack",
    "positions",
    "post_filter",
    "read",
    "read_skeleton",
    "replace",
    "stream_decode",
    "stream_encode",
    "unpack",
    "verify",
    "write",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'mcz' has no attribute {name!r}")
    value = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME_OF])
