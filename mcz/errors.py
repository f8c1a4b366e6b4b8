"""Every error that MCZ raises on purpose.

::

    MczError
    ├── MotionError          the motion, skeleton or signal itself is not acceptable
    ├── OptionError          a parameter or an argument is out of its range
    │   ├── AccessError      a file cannot be opened or written, or is in use
    │   ├── ExistsError      the target exists and must not be replaced
    │   ├── OutOfRangeError  an index is out of range or of a wrong type: an IndexError, too
    │   └── UnknownNameError there is no clip of that name: a KeyError, too
    ├── SourceError          a source file (ASF, AMC, BVH, C3D) cannot be parsed
    ├── WorkerError          a process that worked for this one ended unexpectedly
    └── FormatError          the bytes are not a valid MCZ file
        ├── TruncatedError   they end too early
        ├── ChecksumError    a stored checksum does not match them
        ├── UnsupportedError they need a codec, version or chunk that this reader lacks
        ├── LimitError       they ask for more than the reader is willing to give
        └── LostFrameError   they need a frame that did not come

A message says where (file, chunk, offset, line) and shows the value that was found. What is no
error but should be known is a warning: SkeletonWarning, ContactWarning.
"""

from __future__ import annotations


class MczError(Exception):
    """Base of all errors of this package; catching it catches every one of them."""


class MotionError(MczError):
    """A motion, skeleton or signal breaks a rule of the data model."""


class OptionError(MczError):
    """A parameter or an argument is unknown or out of its range."""


class AccessError(OptionError):
    """A file cannot be opened, read or written, or another process is writing to it."""


class ExistsError(OptionError):
    """The target exists already, and nobody said that it may be replaced."""


class OutOfRangeError(OptionError, IndexError):
    """An index that is out of range, or cannot be one."""


class UnknownNameError(OptionError, KeyError):
    """A name that means no clip, or several."""

    __str__ = Exception.__str__  # KeyError would show the message in quotes


class SourceError(MczError):
    """A source file cannot be parsed; the message names the line or the offset."""


class WorkerError(MczError):
    """A process or a machine that worked for this one ended before it was done."""


class FormatError(MczError):
    """Bytes that are not a valid MCZ file, chunk or payload.

    ``offset`` is where the chunk at fault begins, None where that is not known.
    """

    offset: int | None = None


class TruncatedError(FormatError):
    """The bytes end before the structure that they began.

    ``last_foot`` is the end offset of the last valid FOOT, or None where there is none:
    everything up to it can be read with ``salvage=True``.
    """

    def __init__(self, message: str, last_foot: int | None = None) -> None:
        super().__init__(message)
        self.last_foot = last_foot


class ChecksumError(FormatError):
    """A stored CRC or hash differs from that of the bytes."""


class UnsupportedError(FormatError):
    """Well-formed, but needs a codec, version or chunk that this reader does not have."""


class LimitError(FormatError):
    """The file asks for more channels, memory or output than the profile or caller allows."""


class LostFrameError(FormatError):
    """A live frame that needs one that did not come, or came damaged."""


class SkeletonWarning(UserWarning):
    """An AMC got a skeleton whose name or dofs are not its own, or rest poses differ."""


class ContactWarning(UserWarning):
    """A lossy codec could not keep a point in its place as it was asked to."""
