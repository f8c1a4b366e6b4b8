"""Source files on disk -> Motion or Skeleton, with what the caller says and the file does not."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcz.errors import (
    MczError,
    OptionError,
    SourceError,
    reason_of,
)
from mcz.formats import (
    FORMATS,
    HEAD_BYTES,
    Format,
    format_of,
    has_known_suffix,
    likely_formats,
)
from mcz.motion import Motion, Skeleton


def read_skeleton(path: str | os.PathLike[str]) -> Skeleton:
    """The skeleton in an ASF file, with its source."""
    path = Path(path)
    source_format, data = load(path)
    if not source_format.is_skeleton:
        raise OptionError("not a skeleton file", path=path)
    skeleton: Skeleton = _named(path, source_format.read, data, path.stem)
    if skeleton.source is None:
        return skeleton
    return replace(skeleton, source=replace(skeleton.source, path=path.name))


def load(path: Path) -> tuple[Format, bytes]:
    """The format of a source file, see ``format_of``, and its bytes; raises SourceError."""
    if not has_known_suffix(path):  # it is refused, whatever it holds
        format_of(path, _start_of(path))
    data = read_bytes(path)
    return format_of(path, data), data


def content_note(path: str | os.PathLike[str], source_format: Format) -> str:
    """A remark on a file whose suffix is not that of its format, "" where it is."""
    suffix = Path(path).suffix.lower()
    if suffix in source_format.suffixes:
        return ""
    return f"its content is {source_format.suffix[1:].upper()}, though its suffix is {suffix}"


def read_source(
    path: Path, source_format: Format, skeleton: Skeleton | None, data: bytes
) -> Motion:
    """The motion in the bytes ``data`` of the file ``path``."""
    arguments = (skeleton,) if source_format.wants_skeleton else ()
    motion: Motion = _named(path, source_format.read, data, path.stem, *arguments)
    if note := content_note(path, source_format):
        notes = filter(None, (note, motion.metadata.get("source-note", "")))
        metadata = dict(motion.metadata) | {"source-note": "; ".join(notes)}
        motion = replace(motion, metadata=metadata)
    if motion.source is None:
        return motion
    return replace(motion, source=replace(motion.source, path=path.name))


def _named(path: Path, reader: Any, data: bytes, *arguments: object) -> Any:
    """What ``reader`` makes of ``data``; its errors say which file."""
    if not data:
        raise SourceError("the file is empty", path=path)
    try:
        return reader(data, *arguments)
    except MczError as error:
        error.add(path=path, note=_other_content(path, data))
        raise


def _other_content(path: Path, data: bytes) -> str | None:
    """A note where a file that cannot be read begins as one of another suffix does."""
    formats = [FORMATS[name] for name in likely_formats(data)]
    found = [known.suffix for known in formats if known.is_motion is None or known.is_motion(data)]
    return f"it looks like {found[0]}" if found and path.suffix.lower() not in found else None


def _start_of(path: Path) -> bytes:
    """The first bytes of a file, none where there is no such file."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except OSError:
        return b""


def read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SourceError(reason_of(error), path=path) from None
