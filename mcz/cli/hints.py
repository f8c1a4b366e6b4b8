"""Hints in words of the command line, and the hint at parts that salvage can read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mcz.errors import FormatError, LimitError, MczError, UnsupportedError
from mcz.hints import PYTHON_HINTS, Hint, Words, worded
from mcz.model.text_format import counted
from mcz.model.types import Params

OPTION_HINTS: Words = {
    Hint.BLENDER: PYTHON_HINTS[Hint.BLENDER],
    Hint.CONVERT: "choose a format with --to",
    Hint.ENCODE: "encode a source file with mcz encode",
    Hint.FEET: "name the joints of feet (--feet)",
    Hint.FILM: "make it shorter (--speed, --fps, --frames)",
    Hint.FORCE: "use --force to replace it",
    Hint.FORCE_RATE: "--force-rate overrides it",
    Hint.FRAMES: "write only some of the frames (--frames)",
    Hint.JOBS: "--jobs 1 needs less memory",
    Hint.KEEP_ALL: "--keep-all keeps it",
    Hint.KEY_ERROR: "allow a larger error (--key-error)",
    Hint.LARGE: "--profile large allows more",
    Hint.MAX_DECODED: "raise it with --max-decoded",
    Hint.NAME_CODEC: "--codec re-encodes it",
    Hint.OLD_FORMAT: PYTHON_HINTS[Hint.OLD_FORMAT],
    Hint.PAGE: "select clips (--clip), choose --codec lossy, or allow more bytes (--max-size)",
    Hint.PORTABLE_NAMES: "--names portable writes both",
    Hint.RATE: "set the frame rate (--rate)",
    Hint.RECODE: "--recode re-encodes them",
    Hint.RECODE_LOSSY: "--recode re-encodes them, which adds a small error",
    Hint.REPLACE: "replace it with mcz append --replace",
    Hint.SALVAGE: "--salvage reads them, mcz repair writes them to a valid file",
    Hint.SERIES: "choose channels by name (--channel)",
    Hint.SKELETON: "choose one with --skeleton, or 'none'",
    Hint.UNIT: "set the unit (--unit)",
    Hint.UP: "set the up axis (--up)",
    Hint.VERBATIM: "--verbatim keeps the file as an attachment",
}


def in_options(text: str) -> str:
    """``text`` with its hint, if it has one, in words of the command line."""
    return worded(text, OPTION_HINTS)


@contextmanager
def add_salvage_hint(target: str | bytes, options: Params) -> Iterator[None]:
    """Add the intact parts of a damaged file, and the hint to salvage them, to its error."""
    try:
        yield
    except (UnsupportedError, LimitError):
        raise
    except FormatError as error:
        from mcz.files.reading.file import is_source

        whole = None if options.get("salvage") else _intact_counts(target)
        if whole is not None:
            error.add(note=whole, hint=Hint.SALVAGE)
        elif isinstance(target, str) and is_source(target):
            error.add(hint=Hint.ENCODE)
        raise


def _intact_counts(target: str | bytes) -> str | None:
    """Counts of the intact parts of a damaged local file; None if there are none."""
    import mcz

    if isinstance(target, str) and "://" in target:
        return None  # all of it would have to be read
    try:
        with mcz.open(target, salvage=True) as file:
            rows = file.container.directory.clips.values()
            clips = sum(row.cend is not None and not row.damage for row in rows)
            damaged, attachments = len(rows) - clips, len(file.attachments)
    except MczError:
        return None
    counts = ((clips, "whole clip"), (damaged, "damaged clip"), (attachments, "attachment"))
    parts = [counted(count, what) for count, what in counts if count]
    if not parts:
        return None
    return f"it holds {', '.join(parts)}"
