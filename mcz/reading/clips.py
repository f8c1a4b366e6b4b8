"""The clips of a file by name, each made when it is asked for."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from weakref import WeakValueDictionary

from mcz.container.reader import Container
from mcz.reading.clip import Clip

KEPT = 64


class Clips(Mapping[str, Clip]):
    """In file order. A clip is the same object as long as anybody has it.

    Of those that nobody has, the last ``KEPT`` are kept. A clip keeps what was read of it, so that
    work on all clips of an archive would otherwise hold the whole archive in the end.
    """

    def __init__(self, container: Container) -> None:
        self._container = container
        self._alive: WeakValueDictionary[str, Clip] = WeakValueDictionary()
        self._last: deque[Clip] = deque(maxlen=KEPT)

    def __getitem__(self, name: str) -> Clip:
        found = self._alive.get(name)
        if found is None:
            made = Clip(self._container, self._container.directory.clips[name])
            found = self._alive.setdefault(name, made)  # another thread may have made it, too
            self._last.append(found)
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._container.directory.clips

    def __iter__(self) -> Iterator[str]:
        return iter(self._container.directory.clips)

    def __len__(self) -> int:
        return len(self._container.directory.clips)
