"""MCZ: archival, compressed files of skeletal motion capture. SPEC.md describes the format.

The public names and nothing else. Each is loaded when it is first used, so that ``import mcz`` and
``mcz-info --help`` do not wait for numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
    from mcz.file import Attachment, File, encode, open, read, write
    from mcz.motion import Channel, Exceptions, Joint, Motion, Signal, Skeleton, Source
    from mcz.report import Problem, verify
    from mcz.sources import read_skeleton

__version__ = "0.1.0"

_HOMES = {
    "mcz.archive": ("Outcome", "Report", "append", "pack", "unpack"),
    "mcz.clip": ("Clip",),
    "mcz.errors": (
        "ChecksumError",
        "FormatError",
        "LimitError",
        "MczError",
        "MotionError",
        "OptionError",
        "SourceError",
        "TruncatedError",
        "UnsupportedError",
    ),
    "mcz.file": ("Attachment", "File", "encode", "open", "read", "write"),
    "mcz.report": ("Problem", "verify"),
    "mcz.motion": ("Channel", "Exceptions", "Joint", "Motion", "Signal", "Skeleton", "Source"),
    "mcz.sources": ("read_skeleton",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

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
    "Problem",
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
