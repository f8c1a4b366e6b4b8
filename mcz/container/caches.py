"""Caches of an open file: decoded segments, for neighboring windows, and metadata of clips."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from sys import intern
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcz.container import payloads
from mcz.container.chunks import Chunk
from mcz.container.directory import ClipRow
from mcz.container.limits import MIB
from mcz.model.schema import parse_until
from mcz.model.types import Values

MOST_BYTES = 8 * 2**20  # of a file
MOST_OF_ONE = MOST_BYTES // 2
LAST_RUNS = 32  # whose use tells how the next will be used
LEAST_SHARE = 0.5  # used again: a whole run costs about two parts


class Run(NamedTuple):
    """All shown frames, from ``start`` on, of segments that depend on each other."""

    start: int
    values: Values
    mask: NDArray[np.bool_] | None  # None: all valid

    @property
    def n_bytes(self) -> int:
        return self.values.nbytes + (0 if self.mask is None else self.mask.nbytes)


@dataclass(slots=True)
class _Entry:
    run: Run | None  # None: only a part of it was decoded
    size: int
    is_used_again: bool = False


class DecodedCache:
    """Runs by key, the last used ones: at most ``most_bytes`` of a file."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most = most_bytes
        self._entries: OrderedDict[Hashable, _Entry] = OrderedDict()
        self._size = 0
        self._share = 1.0  # of the last runs, those that were used again, not dropped before
        self._lock = Lock()  # a file may be read by several threads

    def get(self, key: Hashable) -> Run | None:
        with self._lock:
            entry = self._entries.get(key)
            if entry is None:
                return None
            self._entries.move_to_end(key)
            if not entry.is_used_again:
                entry.is_used_again = True
                self._count(True)
            return entry.run

    def is_worthwhile(self, key: Hashable, size: int) -> bool:
        """Return False if a run of ``size`` bytes is probably not used again while it is here.

        It is noted; if it is needed again soon, it is worthwhile.
        """
        with self._lock:
            if key in self._entries or self._share >= LEAST_SHARE:
                return True
            self._add(key, _Entry(None, size))
            return False

    def put(self, key: Hashable, run: Run) -> None:
        """Keep a run, which must not be changed any more, in place of older ones."""
        with self._lock:
            entry = self._entries.pop(key, None)
            if entry is not None:
                self._size -= entry.size
            self._add(key, _Entry(run, run.n_bytes, entry is not None))

    def _add(self, key: Hashable, entry: _Entry) -> None:
        self._entries[key] = entry
        self._size += entry.size
        while self._size > self._most:
            _, oldest = self._entries.popitem(last=False)
            self._size -= oldest.size
            if not oldest.is_used_again:
                self._count(False)

    def _count(self, is_used_again: bool) -> None:
        self._share += (is_used_again - self._share) / LAST_RUNS


class SharedCache(DecodedCache):
    """The runs of one file in a store that several files share."""

    def __init__(self, store: DecodedCache, owner: Hashable) -> None:
        self._store, self._owner = store, owner

    def get(self, key: Hashable) -> Run | None:
        return self._store.get((self._owner, key))

    def is_worthwhile(self, key: Hashable, size: int) -> bool:
        return self._store.is_worthwhile((self._owner, key), size)

    def put(self, key: Hashable, run: Run) -> None:
        self._store.put((self._owner, key), run)


MOST_KEPT = 16 * MIB  # bytes, about: 40,000 clips of three keys
PAIR = 100  # bytes of a pair in Python, without its letters


class MetadataCache:
    """Cache of the metadata in CLIPs, up to ``MOST_KEPT``."""

    def __init__(self) -> None:
        self._pairs: dict[str, dict[str, str]] = {}
        self._size = 0

    def of(self, row: ClipRow, payload: Callable[[Chunk], bytes]) -> Mapping[str, str]:
        """Return the metadata in the CLIP of ``row``, whose payload is read unless cached."""
        pairs = self._pairs.get(row.name)
        if pairs is None:
            clip = parse_until(payloads.Clip, payload(row.clip), row.clip.label, "source")
            pairs = {intern(pair.key): pair.value for pair in clip.metadata}
            self._size += PAIR + sum(PAIR + len(key) + len(pairs[key]) for key in pairs)
            if self._size <= MOST_KEPT:
                self._pairs[row.name] = pairs
        return pairs
