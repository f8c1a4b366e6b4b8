"""The frames of a live clip in order, with substitutes for missing ones.

SPEC.md, "Live streams with losses", has the limits; the substitute of a lost frame is a reader's
choice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mcz.errors import LostFrameError
from mcz.model.text_format import brief
from mcz.model.types import Floats, Values

Mask = NDArray[np.bool_]
State = Literal["decoded", "concealed", "missing"]
Lost = Literal["refuse", "missing", "hold", "linear"]
LOST = ("refuse", "missing", "hold", "linear")


@dataclass(frozen=True, slots=True)
class LiveFrame:
    """A frame of a clip, from 0: its values and their validity, both (n_channels,).

    ``values`` are NaN where invalid. ``state``: they come from the file (``decoded``), are a
    substitute for a frame that is lost or could not be decoded (``concealed``), or are unknown
    (``missing``).
    """

    number: int
    values: Values
    valid: Mask
    state: State = "decoded"

    __repr__ = brief


class Concealer:
    """Puts frames in order; ``lost`` decides the substitute of missing ones.

    ``shown`` are the stored frames that the clip shows, None for all; input counts stored frames,
    output the shown ones. ``due`` is the stored frame that comes next, None as long as it is
    unknown. ``spend`` decides whether so many may be concealed.
    """

    def __init__(
        self,
        n_channels: int,
        lost: Lost,
        shown: range | None,
        spend: Callable[[int], bool],
        *,
        join: bool = False,
    ) -> None:
        self._first = 0 if shown is None else shown.start
        self._stop = None if shown is None else shown.stop
        self.due: int | None = None if join else self._first
        self._lost, self._spend = lost, spend
        self._nothing = np.full(n_channels, np.nan), np.zeros(n_channels, np.bool_)
        self._last: tuple[Floats, Mask] | None = None
        self._owed = 0  # frames before the one due that wait for the next decoded one
        self.is_whole = not join  # every shown frame up to now was decoded

    def give(self, number: int, values: Floats, mask: Mask | None) -> Iterator[LiveFrame]:
        """Add a decoded frame; earlier ones that are due were not decoded."""
        yield from self.reach(number)
        assert self.due is not None
        if number < self.due or (self._stop is not None and number >= self._stop):
            return
        valid = np.ones(values.shape, np.bool_) if mask is None else mask
        shown = values if mask is None else np.where(valid, values, np.nan)
        if self._owed:
            yield from self._between(shown, valid)
        self.due, self._last = number + 1, (shown, valid)
        yield LiveFrame(number - self._first, shown, valid)  # LIVE-02

    def reach(self, number: int) -> Iterator[LiveFrame]:
        """Note that no frame before ``number`` will come."""
        if self.due is None:
            self.due = max(self._first, number)
            self.is_whole = self.due == self._first
        if self._stop is not None:
            number = min(number, self._stop)
        count = number - self.due
        if count <= 0:
            return
        self.is_whole = False
        if self._lost == "refuse":
            raise LostFrameError(f"frame {self.due - self._first} did not come")
        if not self._spend(count):  # LIVE-12
            yield from self.end()
            self.due = number
        elif self._lost == "linear" and self._last is not None:
            self.due += count
            self._owed += count
        else:
            for _ in range(count):
                self.due += 1
                yield self._held(self.due - 1)

    def end(self) -> Iterator[LiveFrame]:
        """Note that no frame follows the missing ones."""
        owed, self._owed = self._owed, 0
        for number in range((self.due or 0) - owed, self.due or 0):
            yield self._held(number)

    def _held(self, number: int) -> LiveFrame:
        if self._last is None or self._lost == "missing":
            return LiveFrame(number - self._first, *self._nothing, "missing")
        return LiveFrame(number - self._first, *self._last, "concealed")  # LIVE-01

    def _between(self, values: Floats, valid: Mask) -> Iterator[LiveFrame]:
        """The frames that are owed, on straight lines from the last decoded one to ``values``."""
        assert self._last is not None
        assert self.due is not None
        before, known = self._last
        both, steps = known & valid, self._owed + 1
        for k in range(1, steps):
            row = np.where(both, before + (values - before) * (k / steps), np.nan)
            yield LiveFrame(self.due - steps + k - self._first, row, both, "concealed")
        self._owed = 0
