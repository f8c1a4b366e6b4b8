"""Detection of motion in array files by their first bytes."""

from __future__ import annotations

import re

from mcz.sources.arrays.header import MAGIC, has_rows

DIRECTORY_END = b"PK\5\6"


def is_motion(data: bytes) -> bool:
    """Return True if an NPY or NPZ that begins with ``data`` may have a row of numbers per frame.

    What cannot be told from these bytes counts: the reader says what is wrong.
    """
    heads = [match.start() for match in re.finditer(re.escape(MAGIC), data)]
    is_whole = not data.startswith(b"PK") or DIRECTORY_END in data
    return not heads or not is_whole or any(has_rows(data[at:]) for at in heads)
