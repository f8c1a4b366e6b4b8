"""A source of bytes some of which are known better than it has them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from typing import Any

from mcz.container.source import ByteSource


class Overlay(ByteSource):
    """``source`` with other bytes at some offsets; all else it leaves to ``source``.

    ``parts`` do not overlap. One that lies behind the end can be read, whole or in part, though
    ``size`` stays. What is pickled opens ``source`` anew, without them.
    """

    def __init__(self, source: ByteSource, parts: Mapping[int, bytes]) -> None:
        self._source = source
        self.parts = dict(sorted(parts.items()))
        self._starts = list(self.parts)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or "_source" not in self.__dict__:
            raise AttributeError(name)
        return getattr(self._source, name)

    def read(self, offset: int, size: int) -> bytes:
        """The ``size`` bytes at ``offset``; raises TruncatedError where the file ends before."""
        stop = offset + size
        first = max(0, bisect_right(self._starts, offset) - 1)
        near = self._starts[first : bisect_left(self._starts, stop)]
        met = [start for start in near if start + len(self.parts[start]) > offset]
        if not met:
            return self._source.read(offset, size)
        if met[0] <= offset and stop <= met[0] + len(self.parts[met[0]]):
            return self.parts[met[0]][offset - met[0] : stop - met[0]]
        data = bytearray(self._source.read(offset, size))
        for start in met:
            part = self.parts[start]
            begin, end = max(start, offset), min(start + len(part), stop)
            data[begin - offset : end - offset] = part[begin - start : end - start]
        return bytes(data)

    def with_more(self, parts: Mapping[int, bytes]) -> Overlay:
        """The same source with ``parts`` beside those that it has."""
        return Overlay(self._source, self.parts | dict(parts))

    def close(self) -> None:
        self._source.close()
