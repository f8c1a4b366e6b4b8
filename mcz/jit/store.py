"""Machine code kept in a folder, so that a kernel is compiled once and not in each process.

A file's name says what its code was compiled from, so a file never becomes wrong: after a change it
is not found. Files are written beside their place and renamed, and begin with the hash of the rest;
one that does not is taken for absent. The folder is ``MCZ_CACHE_DIR``, or ``mcz/loops`` in the
user's folder of caches. Where nothing can be written, nothing is kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import tempfile
from pathlib import Path

HASH_SIZE = hashlib.sha256().digest_size


def folder() -> Path | None:
    """Where machine code is kept; None where the user has no folder."""
    if given := os.environ.get("MCZ_CACHE_DIR"):
        return Path(given)
    try:
        return user_cache() / "loops"
    except RuntimeError:
        return None


def user_cache() -> Path:
    """The folder of MCZ below that of the user's caches; RuntimeError where there is no home."""
    home = Path.home()
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or str(home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(home / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(home / ".cache")
    return Path(base) / "mcz"


def load(name: str) -> bytes | None:
    """What was saved under ``name``, or None."""
    place = folder()
    if place is None:
        return None
    try:
        content = (place / name).read_bytes()
    except OSError:
        return None
    code = content[HASH_SIZE:]
    return code if hashlib.sha256(code).digest() == content[:HASH_SIZE] else None


def save(name: str, code: bytes) -> None:
    """Keep ``code`` under ``name`` where that is possible."""
    place = folder()
    if place is None:
        return
    with contextlib.suppress(OSError):
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, written = tempfile.mkstemp(prefix="writing-", dir=place)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(code).digest() + code)
            os.replace(written, place / name)
        except BaseException:
            os.unlink(written)
            raise
