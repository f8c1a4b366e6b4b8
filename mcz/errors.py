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

An error has fields, see ``MczError``; ``str(error)`` is made of them. Code that knows more
about the place adds it on the way out, with ``error.add`` or ``error_context``. Problems that are
not errors are warnings: SkeletonWarning, ContactWarning.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, ClassVar, TypedDict

from mcz.hints import PYTHON_HINTS, Hint, Remark, Words, with_hint

if TYPE_CHECKING:
    from typing import Unpack

Value = str | int | float


class Fields(TypedDict, total=False):
    """Fields of an error as keywords; one that is None is not given."""

    path: str | os.PathLike[str] | None
    clip: str | None
    line: int | None
    offset: int | None
    where: str | None
    value: Value | None
    note: str | None
    hint: Hint | None


class MczError(Exception):
    """Base of all errors of this package; catching it catches every one of them.

    ``message`` is the fault alone. The other fields are None while unknown:

    ``path``    the file, as the caller named it
    ``clip``    the name of the clip or motion
    ``line``    the line of a text, counted from 1
    ``offset``  the byte of a file; in an MCZ file where the chunk at fault begins
    ``where``   the structure and the field within the file or the clip
    ``value``   the value that is refused
    ``note``    a remark that follows the message
    ``hint``    the way out, a ``Hint``
    """

    path: str | None = None
    clip: str | None = None
    line: int | None = None
    offset: int | None = None
    where: str | None = None
    value: Value | None = None
    note: str | None = None
    hint: Hint | None = None
    _shows_offset: ClassVar[bool] = True

    def __init__(self, message: str = "", **fields: Unpack[Fields]) -> None:
        super().__init__(message)
        self.add(**fields)

    @property
    def message(self) -> str:
        """The text without the other fields."""
        return str(self.args[0])

    @property
    def fields(self) -> Fields:
        """The fields that are known."""
        known: Fields = {}
        for name in Fields.__annotations__:
            if (value := getattr(self, name)) is not None:
                known[name] = value  # type: ignore[literal-required]
        return known

    def add(self, **fields: Unpack[Fields]) -> None:
        """Add fields that are not known yet; ``where`` goes in front of what is known of it."""
        inner = self.where
        for name, value in fields.items():
            if value is not None and getattr(self, name) is None:
                setattr(self, name, str(value) if name == "path" else value)
        if inner is not None and (outer := fields.get("where")) is not None:
            self.where = f"{outer}: {inner}"

    def describe(self, hints: Words = PYTHON_HINTS, *, with_path: bool = True) -> str:
        """The message and its fields as one text; ``hints`` words the hint."""
        return with_hint(self.words(with_path=with_path), self.hint, hints)

    def __str__(self) -> str:
        return self.describe()

    def words(self, *, with_path: bool = True) -> str:
        """The text without the hint."""
        places = (
            self.path if with_path else None,
            None if self.clip is None else f"clip {self.clip!r}",
            None if self.line is None else f"line {self.line}",
            f"offset {self.offset}" if self._shows_offset and self.offset is not None else None,
            self.where,
            self.message,
        )
        text = ": ".join(place for place in places if place)
        return f"{text}; {self.note}" if self.note else text


@contextmanager
def error_context(**fields: Unpack[Fields]) -> Iterator[None]:
    """Add ``fields`` to each error of this package that leaves the block."""
    try:
        yield
    except MczError as error:
        error.add(**fields)
        raise


class MotionError(MczError):
    """A motion, skeleton or signal breaks a rule of the data model."""


class OptionError(MczError):
    """A parameter or an argument is unknown, out of its range or of a wrong type."""


class AccessError(OptionError):
    """A file cannot be opened, read or written, or another process is writing to it."""


class ExistsError(OptionError):
    """The target exists, and replacing it was not requested."""


class OutOfRangeError(OptionError, IndexError):
    """An index that is out of range, or cannot be one."""


class UnknownNameError(OptionError, KeyError):
    """A name that matches no clip, or several."""


class SourceError(MczError):
    """A source file cannot be parsed; ``line`` or ``offset`` is where."""


class WorkerError(MczError):
    """A process or a machine that shared the work ended early."""


class FormatError(MczError):
    """Bytes that are not a valid MCZ file, chunk or payload.

    ``where`` names a chunk along with its offset, so that the text does not repeat ``offset``.
    """

    _shows_offset = False


class TruncatedError(FormatError):
    """The bytes end within a structure.

    ``last_foot`` is the end offset of the last valid FOOT, or None without one:
    everything up to it can be read with ``salvage=True``.
    """

    def __init__(
        self, message: str = "", *, last_foot: int | None = None, **fields: Unpack[Fields]
    ) -> None:
        super().__init__(message, **fields)
        self.last_foot = last_foot


class ChecksumError(FormatError):
    """A stored CRC or hash differs from that of the bytes."""


class UnsupportedError(FormatError):
    """Well-formed, but needs a codec, version or chunk that this reader does not have."""


class LimitError(FormatError):
    """The file asks for more channels, memory or output than the profile or caller allows."""


class LostFrameError(FormatError):
    """A live frame needs one that did not arrive, or is damaged."""


class SkeletonWarning(UserWarning):
    """An AMC got a skeleton whose name or dofs are not its own, or rest poses differ."""


class ContactWarning(UserWarning):
    """A lossy codec could not hold a standing point in its place."""


def remark_of(error: MczError | OSError, **fields: Unpack[Fields]) -> Remark:
    """The text of an error as part of a report; ``fields`` as in ``MczError.add``."""
    if isinstance(error, OSError):
        error = MczError(reason_of(error), path=error.filename)
    error.add(**fields)
    return Remark(error.words(), error.hint)


def reason_of(error: BaseException) -> str:
    """The words of an error of Python or of another library, on one line."""
    words = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(words).split())
