"""Write locks: one process writes to a file at a time, and others can see it.

A lock is advisory, and some file systems have none; then writing continues without.
"""

from __future__ import annotations

import errno
import sys
import time
from typing import BinaryIO

BUSY = (errno.EACCES, errno.EAGAIN)  # errors of a lock held by another process
LOCK_OFFSET = 2**62  # Windows locks bytes; no file has one here
PATIENCE, PAUSE = 0.2, 0.01  # seconds: a reader holds the lock only for an instant


def lock(stream: BinaryIO) -> bool:
    """Lock the file of ``stream`` until it closes; False if another process has it."""
    until = time.monotonic() + PATIENCE
    while _take(stream) is False:
        if time.monotonic() > until:
            return False
        time.sleep(PAUSE)
    return True


def is_locked(stream: BinaryIO) -> bool:
    """Return True if another process has locked the file of ``stream``."""
    taken = _take(stream)
    if taken:
        _release(stream)
    return taken is False


def is_abandoned(stream: BinaryIO) -> bool:
    """Return True, with the file locked, for a file that its writer has abandoned."""
    return _take(stream) is True


if sys.platform == "win32":
    import msvcrt

    def _take(stream: BinaryIO) -> bool | None:
        """Try to lock the file; None on systems without locks."""
        return _lock_far(stream, msvcrt.LK_NBLCK)

    def _release(stream: BinaryIO) -> None:
        _lock_far(stream, msvcrt.LK_UNLCK)

    def _lock_far(stream: BinaryIO, mode: int) -> bool | None:
        at = stream.tell()
        try:
            stream.seek(LOCK_OFFSET)
            msvcrt.locking(stream.fileno(), mode, 1)
        except OSError as error:
            return False if error.errno in BUSY else None
        finally:
            stream.seek(at)
        return True

else:
    import fcntl

    def _take(stream: BinaryIO) -> bool | None:
        """Try to lock the file; None on systems without locks."""
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return False if error.errno in BUSY else None
        return True

    def _release(stream: BinaryIO) -> None:
        fcntl.flock(stream, fcntl.LOCK_UN)
