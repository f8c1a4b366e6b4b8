"""The Source of a text file that was read, and its encoding."""

from __future__ import annotations

import hashlib

from mcz.formats.layout import Layout
from mcz.formats.rows import Rows
from mcz.motion import Source


def text_encoding(data: bytes) -> str:
    """ "utf-8" where all of ``data`` is, otherwise "latin-1", which every byte string is."""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def source_of(
    format_name: str, data: bytes, header: tuple[bytes, ...], rows: Rows, count: bytes = b""
) -> Source:
    """The source of a file that was read as ``header`` and ``rows``; ``count``: as printed."""
    usual = count in (b"", b"%d" % rows.n_rows)
    layout = Layout(
        header,
        rows.patterns,
        b"" if usual else count,
        0 if usual else rows.n_rows,
        rows.ending,
    )
    template, detail = layout.build()
    digest = hashlib.sha256(data).digest()
    return Source(format_name, template, detail, rows.notes, size=len(data), sha256=digest)
