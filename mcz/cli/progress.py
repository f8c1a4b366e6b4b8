"""A progress bar for work over a second, on a terminal only."""

from __future__ import annotations

import sys
import time
from typing import Any

from mcz.cli.terminal import printable

PATIENCE = 1.0  # seconds of work before a bar appears


class Progress:
    """A callable ``progress(done, total, what)`` and a context that takes its bar away.

    rich is imported when the bar first appears, so quick commands never pay for it.
    """

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._wanted = sys.stderr is not None and sys.stderr.isatty()
        self.bar: Any = None  # rich's, once it shows
        self.task: Any = None

    def __call__(self, done: int, total: int, what: str) -> None:
        if not self._wanted or time.monotonic() - self._started < PATIENCE:
            return
        if self.bar is None:
            self._show()
        self.bar.update(self.task, completed=done, total=total, description=_plain(what))

    def _show(self) -> None:
        from rich.console import Console
        from rich.progress import Progress as Bar

        self.bar = Bar(console=Console(stderr=True), transient=True)
        self.task = self.bar.add_task("")
        self.bar.start()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()


def _plain(what: str) -> str:
    """A name as a bar may show it: rich would take [words in brackets] for its own."""
    from rich.markup import escape

    return escape(printable(what))
