"""Functions for processes of a pool in tests, with few imports."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from mcz import TruncatedError


def join_state(state: str, item: int) -> tuple[str, int]:
    return state, item


def fails(state: str, item: int) -> None:
    raise TruncatedError(f"item {item}", last_foot=7)


def dies_once(state: str, path: Path) -> int:
    if not path.exists():
        path.touch()
        os._exit(3)
    return os.getpid()


def dies(state: str, item: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)
