"""The quick check of a file: its checksums and its index, nothing decoded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mcz.brief import brief
from mcz.container.checksums import Checked, check_checksums
from mcz.container.source import ByteSource
from mcz.errors import MczError
from mcz.reading.file import open, reached
from mcz.types import Target

HEADINGS = tuple(
    "HEAD SKEL SRCE MODL ATTA ALIA CLIP DATA CEND QUAL META REPT COPY RECV INDX".split()
)


@dataclass(frozen=True, slots=True)
class Problem:
    """One fault: where, under which heading of SPEC.md, and what.

    ``clip`` is the clip that the message names.
    """

    offset: int
    heading: str
    message: str
    clip: str | None = None

    __repr__ = brief


def heading(source: ByteSource, offset: int) -> str:
    """The heading of SPEC.md under which the chunk at ``offset`` stands."""
    kind = source.read(offset, min(4, source.size - offset)).decode("latin-1")
    return kind if kind in HEADINGS else "Chunks"


def quick_check(
    target: Target, progress: Callable[[int, int], object] | None = None
) -> tuple[Checked, list[Problem]]:
    """Check every checksum of a file and its index; what was seen, and the faults.

    While another process appends to the file, this is of the file up to its last end.
    ``progress`` is called with the bytes that are done and those of the file.
    Raises UnsupportedError where it needs a newer reader, AccessError where it cannot be read.
    """
    source = reached(target)
    try:
        if source.grows():
            with open(target) as file:
                return _checked(file.container.source, progress)
        return _checked(source, progress)
    except MczError as error:
        error.add(path=source.name)
        raise
    finally:
        source.close()


def _checked(
    source: ByteSource, progress: Callable[[int, int], object] | None
) -> tuple[Checked, list[Problem]]:
    seen = check_checksums(source, progress)
    return seen, [Problem(at, heading(source, at), text) for at, text in seen.faults]
