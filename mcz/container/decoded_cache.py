"""Cache of decoded segments, for neighboring windows."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.model.types import Values

MOST_BYTES = 8 * 2**20  # of a file
MOST_OF_ONE = MOST_BYTES // 2


class Run(NamedTuple):
    """All shown frames, from ``start`` on, of segments that hang together."""

    start: int
    values: Values
    mask: NDArray[np.bool_] | None  # None: all valid

    @property
    def n_bytes(self) -> int:
        return self.values.nbytes + (0 if self.mask is None else self.mask.nbytes)


class DecodedCache:
    """Runs by key, the last used ones: at most ``most_bytes`` of a file."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most = most_bytes
        self._runs: OrderedDict[Hashable, Run] = OrderedDict()
        self._size = 0
        self._lock = Lock()  # a file may be read by several threads

    def get(self, key: Hashable) -> Run | None:
        with self._lock:
            if key in self._runs:
                self._runs.move_to_end(key)
            return self._runs.get(key)

    def put(self, key: Hashable, run: Run) -> None:
        """Keep a run, which must not be changed any more, in place of older ones."""
        with self._lock:
            if key not in self._runs:
                self._runs[key] = run
                self._size += run.n_bytes
            while self._size > self._most:
                self._size -= self._runs.popitem(last=False)[1].n_bytes


class SharedCache(DecodedCache):
    """The runs of one file in a store that several files share."""

    def __init__(self, store: DecodedCache, owner: Hashable) -> None:
        self._store, self._owner = store, owner

    def get(self, key: Hashable) -> Run | None:
        return self._store.get((self._owner, key))

    def put(self, key: Hashable, run: Run) -> None:
        self._store.put((self._owner, key), run)
