"""Times of last change, as the metadata key ``mtime`` has them: ISO 8601 in UTC."""

from __future__ import annotations

import os
import re
from datetime import UTC, datetime
from pathlib import Path

SECOND = 10**9
FORM = re.compile(r"([0-9-]{10}T[0-9:]{8})(?:\.([0-9]{1,9}))?Z")


def stamp(path: Path) -> str:
    """The time of a file, with as many decimals as it needs; raises OSError.

    >>> import tempfile
    >>> path = Path(tempfile.mkstemp()[1])
    >>> os.utime(path, ns=(0, 1_500_000_000_250_000_000))
    >>> stamp(path), nanoseconds(stamp(path))
    ('2017-07-14T02:40:00.25Z', 1500000000250000000)
    """
    seconds, rest = divmod(path.stat().st_mtime_ns, SECOND)
    text = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return text + (f".{rest:09d}".rstrip("0") if rest else "") + "Z"


def nanoseconds(text: str) -> int | None:
    """Nanoseconds since 1970; None for what is no such time."""
    match = FORM.fullmatch(text)
    if not match:
        return None
    try:
        seconds = int(datetime.fromisoformat(match[1] + "+00:00").timestamp())
    except (ValueError, OverflowError):
        return None
    return seconds * SECOND + int((match[2] or "").ljust(9, "0"))


def set_time(path: Path, text: str | None) -> bool:
    """Give a file the time that its metadata state; return whether they do."""
    found = None if text is None else nanoseconds(text)
    if found is not None:
        os.utime(path, ns=(found, found))
    return found is not None
