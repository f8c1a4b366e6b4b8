"""A line of progress for work over a second, on a terminal only."""

from __future__ import annotations

import sys
import time

from mcz.cli.terminal import STATUS

PATIENCE = 1.0  # seconds of work before the line appears
INTERVAL = 0.1  # seconds between two states of it
BAR = 24  # columns


class Progress:
    """A callable ``progress(done, total, what)`` and a context that removes its line."""

    def __init__(self) -> None:
        self._due = time.monotonic() + PATIENCE
        self._is_shown = sys.stderr is not None and sys.stderr.isatty()

    def __call__(self, done: int, total: int, what: str) -> None:
        now = time.monotonic()
        if self._is_shown and now >= self._due:
            self._due = now + INTERVAL
            share = min(done / total, 1.0) if total > 0 else 1.0
            bar = "#" * int(BAR * share)
            STATUS.show(f"[{bar:-<{BAR}}] {share:4.0%} {what}")

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        STATUS.remove()
