"""Count of open pages, and notice when all have been closed for a while."""

from __future__ import annotations

from functools import partial
from threading import Condition

PULSE = 0.5  # seconds between two looks, so that Ctrl-C is heard on every system


class Visitors:
    """A context is a page that is open; ``grace``: seconds in which one may come back."""

    def __init__(self, grace: float) -> None:
        self._grace = grace
        self._n_open = self._n_seen = 0
        self.is_closing = False
        self._changed = Condition()

    def __enter__(self) -> Visitors:
        with self._changed:
            self._n_open += 1
            self._n_seen += 1
            self._changed.notify_all()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._n_open -= 1
            self._changed.notify_all()

    def close(self) -> None:
        """Let everybody who waits go on."""
        with self._changed:
            self.is_closing = True
            self._changed.notify_all()

    def stay(self, seconds: float) -> bool:
        """Wait so long; whether the page may stay open then."""
        with self._changed:
            self._changed.wait_for(lambda: self.is_closing, seconds)
            return not self.is_closing

    def wait(self, *, for_ever: bool = False) -> None:
        """Wait until a page was there and all have been gone for the time of grace.

        ``for_ever``: until ``close``, whoever comes and goes.
        """
        with self._changed:
            while not self.is_closing:
                seen = self._n_seen
                if for_ever or not seen or self._n_open:
                    self._changed.wait(PULSE)
                elif not self._changed.wait_for(partial(self._is_back, seen), self._grace):
                    return

    def _is_back(self, seen: int) -> bool:
        return self.is_closing or self._n_seen > seen
