"""The clips of a file by name, each made when it is asked for."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from weakref import WeakValueDictionary

from mcz import brief
from mcz.container.directory import ClipRow
from mcz.container.reader import Container
from mcz.errors import OptionError, UnknownNameError
from mcz.reading.clip import Clip
from mcz.reading.names import clip_called, clips_meant

KEPT = 64


class Clips(Mapping[str, Clip]):
    """In file order, found by whatever ``File.only_clip`` takes.

    A clip is the same object as long as anybody has it.
    Of those that nobody has, the last ``KEPT`` are kept. A clip keeps what was read of it, so that
    work on all clips of an archive would otherwise hold the whole archive in the end.
    """

    def __init__(self, container: Container) -> None:
        self._container = container
        self.rows: Mapping[str, ClipRow] = container.directory.clips  # by their own names alone
        self.aliases: Mapping[str, tuple[int, bytes]] = container.directory.aliases
        self._alive: WeakValueDictionary[str, Clip] = WeakValueDictionary()
        self._last: deque[Clip] = deque(maxlen=KEPT)

    __repr__ = brief.clips_text

    def __getitem__(self, name: str) -> Clip:
        """The clip that ``name`` means; raises UnknownNameError, which suggests a name."""
        if not isinstance(name, str):
            raise UnknownNameError(f"{name!r} is not the name of a clip", path=self.file_name)
        if name not in self.rows:
            try:
                name = clip_called(self, name)
            except OptionError as error:
                raise UnknownNameError(error.message, path=self.file_name) from None
        found = self._alive.get(name)
        if found is None:
            made = Clip(self._container, self.rows[name])
            found = self._alive.setdefault(name, made)  # another thread may have made it, too
            self._last.append(found)
        return found

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and len(clips_meant(self, name)) == 1

    def __iter__(self) -> Iterator[str]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def file_name(self) -> str:
        return self._container.source.name
