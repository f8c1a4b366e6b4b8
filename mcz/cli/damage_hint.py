"""Hint at what can be salvaged from a damaged file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mcz.errors import FormatError, LimitError, MczError, UnsupportedError
from mcz.hints import Hint
from mcz.model.text_format import counted
from mcz.model.types import Params


@contextmanager
def hinted(target: str | bytes, options: Params) -> Iterator[None]:
    """Add the intact parts of a damaged file, and the hint to salvage them, to its error."""
    try:
        yield
    except (UnsupportedError, LimitError):
        raise
    except FormatError as error:
        from mcz.files.reading.file import is_source

        whole = None if options.get("salvage") else _whole(target)
        if whole is not None:
            error.add(note=whole, hint=Hint.SALVAGE)
        elif isinstance(target, str) and is_source(target):
            error.add(hint=Hint.ENCODE)
        raise


def _whole(target: str | bytes) -> str | None:
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
    found = [counted(count, what) for count, what in counts if count]
    if not found:
        return None
    return f"it holds {', '.join(found)}"
